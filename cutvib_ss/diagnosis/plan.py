"""
What a campaign that is only planned could tell: which causes it would see, how little of each, and which it would confuse.

Each cause moves the responses by some d(severity). What tuning and calibration could make of it is projected out, priors
counted: with J their derivatives and P their prior precision, the χ² that a fit with the cause would gain over one without is

    g = dᵀW d - dᵀW J (JᵀW J + P)⁻¹ JᵀW d.

A cause is seen when half of that exceeds the evidence that the verdict asks of a cause, or when tuning would have to go beyond its
bounds to hide it; it is named when the residual after the best fit of any other cause is large enough. Changes are taken
where they are small and in proportion to the severity, for tuning follows a resonance however far it moves. Causes that depend
on the level are simulated blow by blow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cutvib_ss.diagnosis.hypotheses import candidates, nonlinear_candidates
from cutvib_ss.diagnosis.information import Seen, Space, left_over
from cutvib_ss.diagnosis.linearity import motions
from cutvib_ss.diagnosis.records import Entry, Records, merged
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.severity import Run, runs
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.measurement.replay import assumed_blow
from cutvib_ss.results import Estimator, FloatArray, MeasuredFrequencyResponse, Quantity
from cutvib_ss.results.arrays import optional_array
from cutvib_ss.results.display import Displayed, Table, data_frame


@dataclass(frozen=True)
class PlannedCampaign:
    """
    Impact tests that are planned.

    Parameters
    ----------
    positions : tuple of float
        y_b / L; empty for a structure.
    levels : tuple of float
        Peak forces [N].
    channels : tuple of str
        Response channels.
    blows : int
        Blows at each position and level.
    band : tuple of float
        Band [Hz].
    block : float
        Length of a record [s].
    noise : float
        Density of the noise on the response channels [their unit/√Hz]: by default that of an accelerometer, 70 µg/√Hz.
    error : float
        Relative error of a response that no noise shows and no parameter explains: mounting, estimator, the model's own
        approximations.
    """

    positions: tuple[float, ...]
    levels: tuple[float, ...] = (50.0,)
    channels: tuple[str, ...] = ("tool_x", "tool_z", "base_x")
    blows: int = 3
    band: tuple[float, float] = (15.0, 450.0)
    block: float = 2.0
    noise: float = 7e-4
    error: float = 0.003


@dataclass(frozen=True)
class PlannedCause:
    """What the campaign would make of one cause."""

    name: str  # Which
    effect: str
    place: str
    parameter: str  # The parameter that tells its severity
    unit: str
    # Value at which it is nothing: ``"zero"``, ``"one"`` or ``"infinity"``; ``"whole"`` for a cause that is there or
    # not
    weak_end: str
    # Its value at the smallest severity that is seen, for the middle of the cause's shapes (one resonance of many);
    # None where none that is believable is
    seen: float | None
    seen_best: float | None  # The same for the shape that shows most and least; None likewise
    seen_worst: float | None
    named: float | None  # Its value at the smallest severity at which it is told from every other cause
    rival: str  # The cause with which it is confused longest
    told_apart: float  # Severity at which it is told from that one over the severity at which it is seen


_COLUMNS = ("effect", "place", "parameter", "unit", "seen", "seen_best", "seen_worst", "named", "rival", "told_apart")
"""What a plan's table of pandas has of each cause."""


@dataclass(frozen=True, repr=False)
class Plan(Displayed):
    """
    What a planned campaign could tell.

    Parameters
    ----------
    campaign : PlannedCampaign
        The plan.
    causes : tuple of PlannedCause
        By cause.
    pairs : tuple of (str, str, float)
        Two causes, and the severity of the first at which it is told from the second, over that at which it is seen; those that are
        told apart at once are left out.
    threshold : float
        Log evidence that a cause has to bring.
    """

    campaign: PlannedCampaign
    causes: tuple[PlannedCause, ...]
    pairs: tuple[tuple[str, str, float], ...]
    threshold: float

    def to_dataframe(self) -> Any:
        """
        The causes as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each cause: effect, place, the parameter that tells its severity and its SI unit; the parameter's values
            from which the cause is seen (middle, best and worst of its shapes) and named, NaN where none is; the cause with which
            it is confused longest, and the ratio of the severities at which the two are told apart and at which it is seen.
        """
        values: dict[str, Any] = {name: [getattr(c, name) for c in self.causes] for name in _COLUMNS}
        values |= {name: optional_array(values[name]) for name in ("seen", "seen_best", "seen_worst", "named")}
        return data_frame(values, "cause", [c.name for c in self.causes])

    def _table(self) -> Table:
        rows = []
        for c in self.causes:
            seen, named = ("-" if v is None else f"{v:.4g} {c.unit}".rstrip() for v in (c.seen, c.named))
            rows.append((c.name, c.parameter, seen, named, c.rival))
        return Table(
            f"Plan: {len(rows)} causes", ("cause", "parameter", "seen from", "named from", "confused with"), rows
        )


