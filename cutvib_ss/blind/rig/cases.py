"""Cases of the trial: a machine, what is wrong with it, and how it is measured; all drawn from a seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from threadpoolctl import threadpool_limits

from cutvib_ss.blind.rig import files
from cutvib_ss.blind.rig.blows import BLOCK, FS
from cutvib_ss.blind.rig.campaign import Campaign, conditions_label, force_power, quiet_response
from cutvib_ss.blind.rig.causes import MEASUREMENT, MECHANICAL, Parameters
from cutvib_ss.blind.rig.conditions import Conditions, Nominal, changed, draw_conditions, draw_nominal
from cutvib_ss.blind.rig.motion import CHANNELS
from cutvib_ss.blind.rig.outside import OUTSIDE
from cutvib_ss.blind.rig.repeatability import draw_repeatability
from cutvib_ss.blind.rig.structure import TOLERANCE, Rig, scattered

Kind: TypeAlias = Literal["none", "single", "pair", "outside"]

CAUSES = (*MECHANICAL, "modal_truncation", *MEASUREMENT)
"""The catalogue's effects."""

OUTSIDE_KINDS = tuple(OUTSIDE)
"""Kinds outside the catalogue."""

BAND = np.arange(15.0, 450.5, 0.5)
"""Lines over which gaps are measured [Hz]."""

_SCATTER_DRAWS = 3
_REPEATABILITY = 21
_SAMPLES = round(BLOCK * FS)


@dataclass(frozen=True)
class Fault:
    """
    One thing that is wrong.

    Parameters
    ----------
    effect : str
        Effect id, or outside kind.
    place : str
        Where.
    parameters : mapping of str to float or str
        Its parameters, by the contract's names.
    rig : Rig
        The machine that has this fault alone.
    """

    effect: str
    place: str
    parameters: Parameters
    rig: Rig


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
    nominal : Nominal
        What machine.toml says.
    plain : Rig
        The machine as built, without its faults.
    rig : Rig
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
    nominal: Nominal
    plain: Rig
    rig: Rig
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
        if self.faults[0].effect == "modal_truncation":
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
            "gap_sigma": self.gap_sigma,
            "conditions": dict(conditions_label(self.campaign)) | {"n_modes": self.nominal.n_modes},
        }


