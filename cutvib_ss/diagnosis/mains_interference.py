"""Mains interference: whether the re-tuned model's residual lies on multiples of 50 or 60 Hz."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cutvib_ss.diagnosis.findings import PlaceScore
from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.place import Located
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records, thinned
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.results import FloatArray


def mains(nominal: Model, none: Fit, records: Records) -> float | None:
    """The mains whose multiples hold the re-tuned model's residual."""
    problem = Problem(nominal, records.merged, Hypothesis())
    _, residuals, _ = problem.residuals(none.x)
    # Both parts of a residual are over their own noise: |r|²/2 is one on average where noise is all.
    power = [np.mean(np.abs(r) ** 2 / 2, axis=(0, 1)) - 1.0 for r in residuals]
    freq, excess = np.concatenate([g.freq for g in problem.groups]), np.concatenate(power)
    for frequency in SETTINGS.mains_frequencies:
        on = np.concatenate([_on(g.freq, frequency) for g in problem.groups])
        inside, beside = float(excess[on].sum()), float(excess[~on].sum())
        multiples = np.unique(np.round(freq[on & (excess > SETTINGS.mains_peak)] / frequency))
        few = 0 < np.mean(on) < SETTINGS.mains_most_lines and multiples.size >= SETTINGS.mains_harmonics
        if not few or inside < SETTINGS.mains_share * (inside + max(beside, 0.0)):
            continue
        rest = Records(tuple(thinned(e, ~_on(e.freq, frequency)) for e in records.entries))
        again = fit(nominal, rest, Hypothesis(), none.x)
        if again.reduced - 1.0 < max(SETTINGS.mains_clean, SETTINGS.mains_skirts * (none.reduced - 1.0)):
            return frequency
    return None


def with_mains_interference(located: Located, frequency: float) -> Located:
    """Places, where the measurement carries mains interference."""
    own = PlaceScore("measurement", f"mains {frequency:g} Hz", 1.0, SETTINGS.mains_probability)
    others = [s for s in located.scores if s.place != "measurement"]
    share = sum(s.probability for s in others) or 1.0
    rest = tuple(replace(s, probability=(1.0 - SETTINGS.mains_probability) * s.probability / share) for s in others)
    return replace(located, scores=(own, *rest))


def _on(freq: FloatArray, mains: float) -> np.ndarray:
    step = float(np.median(np.diff(freq))) if freq.size > 1 else 0.0
    nearest = np.maximum(np.round(freq / mains), 1.0) * mains
    return np.asarray(np.abs(freq - nearest) <= max(SETTINGS.mains_lines * step, SETTINGS.mains_beside))