def plan(model: Model, campaign: PlannedCampaign, *, laws: bool = True) -> Plan:
    """
    Which causes a planned campaign could see and tell apart, before any test.

    Parameters
    ----------
    model : Machine or Structure
        The nominal model.
    campaign : PlannedCampaign
        The plan.
    laws : bool
        Whether causes that depend on the level are asked about too; they are simulated, which takes longer.

    Returns
    -------
    Plan
        Smallest severities that are seen and named, and what is confused with what.

    Raises
    ------
    ParameterError
        If the plan is impossible.
    """
    _check(model, campaign)
    entries = _entries(model, campaign)
    (group,) = merged(entries, apart=True)
    space = Space(model, group, campaign.error)
    shapes = list(runs(candidates(model, campaign.band, campaign.channels)))
    if laws and model.input_quantity == "force":
        moved = motions(model, Records(tuple(entries)))
        shapes += runs(nonlinear_candidates(model, moved))
    # Log evidence at which a known cause, with its share of the prior, outweighs no cause by these odds.
    threshold = float(np.log(SETTINGS.plan_odds * len(shapes) * SETTINGS.priors["none"] / SETTINGS.priors["known"]))
    seen = [[s for run in own if (s := space.seen(run, threshold)) is not None] for own in shapes]
    found = [(own[0].name, own) for own in shapes]
    atoms = [s.atom for own in seen for s in own]
    owner = np.array([i for i, own in enumerate(seen) for _ in own])
    gram = space.gram(atoms) if atoms else np.zeros((0, 0))
    told = float(np.log(SETTINGS.plan_odds))
    causes, pairs = [], []
    for i, (name, own) in enumerate(found):
        middle = _middle(seen[i])
        rivals = []
        for j, (other, theirs) in enumerate(found):
            same = (own[0].effect.effect, own[0].effect.place) == (theirs[0].effect.effect, theirs[0].effect.place)
            if same or middle is None or not seen[j]:
                continue
            mine = int(np.flatnonzero(owner == i)[seen[i].index(middle)])
            left = left_over(gram, mine, np.flatnonzero(owner == j).tolist(), theirs[0].parameters) / gram[mine, mine]
            factor = max(1.0, float(np.sqrt(told / max(left * middle.gain / 2, 1e-12))))
            if factor > 1.0:
                rivals.append((factor, other))
                pairs.append((name, other, factor))
        causes.append(_cause(model, own[0], seen[i], middle, max(rivals, default=(1.0, ""))))
    return Plan(campaign, tuple(causes), tuple(sorted(pairs, key=lambda p: -p[2])), threshold)


def _middle(seen: Sequence[Seen]) -> Seen | None:
    """The shape of median size."""
    return sorted(seen, key=lambda s: s.size)[len(seen) // 2] if seen else None


def _cause(model: Model, run: Run, seen: Sequence[Seen], middle: Seen | None, rival: tuple[float, str]) -> PlannedCause:
    factor, other = rival
    ordered = sorted(seen, key=lambda s: s.size)
    named = None
    if middle is not None and not run.whole and middle.run.believable(middle.severity * factor):
        named = float(getattr(middle.run.at(middle.severity * factor), run.head))
    elif middle is not None and run.whole and factor == 1.0:
        named = middle.value
    return PlannedCause(
        name=run.name,
        effect=run.effect.effect,
        place=run.effect.place,
        parameter=run.head,
        unit=run.unit(model),
        weak_end=run.weak_end,
        seen=None if middle is None else middle.value,
        seen_best=ordered[0].value if ordered else None,
        seen_worst=ordered[-1].value if ordered else None,
        named=named,
        rival=other,
        told_apart=factor,
    )


def _check(model: Model, c: PlannedCampaign) -> None:
    if model.has_position and not c.positions:
        raise ParameterError("a plan needs positions of the head, y_b / L")
    if not model.has_position and c.positions:
        raise ParameterError(f"position {c.positions[0]:g}: this model has no position")
    unknown = [n for n in c.channels if n not in model.channels]
    if unknown or not c.channels:
        raise ParameterError(f"no channel {', '.join(unknown) or 'given'}; there are {', '.join(model.channels)}")
    if not c.levels or min(c.levels) <= 0.0 or c.blows < 1 or c.noise <= 0.0 or c.block <= 0.0 or c.error < 0.0:
        raise ParameterError("levels, blows, block and noise of a plan must be above zero, its error not below")
    if not 0.0 < c.band[0] < c.band[1] or (c.band[1] - c.band[0]) * c.block < 16:
        raise ParameterError(f"band {c.band[0]:g} to {c.band[1]:g} Hz holds too few lines of 1/{c.block:g} Hz")


def _entries(model: Model, c: PlannedCampaign) -> list[Entry]:
    first, last = int(np.ceil(c.band[0] * c.block)), int(np.floor(c.band[1] * c.block))
    stride = max(1, (last - first) // SETTINGS.plan_lines)
    freq = np.arange(first, last + 1, stride) / c.block
    quantities: tuple[Quantity, ...] = tuple(model.channels[n].quantity for n in c.channels)
    nothing = np.zeros((1, len(c.channels), 1, freq.size), dtype=np.complex128)
    estimator = Estimator("H1", c.block, SETTINGS.plan_blow_at)
    out: list[Entry] = []
    for position in c.positions or (None,):
        for level in c.levels:
            replay = (
                assumed_blow(freq, c.block, SETTINGS.plan_blow_at, level) if model.input_quantity == "force" else None
            )
            # Noise of the block's transform over that of the blow; one line stands for `stride`.
            blow = level * np.abs(_blow(freq, float(freq[-1])))
            variance = c.noise**2 * c.block / 2 / blow**2 / (c.blows * stride)
            response = MeasuredFrequencyResponse(
                nothing, freq, optional_array([position]), c.channels, (FORCE,), quantities,
                variance=variance + np.zeros(nothing.shape), averages=c.blows, estimator=estimator,
            )  # fmt: skip
            out.append(Entry(len(out), response, level, replay=replay))
    return out


def _blow(freq: FloatArray, top: float) -> FloatArray:
    """Transform of a half sine of unit peak whose length is one period of the band's upper end."""
    x = 2.0 * freq / top
    near = np.abs(1.0 - x**2) < 1e-6
    shape = np.where(near, np.pi / 4, np.cos(np.pi * x / 2) / np.where(near, 1.0, 1.0 - x**2))
    return np.asarray(2.0 / (np.pi * top) * shape, dtype=np.float64)
