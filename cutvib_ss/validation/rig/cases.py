"""Cases of the trial: a machine, what is wrong with it, and how it is measured; all drawn from a seed."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from threadpoolctl import threadpool_limits

from cutvib_ss.validation.rig import files
from cutvib_ss.validation.rig.blows import BLOCK, FS
from cutvib_ss.validation.rig.campaign import Campaign, conditions_label, force_power, quiet_response
from cutvib_ss.validation.rig.causes import FORMS, FRAME_CAUSES, LOSING, SPRUNG, STORING, drawn_form
from cutvib_ss.validation.rig.conditions import (
    Conditions,
    Nominal,
    changed,
    draw_conditions,
    draw_nominal,
    frame_conditions,
    roughened,
)
from cutvib_ss.validation.rig.frames import Frame, FrameNominal, draw_frame
from cutvib_ss.validation.rig.outside import OUTSIDE
from cutvib_ss.validation.rig.repeatability import draw_repeatability
from cutvib_ss.validation.rig.sites import AnyMachine, Form, Parameters
from cutvib_ss.validation.rig.structure import TOLERANCE, Machinery, Rig, scattered

Kind: TypeAlias = Literal["none", "single", "pair", "outside"]

CAUSES = (*FORMS, "modal_truncation")
"""The catalogue's effects."""

OUTSIDE_KINDS = tuple(OUTSIDE)
"""Kinds outside the catalogue."""

TRAITS = ("drifting", "varied", "rough", "structure")
"""What a case may have beside its cause: values that move between sessions, a cause of another form than the catalogue's, real
instruments, and a structure that is no cutting machine."""

BAND = np.arange(15.0, 450.5, 0.5)
"""Lines over which gaps are measured [Hz]."""

