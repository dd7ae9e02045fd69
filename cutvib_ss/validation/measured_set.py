"""
Measured machines with an exactly known cause: elements added to the records of measured rigs, sealed and scored as any trial.

The noise, the drift, the law of the rig and the misfit of its nominal model are real; kind, place and size of what is added are
known. The rig keeps its documented cause, so that the truth is the pair. On frequency responses every element is added exactly,
F (1 + z H), and leaves the resonance in the band; where that is too narrow for a spring or a mass beyond the tolerances, only
resonators are added. On histories only springs are: k times the displacement is exact however a record begins and ends, whereas
a mass or a resonator asks for derivatives of a measured motion that does not rest at its ends.
"""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.campaign import read_campaign
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.results import FloatArray
from cutvib_ss.validation.files import packed
from cutvib_ss.validation.measured import DocumentedCause, add_element, read_label
from cutvib_ss.validation.plan import Request, Settings, settings
from cutvib_ss.validation.trial import Tools
from cutvib_ss.validation.workers import Made

DOCUMENTED: Mapping[str, tuple[str, ...]] = {
    "silverbox": ("cubic_stiffness",),
    "drive axis": ("dry_friction", "joint_slip"),
    "bolted beam": ("joint_slip", "dry_friction"),
}
"""
Documented causes of rigs that come without a label.toml, by the title of their campaign; several where they are one physically.

Silverbox: Wigren and Schoukens (2013). Drive axis: EMPS, Janot, Gautier and Brunot (2019). Bolted beam: Brake-Reuss beam,
Mechanical Systems and Signal Processing 166 (2022) 108401.
"""

UNITS = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}
MACHINE = "measured"
"""Kind of the machine in the labels."""

SHIFTS: Mapping[str, str] = {"spring": "stiffness", "mass": "mass"}
"""What each kind of element is on one coordinate: a shift of this value of the structure."""


@dataclass(frozen=True)
class Added:
    """An element by name of the catalogue, its dynamic stiffness over s, and what it is called when it is documented."""

    effect: str
    stiffness: Callable[[Any], Any]
    parameters: Mapping[str, float]


def elements(
    mass: float, stiffness: float, centre: float, room: float, rng: np.random.Generator
) -> Mapping[str, Added]:
    """
    One element of each kind, of a size that shows on a structure of this mass and stiffness whose band is about a frequency.

    ``room`` is the way from that frequency to the nearer end of the band, over the frequency: no element moves the resonance
    farther than 0.6 of it.
    """
    factor = float(np.exp(rng.uniform(np.log(0.6), np.log(1.7))))
    # A body without a spring gets one on which it would swing at the middle of its band.
    most = 0.7 * room
    k = min(0.12, most) * factor * (stiffness or mass * (2 * np.pi * centre) ** 2)
    m, hung = min(0.09, most) * factor * mass, min(0.06, most**2) * factor * mass
    omega = 2 * np.pi * centre * (1 + min(1.0, 3 * room) * float(rng.uniform(-0.2, 0.2)))
    zeta = min(1.0, 10 * room) * float(rng.uniform(0.01, 0.05))

    def resonator(s: Any) -> Any:
        spring = 2 * zeta * omega * s + omega**2
        return hung * s**2 * spring / (s**2 + spring)

    return {
        "spring": Added("tool_contact", lambda s: k + 0 * s, {"stiffness": k, "damping": 0.0}),
        "mass": Added("added_mass", lambda s: m * s**2, {"mass": m}),
        "resonator": Added(
            "local_resonator", resonator, {"mass": hung, "frequency": omega / (2 * np.pi), "damping_ratio": zeta}
        ),
    }


def available(data: Path) -> tuple[str, ...]:
    """Every case that the measured rigs below a folder allow: ``campaign|kind of element|number``."""
    names = []
    for file in sorted(data.rglob("campaign.toml")):
        campaign = read_campaign(file.parent)
        if _documented(file.parent, campaign) is None or not _one_coordinate(campaign):
            continue
        if any(r.histories for r in campaign.records):
            kinds = [("spring", 0), ("spring", 1)]
        elif _narrow(campaign):
            kinds = [("resonator", 0), ("resonator", 1)]
        else:
            kinds = [("spring", 0), ("mass", 0), ("resonator", 0)]
        names += [f"{file.parent.relative_to(data).as_posix()}|{kind}|{k}" for kind, k in kinds]
    if not names:
        raise ParameterError(
            f"{data}: holds no campaign of one coordinate with a documented cause; put a label.toml beside its campaign.toml"
        )
    return tuple(names)


def measured_trial(data: Path, seed: int) -> tuple[Settings, Tools]:
    """Settings and tools of a sealed trial over all cases that a folder allows; the same seed makes the same elements."""
    names = available(data)
    still = "none=0,outside=0,pair=0,drifting=0,varied=0,rough=0,structure=0"
    return replace(settings(len(names), seed, still), measured=True), Tools(partial(made, data, seed), None, names, ())