def draw_case(
    seed: int,
    kind: Kind,
    cause: str | None = None,
    severity: tuple[float, float] = (0.3, 2.0),
    conditions: Mapping[str, Any] | None = None,
    drift: tuple[float, float] | None = None,
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
    drift : (float, float), optional
        Range of how far the machine moves between sessions (relative, of stiffnesses and gains); every other seed states it in
        machine.toml. None: it repeats.

    Returns
    -------
    Case
        The case.

    Raises
    ------
    ValueError
        If the cause is not known.
    """
    rng = np.random.default_rng(seed)
    nominal = draw_nominal(rng)
    plain = scattered(Rig(nominal.head, nominal.rail), rng)
    drawn = changed(draw_conditions(rng), dict(conditions or {}))
    if drift is not None:
        own = np.random.default_rng([seed, _REPEATABILITY])
        drawn = replace(drawn, repeatability=draw_repeatability(own, *drift, stated=bool(own.random() < 0.5)))
    size = float(np.exp(rng.uniform(*np.log(severity))))
    names = _names(kind, cause, rng)
    unknown = [name for name in names if name not in (OUTSIDE_KINDS if kind == "outside" else CAUSES)]
    if unknown:
        raise ValueError(
            f"{unknown[0]!r} is no {kind} cause; there are {', '.join(OUTSIDE_KINDS)}; {', '.join(CAUSES)}"
        )
    while True:
        rig, faults, new_nominal = _with_faults(plain, nominal, names, size, rng)
        places = [f.place for f in faults]
        if len(set(places)) == len(places):
            break
        if cause is None:
            names = _names(kind, cause, rng)
    if any(_channel_of(fault) not in (*drawn.channels, "all") for fault in faults):
        drawn = replace(drawn, channels=CHANNELS)
    return Case(seed, kind, size if faults else None, new_nominal, plain, rig, faults, drawn)


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


_MAKERS = {**MECHANICAL, **MEASUREMENT, **OUTSIDE}


def _names(kind: Kind, cause: str | None, rng: np.random.Generator) -> tuple[str, ...]:
    if kind == "none":
        return ()
    if cause is not None:
        return tuple(cause.split("+"))
    if kind == "outside":
        return (str(rng.choice(OUTSIDE_KINDS)),)
    if kind == "single":
        return (str(rng.choice(CAUSES)),)
    # hysteresis has no exact motion in time beside a nonlinear element; a truncated model is no fault of the machine
    able = [name for name in CAUSES if name not in ("structural_damping", "modal_truncation")]
    return tuple(str(name) for name in rng.choice(able, 2, replace=False))


def _with_faults(
    plain: Rig, nominal: Nominal, names: Sequence[str], size: float, rng: np.random.Generator
) -> tuple[Rig, tuple[Fault, ...], Nominal]:
    rig, faults = plain, []
    for name in names:
        if name == "modal_truncation":
            n_modes = max(1, round(2.2 - 1.2 * np.log(size)))
            faults.append(Fault(name, "rail", {"n_modes": nominal.n_modes}, plain))
            nominal = replace(nominal, n_modes=n_modes)
            continue
        maker = _MAKERS[name]
        state = rng.bit_generator.state
        rig, place, parameters = maker(rig, size, rng)
        rng.bit_generator.state = state
        alone, _, _ = maker(plain, size, rng)
        faults.append(Fault(name, place, parameters, alone))
    return rig, tuple(faults), nominal


def _channel_of(fault: Fault) -> str:
    """The channel without which a fault of the measurement would not show."""
    return "tool_z" if fault.effect == "cross_axis" else str(fault.parameters.get("channel", "all"))


def _picked(campaign: Campaign) -> list[int]:
    return [CHANNELS.index(name) for name in campaign.conditions.channels]


def _distance(without: Campaign, with_faults: Campaign, positions: int | None = None) -> float:
    records = _some(with_faults, positions)
    rows = _picked(with_faults)
    change = [quiet_response(with_faults, i, BAND)[rows] - quiet_response(without, i, BAND)[rows] for i in records]
    return float(np.sqrt(np.mean(np.abs(change) ** 2)))


def _some(campaign: Campaign, positions: int | None) -> list[int]:
    """Records at so many positions (all by default), at every level."""
    levels, count = len(campaign.conditions.levels), len(campaign.conditions.positions)
    chosen = range(count) if positions is None else np.linspace(0, count - 1, positions).round().astype(int)
    return [int(p) * levels + k for p in chosen for k in range(levels)]


def _spread(campaign: Campaign) -> float:
    """Root mean square of what scatter of the values, calibration and noise do to the responses."""
    rng = np.random.default_rng([campaign.seed, 1])
    c, rows = campaign.conditions, _picked(campaign)
    levels = len(c.levels)
    first = [p * levels for p in range(len(c.positions))]
    plain = {i: quiet_response(campaign, i, BAND)[rows] for i in first}
    scatter = []
    for _ in range(_SCATTER_DRAWS):
        other = Campaign(scattered(campaign.rig, rng), c, campaign.seed)
        scatter += [np.abs(quiet_response(other, i, BAND)[rows] - plain[i]) ** 2 for i in first]
    noise = [
        np.outer(np.square(c.noise)[rows], 1 / force_power(campaign, i, BAND)) * _SAMPLES / c.blows
        for i in range(len(campaign.records))
    ]
    calibration = TOLERANCE["calibration"] ** 2 * np.mean([np.abs(h) ** 2 for h in plain.values()])
    return float(np.sqrt(np.mean(scatter) + calibration + np.mean(noise)))