_SCATTER_DRAWS = 3
_TRAITS = 21
_DAYS = 22
_SAMPLES = round(BLOCK * FS)


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong."""

    effect: str  # Effect id, or outside kind
    place: str  # Where
    parameters: Parameters  # Its parameters, by the contract's names
    rig: AnyMachine  # The machine that has this fault alone
    form: str = ""  # Its physical form
    grade: int = 0  # How far that is from the catalogue's, see `sites.Form`
    same: tuple[str, ...] = ()  # Other places that are physically the same


@dataclass(frozen=True)
class Case:
    """
    A case: a machine, what is wrong with it, and how it is measured.

    Parameters
    ----------
    seed : int
        What it was drawn from.
    kind : {"none", "single", "pair", "outside"}
        Its kind.
    severity : float, optional
        Severity of its faults; None where there are none.
    nominal : Nominal or FrameNominal
        What machine.toml says.
    plain : Rig or Frame
        The machine as built, without its faults.
    rig : Rig or Frame
        The machine with them.
    faults : tuple of Fault
        The faults as drawn.
    conditions : Conditions
        How it is measured.

    Notes
    -----
    `label` and `write_campaign` compute what they need, once; both use the same blows.
    """

    seed: int
    kind: Kind
    severity: float | None
    nominal: Nominal | FrameNominal
    plain: AnyMachine
    rig: AnyMachine
    faults: tuple[Fault, ...]
    conditions: Conditions

    @cached_property
    def campaign(self) -> Campaign:
        """Every blow on the machine with its faults."""
        return Campaign(self.rig, self.conditions, self.seed)

    @cached_property
    def ordered(self) -> tuple[Fault, ...]:
        """The faults, that with the larger share of the gap first."""
        if len(self.faults) < 2:
            return self.faults
        with threadpool_limits(1):
            alone = {f.effect: Campaign(f.rig, self.conditions, self.seed) for f in self.faults}
            size = {effect: _distance(self._without, campaign, 2) for effect, campaign in alone.items()}
        return tuple(sorted(self.faults, key=lambda f: -size[f.effect]))

    @cached_property
    def _without(self) -> Campaign:
        return Campaign(self.plain, self.conditions, self.seed)

    @cached_property
    def gap_sigma(self) -> float:
        """What the faults change, over what scatter, calibration and noise change (root mean squares in 15-450 Hz)."""
        if not self.faults:
            return 0.0
        with threadpool_limits(1):
            return self._gap_sigma()

    def _gap_sigma(self) -> float:
        if self.faults[0].effect == "modal_truncation" and isinstance(self.plain, Rig):
            rail = replace(self.plain.rail, truncation=self.nominal.n_modes)
            model = Campaign(replace(self.plain, rail=rail), self.conditions, self.seed)
            return _distance(model, self.campaign) / _spread(self.campaign)
        return _distance(self._without, self.campaign) / _spread(self._without)

    @cached_property
    def label(self) -> dict[str, Any]:
        """The truth, as JSON."""
        faults = self.ordered
        several = len(faults) > 1
        outside = "outside:" if self.kind == "outside" else ""
        return {
            "effect": "+".join(outside + f.effect for f in faults) or "none",
            "place": "+".join(f.place for f in faults) or "none",
            "parameters": {f.effect: dict(f.parameters) for f in faults}
            if several
            else dict(faults[0].parameters)
            if faults
            else {},
            "severity": self.severity,
            "kind": self.kind,
            "machine": "cutting_machine" if isinstance(self.plain, Rig) else self.plain.kind,
            "form": "+".join(f.form for f in faults) or None,
            "grade": max((f.grade for f in faults), default=0),
            "equivalent_places": sorted({place for f in faults for place in f.same}),
            "gap_sigma": self.gap_sigma,
            "unstable_blows": self.campaign.unstable_blows,
            "conditions": dict(conditions_label(self.campaign)) | {"n_modes": self.nominal.n_modes},
        }


def draw_case(
    seed: int,
    kind: Kind,
    cause: str | None = None,
    severity: tuple[float, float] = (0.3, 2.0),
    conditions: Mapping[str, Any] | None = None,
    traits: Collection[str] = (),
    form: str | None = None,
) -> Case:
    """
    Draw a case.

    Parameters
    ----------
    seed : int
        Everything follows from it.
    kind : {"none", "single", "pair", "outside"}
        Nothing wrong, one cause of the catalogue, two, or one that is not in it.
    cause : str, optional
        Effect id (two joined by ``+`` for a pair) or outside kind, instead of drawing it.
    severity : (float, float)
        Range of severities, drawn evenly in their logarithm; 1 is a clear fault.
    conditions : mapping, optional
        Fields of `Conditions` to fix instead of drawing them.
    traits : collection of str
        What else the case shall have, of `TRAITS`. A structure is drawn only where it can have the cause.
    form : str, optional
        Form of a single cause, instead of drawing it.

    Returns
    -------
    Case
        The case.

    Raises
    ------
    ValueError
        If the cause, a trait or the form is not known.
    """
    if unknown := set(traits) - set(TRAITS):
        raise ValueError(f"{', '.join(sorted(unknown))}: no trait of a case; there are {', '.join(TRAITS)}")
    rng = np.random.default_rng(seed)
    own = np.random.default_rng([seed, _TRAITS])
    names = _names(kind, cause, rng, "structure" in traits)
    known = OUTSIDE_KINDS if kind == "outside" else CAUSES
    for name in names:
        if name not in known:
            raise ValueError(f"{name!r} is no {kind} cause; there are {', '.join(OUTSIDE_KINDS)}; {', '.join(CAUSES)}")
    nominal: Nominal | FrameNominal
    plain: AnyMachine
    if "structure" in traits and all(_on_frames(name) for name in names):
        nominal = FrameNominal(draw_frame(own, any(name in SPRUNG for name in names)))
        plain = nominal.frame.scattered(rng)
        drawn = frame_conditions(plain, rng)
    else:
        nominal = draw_nominal(rng)
        plain = scattered(Rig(nominal.head, nominal.rail), rng)
        drawn = draw_conditions(rng)
    if "drifting" in traits:
        drawn = replace(drawn, repeatability=draw_repeatability(own, stated=bool(own.random() < 0.5)))
        days = np.random.default_rng([seed, _DAYS])
        if isinstance(plain, Rig) and drawn.repeatability.stated is None and days.random() < 0.5:
            # What is stated is the drift between sessions, and these are other ones.
            drawn = replace(drawn, repeatability=replace(drawn.repeatability, days=int(days.integers(1, 3))))
    if "rough" in traits:
        drawn = roughened(drawn, own)
    drawn = changed(drawn, dict(conditions or {}) if isinstance(plain, Rig) else _for_frames(conditions))
    size = float(np.exp(rng.uniform(*np.log(severity))))
    while True:
        rig, faults, new_nominal = _with_faults(plain, nominal, names, size, rng, "varied" in traits, form)
        if _stand_together(faults) and not (rig.fittings.laws and rig.fittings.lossy):
            break
        if cause is None:
            names = _names(kind, cause, rng, not isinstance(plain, Rig), _has_springs(plain))
    every = tuple(c.name for c in rig.channels)
    if any(_channel_of(fault) not in (*drawn.channels, "all") for fault in faults):
        drawn = replace(drawn, channels=every)
    return Case(seed, kind, size if faults else None, new_nominal, plain, rig, faults, drawn)


def _for_frames(conditions: Mapping[str, Any] | None) -> dict[str, Any]:
    """What of the conditions a structure has: no positions, and channels of its own."""
    return {name: value for name, value in (conditions or {}).items() if name not in ("positions", "channels")}


def _on_frames(name: str) -> bool:
    """Whether a structure that is no cutting machine can have a cause."""
    return name in FRAME_CAUSES or (name in OUTSIDE and OUTSIDE[name].frames)


def write_campaign(case: Case, folder: Path) -> None:
    """
    Write a case's campaign: campaign.toml, machine.toml, records/.

    Parameters
    ----------
    case : Case
        The case.
    folder : Path
        Where to; made if absent. campaign.toml is written last.
    """
    # one thread of linear algebra: its matrices are small, and the same case gives the same bytes anywhere
    with threadpool_limits(1):
        files.write(case.campaign, case.nominal, folder)


def _stand_together(faults: Sequence[Fault]) -> bool:
    """Whether faults are several: at places of their own, or forces at one of which one stores energy and one loses it."""
    kinds = {"stores" if f.effect in STORING else "loses" if f.effect in LOSING else f.effect for f in faults}
    return len({f.place for f in faults}) == len(faults) or kinds == {"stores", "loses"}


def _has_springs(machine: AnyMachine) -> bool:
    """Whether causes that sit at a spring have a place on it."""
    return not isinstance(machine, Frame) or bool(machine.springs)


def _names(
    kind: Kind, cause: str | None, rng: np.random.Generator, structure: bool, springs: bool = True
) -> tuple[str, ...]:
    if kind == "none":
        return ()
    if cause is not None:
        return tuple(cause.split("+"))
    if kind == "outside":
        return (str(rng.choice([name for name in OUTSIDE_KINDS if not structure or OUTSIDE[name].frames])),)
    causes = [name for name in (FRAME_CAUSES if structure else CAUSES) if springs or name not in SPRUNG]
    if kind == "single":
        return (str(rng.choice(causes)),)
    # hysteresis has no exact motion in time beside a nonlinear element; a truncated model is no fault of the machine
    able = [name for name in causes if name not in ("structural_damping", "modal_truncation")]
    return tuple(str(name) for name in rng.choice(able, 2, replace=False))


def _with_faults(
    plain: AnyMachine,
    nominal: Nominal | FrameNominal,
    names: Sequence[str],
    size: float,
    rng: np.random.Generator,
    varied: bool,
    form: str | None,
) -> tuple[AnyMachine, tuple[Fault, ...], Nominal | FrameNominal]:
    rig, faults = plain, []
    for name in names:
        if name == "modal_truncation" and isinstance(nominal, Nominal):
            n_modes = max(1, round(2.2 - 1.2 * np.log(size)))
            faults.append(Fault(name, "rail", {"n_modes": nominal.n_modes}, plain, "truncated"))
            nominal = replace(nominal, n_modes=n_modes)
            continue
        if name in OUTSIDE:
            one, same = Form(name, 3, OUTSIDE[name].make), OUTSIDE[name].same
        else:
            one, same = drawn_form(name, varied, rng), ()
            if form is not None:
                one = next((f for f in FORMS[name] if f.name == form), one)
        state = rng.bit_generator.state
        rig, place, parameters = one.make(rig, size, rng)
        rng.bit_generator.state = state
        alone, _, _ = one.make(plain, size, rng)
        faults.append(Fault(name, place, parameters, alone, one.name, one.grade, same))
    return rig, tuple(faults), nominal


def _channel_of(fault: Fault) -> str:
    """The channel without which a fault of the measurement would not show."""
    return "tool_z" if fault.effect == "cross_axis" else str(fault.parameters.get("channel", "all"))


def _picked(campaign: Campaign) -> list[int]:
    return [campaign.names.index(name) for name in campaign.conditions.channels]


def _distance(without: Campaign, with_faults: Campaign, positions: int | None = None) -> float:
    records = _some(with_faults, positions)
    rows = _picked(with_faults)
    change = [quiet_response(with_faults, i, BAND)[rows] - quiet_response(without, i, BAND)[rows] for i in records]
    return float(np.sqrt(np.mean(np.abs(np.array(change) / _weights(without)) ** 2)))


def _as_built(machine: Machinery, rng: np.random.Generator) -> Machinery:
    """Another machine of the same values, scattered within their tolerances."""
    if isinstance(machine, Frame):
        return machine.scattered(rng)
    if isinstance(machine, Rig):
        return scattered(machine, rng)
    raise TypeError(f"{type(machine).__name__}: has no tolerances")


def _weights(campaign: Campaign) -> Any:
    """What each channel is measured by: 1 for accelerations; for a structure's channels, of any unit, their noise."""
    if isinstance(campaign.rig, Rig):
        return 1.0
    return np.array(campaign.conditions.noise)[_picked(campaign)][:, None]


