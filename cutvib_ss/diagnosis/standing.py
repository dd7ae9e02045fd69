"""How the hypotheses of a search stand to each other: what leads, what is enough, what is lacking."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.settings import SETTINGS


def lacks_a_form(ranked: Sequence[Ranked]) -> bool:
    """Whether something unknown leads all known causes."""
    refined = [r for r in ranked if r.refined]
    best = max(refined, key=lambda r: r.fit.log_evidence, default=None)
    if best is None or best.fit.hypothesis.effect != "unknown":
        return False
    known = max((r.fit.log_evidence for r in refined if r.fit.hypothesis.effect != "unknown"), default=-np.inf)
    return best.fit.log_evidence - known > SETTINGS.search_caught


def of_one_place(ranked: Sequence[Ranked], leaves: Callable[[Ranked], float]) -> bool:
    """Whether something unknown at one place, with a known cause there or alone, leaves noise, and of held-out records too."""
    causes = [(r, r.fit.hypothesis.causes) for r in ranked if r.refined]
    there = [r for r, own in causes if "unknown" in dict(own) and len({place for _, place in own}) == 1]
    best = max(there, key=lambda r: r.fit.log_evidence, default=None)
    if best is None or best.fit.tuned_away or best.fit.calibrated_away:
        # What tuning far out of its tolerance makes up for is somewhere else.
        return False
    return best.reduced < SETTINGS.search_enough and leaves(best) < SETTINGS.search_enough


def shows_gap(ranked: Sequence[Ranked], none: Ranked) -> bool:
    """Whether the re-tuned model leaves more than noise and drift, or some cause does better."""
    best = best_of(ranked, none)
    # Where what the best leaves is alike over many data, so is what it leads by: the posterior divides by that.
    lead = (best.fit.log_evidence - none.fit.log_evidence) / best.fit.correlation
    return none.reduced > SETTINGS.search_enough or lead > SETTINGS.search_caught


def leaves_noise_alone(none: Ranked) -> bool:
    """Whether the tuned model leaves noise, and not since values out of tolerance or errors of its own took a cause up."""
    away, spread = none.fit.tuned_away or none.fit.calibrated_away, none.fit.spread
    errs = spread.largest("parts") or spread.is_large("nominal")
    return bool(none.reduced < SETTINGS.search_enough and not (away or errs))


def best_of(ranked: Sequence[Ranked], none: Ranked) -> Ranked:
    """The best cause of those fitted on all lines; without one, the re-tuned model."""
    return max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence, default=none)


def is_enough(ranked: Sequence[Ranked], none: Ranked, leaves: Callable[[Ranked], float]) -> bool:
    """Whether the best cause leaves so little that nothing more need be tried."""
    best = max((none, *ranked), key=lambda r: r.fit.log_evidence)
    # A cause that needs more error of the model than is believed stands in for what that error takes up.
    if best.fit.log_evidence <= none.fit.log_evidence or not best.refined or best.fit.beyond_belief:
        return False
    left = best.reduced
    if not best.fit.hypothesis.linear and (held_out := leaves(best)) > SETTINGS.verdict_misfit:
        # What a restoring force takes from the levels that it was fitted to may fail at others.
        left = held_out * best.fit.spread.noise
    return left < SETTINGS.search_left + SETTINGS.search_left_of_gap * max(none.reduced - 1.0, 0.0)


def first_known(ranked: Sequence[Ranked], none: Ranked) -> Ranked:
    """The best known cause by itself; one that is simulated only if the best hypothesis is that cause, alone or beside another."""
    best = best_of(ranked, none)
    singles = [r for r in ranked if len(r.fit.hypothesis.causes) == 1 and r.fit.hypothesis.effect != "unknown"]
    alone = best_of(singles, none)
    leads = set(alone.fit.hypothesis.causes) <= set(best.fit.hypothesis.causes)
    return alone if leads or alone.fit.hypothesis.linear else best


def forces_come_close(ranked: Sequence[Ranked]) -> bool:
    """Whether some restoring force comes close to the best linear hypothesis: where none does, none of unknown form will."""
    # Few lines say how close those come at the most that were not fitted on all.
    forces = [r.fit.log_evidence for r in ranked if not r.fit.hypothesis.linear]
    linear = max((r.fit.log_evidence for r in ranked if r.refined and r.fit.hypothesis.linear), default=-np.inf)
    return not forces or max(forces) > linear - SETTINGS.search_far / 2.0


def linear_of(ranked: Sequence[Ranked]) -> list[Ranked]:
    """Causes that are the same at every level."""
    return [r for r in ranked if r.fit.hypothesis.linear]


def taken_away(none: Fit, cause: Fit) -> float:
    """Part of the re-tuned model's excess over noise that a cause takes away."""
    return (none.reduced - cause.reduced) / max(none.reduced - 1.0, 1e-9) if none.reduced > 1.0 else 0.0
