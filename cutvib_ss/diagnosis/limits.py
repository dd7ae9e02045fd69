"""
How much of each cause that was not named the records still allow, on top of the accepted answer.

To first order in the size u of a cause, it changes the weighted residual by u d. Beside what tuning, calibration, drift and
discrepancy could take up, d has the squares D; with the residual r its estimate is (d·r)/D with standard deviation
s = 1/√D (`Scan` gives both). d is the derivative at no cause: nearly all of a change may be taken up by tuning, and at a finite
size the residual would be its curvature.

*Allowed.* With an even prior on u ≥ 0 the posterior is a normal one cut off at zero; the bound b leaves 5 % of it:
Φ((b - û)/s) = 1 - 0.05 Φ(û/s). An added mass has this bound too, though a fit may take mass away: it says how much may have been
added. Of a cause that has either sign alike (a delay) the bounds are the pair û ± 1.96 s.

*Visible.* In half of repetitions at a true size u the cause gains at least χ² = u²/s². Its evidence beside the accepted answer is
exp(u²/2s²) times the Occam factor √(2π) s p(u), p the prior density of its size, and it starts behind by the ratio of the priors.
It is named where the product passes odds of 9: u = s √(2 (ln 9 + ln(ratio of priors) - ln(√(2π) s p(u)))), by iteration, since
p depends on u where the prior is even in the logarithm. Further parameters of a cause, and rivals that do the same, make it larger.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import special

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.hypotheses import candidates
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.posterior import Counts, kind_of
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.result import Limit
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.severity import Run, runs
from cutvib_ss.diagnosis.unknowns import to_unknown
from cutvib_ss.effects.base import Model, Range
from cutvib_ss.errors import CutvibError


def limits(
    nominal: Model, accepted: Fit, records: Records, observed: Observations, counts: Counts
) -> tuple[Limit, ...]:
    """Limits of the linear causes that end in nothing, beside no cause or one linear cause; of other answers there are none."""
    own = accepted.hypothesis.effects
    if kind_of(accepted.hypothesis) not in ("none", "known") or not accepted.hypothesis.linear:
        return ()
    few = records.coarse(SETTINGS.limits_lines, 0.0)
    try:
        scan = Scan(nominal, few, accepted.hypothesis, accepted.x, {}, apart=False)
    except (CutvibError, np.linalg.LinAlgError):
        return ()
    # What the accepted answer leaves beyond noise, and what neighbouring lines share, makes every estimate scatter more.
    heat = max(1.0, accepted.chi2 / accepted.count) * accepted.correlation
    kept = sum(e.data.size for e in few.entries) / sum(e.data.size for e in records.entries)
    behind = _behind(bool(own), counts)
    out: dict[tuple[str, str], Limit] = {}
    for shapes in runs(candidates(nominal, observed.band, observed.channels)):
        effect = shapes[0].effect
        if effect.grows().end not in ("zero", "infinity") or any(
            (e.effect, e.place) == (effect.effect, effect.place) for e in own
        ):
            continue
        found = [_limit(nominal, scan, run, (heat, kept), behind) for run in _spread(shapes)]
        # The weakest statement holds for all of them; variants of a cause are one.
        key = (effect.effect, effect.place)
        weakest = _weakest([out.get(key), *found], effect.grows().end)
        if weakest is not None:
            out[key] = weakest
    return tuple(out.values())


def _spread(shapes: Sequence[Run]) -> list[Run]:
    at = np.unique(np.linspace(0, len(shapes) - 1, SETTINGS.limits_shapes).round().astype(int))
    return [shapes[i] for i in at]


def _behind(beside_one: bool, counts: Counts) -> float:
    """Logarithm of the prior of the accepted answer over that of the answer with one cause more."""
    known = SETTINGS.priors["known"] / max(counts.known, 1)
    return (
        math.log(known / (SETTINGS.priors["sums"] / counts.sums))
        if beside_one
        else math.log(SETTINGS.priors["none"] / known)
    )


def _weakest(found: Sequence[Limit | None], end: str) -> Limit | None:
    there = [x for x in found if x is not None]
    pick = min if end == "infinity" else max
    return pick(there, key=lambda x: np.abs(x.allowed).max()) if there else None


def _limit(nominal: Model, scan: Scan, run: Run, noise: tuple[float, float], behind: float) -> Limit | None:
    """Limit of one shape. None where the model takes none of it, or where it changes nothing that the fit could not take up."""
    heat, kept = noise
    infinite = run.weak_end == "infinity"
    bounds = type(run.effect).ranges(nominal, run.effect.place)[run.head]
    signed = bounds.low == -bounds.high
    severity, measured = 1.0, None
    for _ in range(2):
        measured = _measured(scan, run, severity)
        if measured is None:
            return None
        severity *= math.sqrt(SETTINGS.limits_small / measured[3])
    measured = _measured(scan, run, severity)
    if measured is None:
        return None
    size, along, squares, _ = measured
    estimate, std = size * along / squares, size * math.sqrt(heat / squares)
    # The diagnosis names a cause on all lines, these are some: where noise decides, it sees so much more.
    visible = _visible(std * math.sqrt(kept), behind, bounds, infinite)
    allowed: float | tuple[float, float]
    if signed:
        sign = math.copysign(1.0, float(getattr(run.effect, run.head)))
        allowed = _interval(sign * estimate, std)
    elif infinite:
        allowed, visible = 1.0 / _bound(estimate, std), 1.0 / visible
    else:
        allowed = _bound(estimate, std)
    return Limit(run.effect.effect, run.effect.place, run.head, run.unit(nominal), allowed, visible)


def _measured(scan: Scan, run: Run, severity: float) -> tuple[float, float, float, float] | None:
    """Size of a cause, the product of its change with the residual, and the change's squares, freed and as they were."""
    effect = run.at(severity)
    try:
        _, problem, x = scan.with_cause(effect)
        for i, (index, name, bounds) in enumerate(problem.parameters):
            if index == len(scan.effects):
                # Weaker than its range, where a fit would hold it.
                x[problem.first_effect + i] = to_unknown(float(getattr(effect, name)), bounds)
        along, squares, moved_by = scan.change(problem, x)
    except (CutvibError, np.linalg.LinAlgError):
        return None
    if not (math.isfinite(along) and squares > 0.0):
        return None
    value = abs(float(getattr(effect, run.head)))
    return (1.0 / value if run.weak_end == "infinity" else value), along, squares, moved_by


