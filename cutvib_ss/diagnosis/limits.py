"""
How much of each cause that was not named the records still allow, on top of the accepted answer.

Estimates û and standard deviations s of the size of each are `small_sizes`.

*Allowed.* With an even prior on u ≥ 0 the posterior is a normal one cut off at zero; the bound b leaves 5 % of it:
Φ((b - û)/s) = 1 - 0.05 Φ(û/s). An added mass has this bound too, though a fit may take mass away: it says how much may have been
added. Of a cause that has either sign alike (a delay) the bounds are the pair û ± 1.96 s, and of a factor (a shifted value, a gain)
the exponential of that.

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
from cutvib_ss.diagnosis.posterior import Counts
from cutvib_ss.diagnosis.result import Limit
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.small_sizes import SmallSize
from cutvib_ss.effects.base import Model, Range
from cutvib_ss.effects.prior import density_on_either_side


def limits(nominal: Model, accepted: Fit, sizes: Sequence[Sequence[SmallSize]], counts: Counts) -> tuple[Limit, ...]:
    """Limits of the linear causes whose sizes beside the accepted answer are known."""
    behind = _behind(bool(accepted.hypothesis.effects), counts)
    out: dict[tuple[str, ...], Limit] = {}
    for shapes in sizes:
        run = shapes[0].run
        # The weakest statement holds for all of them; variants of a cause are one, unless the size of each has a name.
        key = (*shapes[0].cause, run.effect.size_name)
        before = [out[key]] if key in out else []
        out[key] = _weakest([*before, *(_limit(nominal, s, behind) for s in shapes)], run.weak_end)
    return tuple(out.values())


def _behind(beside_one: bool, counts: Counts) -> float:
    """Logarithm of the prior of the accepted answer over that of the answer with one cause more."""
    known = SETTINGS.priors["known"] / max(counts.known, 1)
    return (
        math.log(known / (SETTINGS.priors["sums"] / counts.sums))
        if beside_one
        else math.log(SETTINGS.priors["none"] / known)
    )


def _weakest(found: Sequence[Limit], end: str) -> Limit:
    if end == "one":
        return max(found, key=lambda x: np.abs(np.log(x.allowed)).max())
    pick = min if end == "infinity" else max
    return pick(found, key=lambda x: np.abs(x.allowed).max())


def _limit(nominal: Model, size: SmallSize, behind: float) -> Limit:
    """Limit of one shape."""
    run, bounds, estimate, std = size.run, size.bounds, size.estimate, size.std
    # The diagnosis names a cause on all lines.
    visible = _visible(size.std_of_all, behind, bounds, size.infinite)
    allowed: float | tuple[float, float]
    if run.weak_end == "one":
        # To first order a factor's distance from one is its logarithm, of which no bound is negative.
        low, high = (_factor(x, bounds) for x in _interval(size.sign * estimate, std))
        allowed, visible = (low, high), _factor(visible, bounds)
    elif bounds.low == -bounds.high:
        allowed = _interval(size.sign * estimate, std)
    elif size.infinite:
        allowed, visible = 1.0 / _bound(estimate, std), 1.0 / visible
    else:
        allowed = _bound(estimate, std)
    return Limit(*size.cause, run.effect.size_name, run.unit(nominal), allowed, visible)


def _factor(logarithm: float, bounds: Range) -> float:
    """A factor, no further from one than is believed."""
    return math.exp(min(max(logarithm, math.log(bounds.low)), math.log(bounds.high)))


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
    if bounds.scale == "asinh":
        return density_on_either_side(bounds.low, bounds.high, size)
    if bounds.scale == "ratio":
        return density_on_either_side(math.log(bounds.low), math.log(bounds.high), size)
    if bounds.scale == "normal":
        return 1.0 / (math.sqrt(2.0 * math.pi) * bounds.high)
    return size**-2 / (bounds.high - bounds.low) if infinite else 1.0 / (bounds.high - bounds.low)
