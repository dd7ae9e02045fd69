"""
How much of each linear cause the records show beside a fit, to first order in its size.

A cause of size u changes the weighted residual by u d. Beside what tuning, calibration, drift and discrepancy could take up, d has
the squares D; with the residual r its estimate is (d·r)/D with standard deviation s = 1/√D (`Scan` gives both). d is the derivative
at no cause: nearly all of a change may be taken up by tuning, and at a finite size the residual would be its curvature.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.hypotheses import Candidate, candidates
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.posterior import kind_of
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Change, Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.severity import Run, runs
from cutvib_ss.diagnosis.unknowns import to_unknown
from cutvib_ss.effects.base import Effect, Model, Range
from cutvib_ss.errors import CutvibError, ParameterError


@dataclass(frozen=True)
class SmallSize:
    """Size of one shape of a cause as some of the lines show it, in units of its leading value, or of that value's reciprocal."""

    run: Run  # The shape
    bounds: Range  # Prior of its leading value
    estimate: float
    std: float  # By these lines
    std_of_all: float  # By all lines

    @property
    def cause(self) -> tuple[str, str]:
        """Effect and place."""
        return self.run.effect.effect, self.run.effect.place

    @property
    def infinite(self) -> bool:
        """Whether it is nothing where its leading value is infinite, so that the size is its reciprocal."""
        return self.run.weak_end == "infinity"

    @property
    def weak(self) -> Effect | None:
        """The cause of one standard deviation, of its estimate's sign where it may have either; None where none is so large."""
        severity = self.std_of_all / self.run.size(1.0)
        for signed in (math.copysign(severity, self.estimate), severity):
            with suppress(ParameterError):
                return self.run.at(signed)
        return None

    @property
    def sign(self) -> float:
        """Sign of its leading value, or of how far a factor is from one, where the size is positive."""
        return math.copysign(1.0, float(getattr(self.run.effect, self.run.head)) - self._nothing)

    @property
    def _nothing(self) -> float:
        return 1.0 if self.run.weak_end == "one" else 0.0

    @property
    def evidence(self) -> float:
        """
        Evidence for the shape beside that for none: the integral of the likelihood over the prior of its size.

        With p̄ the prior density in the mean over the estimate's normal distribution it is √(2π) s p̄ exp(û²/2s²).
        """
        std, z = self.std_of_all, self.estimate / self.std
        bounds = self.bounds
        if self.infinite:
            # Of a logarithm the prior of the reciprocal is as even.
            bounds = replace(bounds, low=1.0 / bounds.high, high=1.0 / bounds.low)
        density = bounds.density(self._nothing + self.sign * z * std, std)
        return math.sqrt(2.0 * math.pi) * std * density * math.exp(min(0.5 * z**2, 700.0))


def small_sizes(
    nominal: Model, accepted: Fit, records: Records, observed: Observations
) -> tuple[tuple[SmallSize, ...], ...]:
    """
    The shapes of each linear cause, by effect, place and what is discrete about it, those that the model takes.

    Beside no cause or one linear cause: of other answers there are none.
    """
    if kind_of(accepted.hypothesis) not in ("none", "known") or not accepted.hypothesis.linear:
        return ()
    moving = bool(accepted.spread.layout.records)
    try:
        scan = scan_beside(nominal, replace(records, moving=moving), accepted)
    except (CutvibError, np.linalg.LinAlgError):
        return ()
    # What the accepted answer leaves beyond noise, and what neighbouring lines share, makes every estimate scatter more.
    heat = max(1.0, accepted.reduced) * accepted.correlation
    own = accepted.hypothesis.causes
    out = []
    for shapes in runs(candidates(nominal, observed.band, observed.channels)):
        effect = shapes[0].effect
        if (effect.effect, effect.place) not in own and not shapes[0].whole:
            sized = [_sized(nominal, scan, run, heat) for run in _spread(shapes)]
            if found := tuple(s for s in sized if s is not None):
                out.append(found)
    return tuple(out)


def scan_beside(nominal: Model, records: Records, accepted: Fit) -> Scan:
    """Linear causes on top of a fit, on some of its lines."""
    few = records.coarse(SETTINGS.limits_lines, 0.0)
    part = sum(e.data.size for e in few.entries) / sum(e.data.size for e in records.entries)
    return Scan(nominal, few, accepted.hypothesis, accepted.x, {}, apart=False, part=part)


def weak(nominal: Model, scan: Scan, start: Effect) -> Effect:
    """
    A cause of one standard deviation, which hardly shows; one that has no such size stays as it is.

    At its estimate the tuning, which makes up for the lack of it, would be far off: a fit starts from here.
    """
    for run in (run for shapes in runs([Candidate("", (start,))]) for run in shapes if not run.whole):
        size = _sized(nominal, scan, run, 1.0)
        if size is not None:
            return size.weak or start
    return start


def _spread(shapes: Sequence[Run]) -> list[Run]:
    at = np.unique(np.linspace(0, len(shapes) - 1, SETTINGS.limits_shapes).round().astype(int))
    return [shapes[i] for i in at]


def _sized(nominal: Model, scan: Scan, run: Run, heat: float) -> SmallSize | None:
    """One shape. None where the model takes none of it, or where it changes nothing that the fit could not take up."""
    severity, change = 1.0, None
    for _ in range(3):
        if change is not None:
            severity *= math.sqrt(SETTINGS.limits_small / change.moved_by)
        change = _changed(scan, run, severity)
        if change is None:
            return None
    assert change is not None
    size, bounds = run.size(severity), type(run.effect).ranges(nominal, run.effect.place)[run.head]
    std, std_of_all = (size * math.sqrt(heat / squares) for squares in (change.squares, change.squares_of_all))
    return SmallSize(run, bounds, size * change.along / change.squares, std, std_of_all)


def _changed(scan: Scan, run: Run, severity: float) -> Change | None:
    """What a shape of some severity changes; None where the model does not take it, or where nothing is left of it."""
    effect = run.at(severity)
    try:
        _, problem, x = scan.with_cause(effect)
        for i, (index, name, bounds) in enumerate(problem.parameters):
            if index == len(scan.effects):
                # Weaker than its range, where a fit would hold it.
                x[problem.first_effect + i] = to_unknown(float(getattr(effect, name)), bounds)
        change = scan.change(problem, x)
    except (CutvibError, np.linalg.LinAlgError):
        return None
    return change if math.isfinite(change.along) and change.squares > 0.0 else None