def _some(campaign: Campaign, positions: int | None) -> list[int]:
    """Records at so many positions (all by default), at every level."""
    levels, count = len(campaign.conditions.levels), len(campaign.conditions.positions)
    chosen = range(count) if positions is None else np.linspace(0, count - 1, positions).round().astype(int)
    return [int(p) * levels + k for p in chosen for k in range(levels)]


def _spread(campaign: Campaign) -> float:
    """Root mean square of what scatter of the values, calibration and noise do to the responses."""
    rng = np.random.default_rng([campaign.seed, 1])
    c, rows = campaign.conditions, _picked(campaign)
    levels, weights = len(c.levels), _weights(campaign)
    first = [p * levels for p in range(len(c.positions))]
    plain = {i: quiet_response(campaign, i, BAND)[rows] for i in first}
    scatter = []
    for _ in range(_SCATTER_DRAWS):
        built = _as_built(campaign.rig, rng)
        other = Campaign(built, c, campaign.seed)
        scatter += [np.abs((quiet_response(other, i, BAND)[rows] - plain[i]) / weights) ** 2 for i in first]
    noise = [
        np.outer(np.square(c.noise)[rows], 1 / force_power(campaign, i, BAND)) * _SAMPLES / c.blows / weights**2
        for i in range(len(campaign.records))
    ]
    calibration = TOLERANCE["calibration"] ** 2 * np.mean([np.abs(h / weights) ** 2 for h in plain.values()])
    return float(np.sqrt(np.mean(scatter) + calibration + np.mean(noise)))
