"""A fitted hypothesis as plain values, and warnings of parameters at their prior bounds and of tuning beyond its tolerance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cutvib_ss.diagnosis.cross_validation import Judged, reduced_chi2
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.records import Entry
from cutvib_ss.diagnosis.result import CandidateEvidence
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknowns import tuning_paths
from cutvib_ss.effects.base import Model, discrete_values
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.model.paths import Path
from cutvib_ss.parameters import MATRICES

ENDS = "{} = {} is at its prior bound: the true value may lie beyond, or the cause be another"
HELD = (
    "the delay of {:.3g} ms is half a sample at {:.4g} Hz: a force that is held between its samples, as a controller's output is, "
    "acts so much later than they say, and no channel need be late; record the force that acts"
)
STRAINED = "with this answer {} is {:.1f} tolerances off ({} %): a second cause may hide there, measure it by itself"


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


def of_held_force(fitted: Fit, entries: Sequence[Entry]) -> list[str]:
    """A warning of a delay of all channels that is half a sample of the recordings."""
    clocks = {e.replay.clock for e in entries if e.replay is not None and not e.replay.assumed}
    out = []
    for k, effect in enumerate(fitted.hypothesis.effects):
        if isinstance(effect, ChannelDelay) and effect.channel == "all" and len(clocks) == 1:
            half, std = 0.5 / min(clocks), fitted.stds[f"{k}.delay"]
            # Known to a tenth, else it may be anything.
            if abs(effect.delay - half) < 2.0 * std < 0.2 * half:
                out.append(HELD.format(1e3 * effect.delay, min(clocks)))
    return out


def out_of_tolerance(nominal: Model, fitted: Fit) -> list[str]:
    """Warnings of tuned values and gains of an answer that lie far out of their tolerance."""
    away = [
        (_named(path), abs(x), f"{100.0 * np.expm1(tolerance * x):+.2g}")
        for (path, tolerance), x in zip(tuning_paths(nominal), fitted.x[: fitted.n_tuning], strict=True)
    ]
    # A gain is complex: it has no sign.
    calibration = 100.0 * nominal.tolerance.calibration
    away += [(f"the gain or phase of {c}", size, f"{calibration * size:.2g}") for c, size in fitted.gains.items()]
    # Of a structure's many parts the one that is farthest off.
    farthest = {row[0]: row for row in sorted(away, key=lambda row: row[1]) if row[1] > SETTINGS.fit_tuned_away}
    return [STRAINED.format(*row) for row in sorted(farthest.values(), key=lambda row: -row[1])]


def _named(path: Path) -> str:
    """A tuned value, as machine.toml calls it."""
    if path[0] == "scales":
        return f"the {MATRICES[int(path[1])]} as a whole"
    if path[0] == "parts":
        return "a part of the structure's matrices"
    if path[1] == "losses":
        return f"damping_ratio of mode {int(path[2]) + 1} of the rail"
    if path[1] == "frequencies":
        return f"natural frequency of mode {int(path[2]) + 1} of the rail"
    return f"{path[-1]} of the {path[0]}"