def made(data: Path, seed: int, request: Request) -> Made:
    """One case: the campaign with an element in all its records, and the label."""
    name = str(request.cause)
    where, kind, _ = name.split("|")
    folder = data / where
    campaign = read_campaign(folder)
    documented = _documented(folder, campaign)
    if documented is None or campaign.machine.has_position:
        raise ParameterError(
            f"{folder}: has no documented cause; the measured rigs have changed since the trial was planned"
        )
    machine, place = campaign.machine, campaign.machine.input_port
    rng = np.random.default_rng([seed, *name.encode()])
    mass, stiffness = (float(m[0, 0]) for m in (machine.system.mass, machine.system.stiffness))
    added = elements(mass, stiffness, _centre(campaign), _room(campaign), rng)[kind]
    pairs = [(f"{a}+{b}", f"{p}+{q}") for (a, p), (b, q) in _orders(documented, added.effect, place)]
    label = {
        "effect": pairs[0][0], "place": pairs[0][1], "or": [{"effect": e, "place": p} for e, p in pairs[1:]],
        "parameters": {added.effect: dict(added.parameters)}, "kind": "pair", "machine": MACHINE, "severity": None,
        "equivalent_shifts": {SHIFTS[kind]: [added.effect, place]} if kind in SHIFTS else {},
        "gap_sigma": None, "form": f"{kind} added to {where}", "grade": 0, "conditions": {}, "oracle": None,
    }  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="cutvib-") as draft:
        out = Path(draft) / "campaign"
        write(campaign, [add_element(r, added.stiffness) for r in campaign.records], folder, out)
        return Made(label, packed(out))


def _orders(documented: DocumentedCause, effect: str, place: str) -> list[tuple[tuple[str, str], tuple[str, str]]]:
    """The documented cause, by each of its names, beside what was added."""
    return [((e, p), (effect, place)) for e, p in product(documented.effects, documented.places)]


def _documented(folder: Path, campaign: Campaign) -> DocumentedCause | None:
    """The cause by the label beside a campaign, or of a rig that is known."""
    label = read_label(folder)
    if label is not None:
        return label
    effects = DOCUMENTED.get(campaign.title)
    return None if effects is None else DocumentedCause(effects, (campaign.machine.input_port,))


def _one_coordinate(campaign: Campaign) -> bool:
    """Whether the one channel reads the drive point of a structure of one coordinate under a force."""
    machine = campaign.machine
    if machine.has_position or machine.input_quantity != "force" or len(machine.system.mass) != 1:
        return False
    return all(len(r.channels) == 1 for r in campaign.records)


def _centre(campaign: Campaign) -> float:
    """The resonance of the nominal structure; of a free body a frequency of its motion [Hz]."""
    mass, stiffness = campaign.machine.system.mass[0, 0], campaign.machine.system.stiffness[0, 0]
    return float(np.sqrt(stiffness / mass) / (2 * np.pi)) if stiffness else 1.5


def _room(campaign: Campaign) -> float:
    """The way from the resonance to the nearer end of the band that all records share, over the resonance; 1 for histories."""
    lines = [r.frf.freq for r in campaign.records if r.frf is not None]
    if not lines:
        return 1.0
    centre = _centre(campaign)
    low, high = max(f.min() for f in lines), min(f.max() for f in lines)
    return max(float(min(centre - low, high - centre)) / centre, 1e-3)


def _narrow(campaign: Campaign) -> bool:
    """Whether a spring or mass that leaves the resonance in the band moves it by less than three standard deviations."""
    tolerance = campaign.machine.tolerance
    stiffness, mass = (float(getattr(tolerance, name)) for name in ("stiffness", "mass"))
    return 0.6 * _room(campaign) < 3 * 0.5 * float(np.hypot(stiffness, mass))


def write(campaign: Campaign, records: Sequence[Record], source: Path, out: Path) -> None:
    """A campaign with other records, as files: its own campaign.toml but for levels and names, CSV records, its machine.toml."""
    (out / "records").mkdir(parents=True)
    given = tomllib.loads((source / "campaign.toml").read_text(encoding="utf-8"))
    lines = ["[campaign]", f'title = "{campaign.title}"', 'machine = "machine.toml"']
    for k, (record, table) in enumerate(zip(records, given["record"], strict=True)):
        file = f"records/r{k}.csv"
        columns, head = _columns(record)
        np.savetxt(out / file, columns, delimiter=",", header=",".join(head), comments="", fmt="%.12g")
        kept = {key: value for key, value in table.items() if key not in ("file", "peak_force", "channels")}
        kept |= {} if record.peak_force is None else {"peak_force": float(f"{record.peak_force:.6g}")}
        lines += ["", "[[record]]", f'file = "{file}"', *(f"{key} = {_toml(value)}" for key, value in kept.items())]
    nominal = source / given["campaign"].get("machine", "machine.toml")
    (out / "machine.toml").write_text(nominal.read_text(encoding="utf-8"), encoding="utf-8")
    (out / "campaign.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _toml(value: Any) -> str:
    """A string, number, truth value or list as TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return f"[{', '.join(_toml(v) for v in value)}]" if isinstance(value, list) else repr(value)


def _columns(record: Record) -> tuple[FloatArray, list[str]]:
    """A record of one channel as columns with headings."""
    channel, unit = record.channels[0], UNITS[record.quantities[0]]
    if record.frf is None:
        (history,) = record.histories
        return np.column_stack([history.time, history.force, history.responses[0]]), [
            "time [s]",
            "force [N]",
            f"{channel} [{unit}]",
        ]
    data = record.frf.data[0, 0, 0]
    columns, head = (
        [record.frf.freq, data.real, data.imag],
        ["freq [Hz]", f"{channel} re [{unit}/N]", f"{channel} im [{unit}/N]"],
    )
    coherence = record.frf.coherence[0, 0, 0]
    if np.isfinite(coherence).all():
        columns.append(coherence)
        head.append(f"{channel} coherence")
    if record.force_amplitude is not None:
        columns.append(record.force_amplitude)
        head.append("force amplitude [N]")
    return np.column_stack(columns), head