def _interval(estimate: float, std: float) -> tuple[float, float]:
    """Sizes outside of which 5 % of the posterior lie, half on either side."""
    out = -float(std * special.ndtri(SETTINGS.limits_tail / 2.0))
    return estimate - out, estimate + out


def _bound(estimate: float, std: float) -> float:
    """Size beyond which 5 % of the posterior lie."""
    at = max(estimate / std, SETTINGS.limits_farthest)
    return float(std * (at - special.ndtri(SETTINGS.limits_tail * special.ndtr(at))))


def _visible(std: float, behind: float, bounds: Range, infinite: bool) -> float:
    """Size that half of repetitions name."""
    needed = math.log(SETTINGS.verdict_sure / (1.0 - SETTINGS.verdict_sure)) + behind
    size = std
    for _ in range(SETTINGS.limits_iterations):
        occam = -math.log(math.sqrt(2.0 * math.pi) * std * _density(size, bounds, infinite))
        size = std * math.sqrt(2.0 * max(needed + max(occam, 0.0), 0.5))
    return size


def _density(size: float, bounds: Range, infinite: bool) -> float:
    """Prior density of a size, its range continued to the weak side; that of 1/value is as even in the logarithm as the value's."""
    if bounds.scale == "log":
        return 1.0 / (size * math.log(bounds.high / bounds.low))
    if bounds.scale == "normal":
        return 1.0 / (math.sqrt(2.0 * math.pi) * bounds.high)
    return size**-2 / (bounds.high - bounds.low) if infinite else 1.0 / (bounds.high - bounds.low)
