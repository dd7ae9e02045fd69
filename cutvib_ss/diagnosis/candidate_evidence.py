"""A fitted hypothesis as plain values, and warnings of parameters at their prior bounds."""

from __future__ import annotations

from collections.abc import Sequence

from cutvib_ss.diagnosis.cross_validation import Judged, reduced_chi2
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.result import CandidateEvidence
from cutvib_ss.effects.base import discrete_values

ENDS = "{} = {} is at its prior bound: the true value may lie beyond, or the cause be another"


def evidence_of(r: Ranked, held_out: Sequence[Judged] = ()) -> CandidateEvidence:
    """What a fitted hypothesis has to say for itself."""
    return CandidateEvidence(
        name=r.name,
        effect=r.fit.hypothesis.effect,
        place=r.fit.hypothesis.place,
        parameters=_discrete(r.fit),
        log_evidence=r.fit.log_evidence,
        chi2=r.fit.chi2 if r.refined else float("nan"),
        unknowns=r.fit.x.size - r.fit.first_effect,
        judged=bool(held_out),
        held_reduced_chi2=reduced_chi2(held_out) if held_out else float("nan"),
        held_log_density=sum(j.log_density for j in held_out) if held_out else float("nan"),
    )


def _discrete(fit: Fit) -> dict[str, str]:
    """What is discrete about a fitted cause: the parameter that is shifted, the channel that is late."""
    out = {}
    for e in fit.hypothesis.effects:
        out.update({name: str(value) for name, value in discrete_values(e).items()})
    return out


def at_their_ends(fitted: Fit) -> list[str]:
    """Warnings of a fitted cause's values that lie at an end of their range."""
    out = []
    for name in fitted.at_end:
        which, parameter = name.split(".")
        effect = fitted.hypothesis.effects[int(which)]
        unit = effect.units(fitted.model)[parameter]
        value = f"{getattr(effect, parameter):.4g}" + ("" if unit == "1" else f" {unit}")
        out.append(ENDS.format(f"{parameter} of {effect.effect} at {effect.place}", value))
    return out
