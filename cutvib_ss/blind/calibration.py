"""
The numbers behind the stated probabilities, fitted to opened trials and judged on others.

What is fitted is the log loss of the probability on the truth: it is least where stated probabilities come true and are as sharp as
the evidence allows. Cases to judge on come from other trials, with other seeds and severities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from cutvib_ss.blind.cases import UNKNOWN
from cutvib_ss.blind.evidence import CaseEvidence, TrialEvidence, stated
from cutvib_ss.blind.files import code_hash, now
from cutvib_ss.blind.statistics import calibration_error
from cutvib_ss.errors import ParameterError
from cutvib_ss.gap.calibration import Calibration, posteriors, shipped
from cutvib_ss.results import FloatArray

SCHEMA = "cutvib-calibration/1"
FLOOR = 1e-6
"""Least probability that the log loss knows: one case that was wrong beyond all doubt must not outweigh the rest."""
HOLD = 0.02
"""Weight of a prior on the numbers, a factor of e each from where they start: it decides only what the cases do not."""
BOUNDS: Mapping[str, tuple[float, float]] = {
    "temperature": (0.2, 200.0),
    "detection": (0.1, 2000.0),
    "pairs": (1e-3, 10.0),
    # Noise is known to a few percent: the labelled campaigns of another rig show right causes up to 1.015.
    "left_over": (1.06, 5.0),
    "sharpness": (1e-3, 1.0),
    "of_the_gap": (1e-6, 0.1),
    # A search that misses a known cause leaves it nothing, which the log loss's floor hides: one "unknown" in eight is such a
    # miss (4 of the 39 surest of 400 cases, by the rule of succession).
    "most_unknown": (0.5, 0.88),
    "doubt": (1e-5, 0.3),
    # Above a half no such value would ever be named, and it is what an engineer checks first.
    "unspecific": (0.01, 0.45),
}


@dataclass(frozen=True)
class Figures:
    """
    How good probabilities are on a set of cases.

    Parameters
    ----------
    set : str
        Which cases, by which numbers.
    cases : int
        How many.
    log_loss : float
        Mean of -ln of the probability on the truth.
    right : float
        Part whose first answer is right.
    calibration_error : float
        Expected calibration error of the first answers.
    """

    set: str
    cases: int
    log_loss: float
    right: float
    calibration_error: float


@dataclass(frozen=True)
class Calibrated:
    """
    Fitted numbers, with how they came about.

    Parameters
    ----------
    before, numbers : Calibration
        Where the fit started, and where it ended.
    figures : tuple of Figures
        On the cases of the fit and on those to judge, by either.
    fitted, judged : tuple of TrialEvidence
        The trials.
    only : tuple of str
        Numbers that were fitted; all if empty.
    """

    before: Calibration
    numbers: Calibration
    figures: tuple[Figures, ...]
    fitted: tuple[TrialEvidence, ...]
    judged: tuple[TrialEvidence, ...]
    only: tuple[str, ...] = ()

    def changes(self) -> list[tuple[str, float, float]]:
        """
        Each number before and after.

        Returns
        -------
        list of (str, float, float)
            Name and values.
        """
        old, new = asdict(self.before), asdict(self.numbers)
        return [(name, old[name], new[name]) for name in old]

    def to_dict(self) -> dict[str, Any]:
        """
        The numbers as they are kept with the package, with the commands that remake them.

        Returns
        -------
        dict
            Of the schema ``cutvib-calibration/1``.
        """

        def told(trials: Sequence[TrialEvidence]) -> list[dict[str, Any]]:
            return [
                {"folder": t.folder, "settings": dict(t.settings), "code_sha256": t.code_sha256, "cases": len(t.cases)}
                for t in trials
            ]

        options = "".join(f" --judge {t.folder}" for t in self.judged) + "".join(f" --only {n}" for n in self.only)
        return {
            "schema": SCHEMA,
            "made": now(),
            "command": f"cutvib blind calibrate {' '.join(t.folder for t in self.fitted)}{options} --out calibration.json",
            "code_sha256": code_hash(),
            "numbers": asdict(self.numbers),
            "before": asdict(self.before),
            "figures": [asdict(f) for f in self.figures],
            "fitted_on": told(self.fitted),
            "judged_on": told(self.judged),
        }


def figures(what: str, cases: Sequence[CaseEvidence], numbers: Calibration) -> Figures:
    """
    How good the probabilities of some numbers are.

    Parameters
    ----------
    what : str
        Name of the set.
    cases : sequence of CaseEvidence
        The cases.
    numbers : Calibration
        The scales.

    Returns
    -------
    Figures
        On these cases.
    """
    answers = [stated(c, numbers) for c in cases]
    first = [max(a, key=lambda k: a[k]) for a in answers]
    right = [f == c.truth for f, c in zip(first, cases, strict=True)]
    return Figures(
        set=what,
        cases=len(cases),
        log_loss=_Batch(cases).log_loss(numbers),
        right=float(np.mean(right)) if right else float("nan"),
        calibration_error=calibration_error([a[f] for a, f in zip(answers, first, strict=True)], right),
    )


class _Batch:
    """Many cases as arrays, padded to the longest list of candidates."""

    def __init__(self, cases: Sequence[CaseEvidence]) -> None:
        width = max((len(c.named) for c in cases), default=0)
        shape = (len(cases), width)
        self.log_evidence, self.held = np.full(shape, -np.inf), np.full(shape, np.nan)
        self.acting, self.true = np.zeros(shape), np.zeros((len(cases), width + 1))
        self.unspecific = np.zeros(shape, dtype=np.bool_)
        self.reduced = np.array([c.evidence.reduced for c in cases])
        self.tuned = np.array([c.evidence.held["none"] for c in cases])
        for i, c in enumerate(cases):
            for k, name in enumerate(c.evidence.log_evidence):
                self.log_evidence[i, k] = c.evidence.log_evidence[name]
                self.acting[i, k] = c.evidence.causes[name]
                self.unspecific[i, k] = name in c.evidence.unspecific
                left = c.evidence.held.get(name)
                self.held[i, k] = np.nan if left is None else left if np.isfinite(left) else np.inf
                self.true[i, k] = c.named[name] == c.truth
            self.true[i, width] = c.truth == UNKNOWN

    def log_loss(self, numbers: Calibration) -> float:
        """Mean of -ln of the probability on the truth."""
        if not self.reduced.size:
            return float("nan")
        shares = posteriors(
            self.log_evidence, self.acting, self.unspecific, self.held, self.reduced, self.tuned, numbers
        )
        return float(-np.mean(np.log(np.maximum(np.sum(shares * self.true, axis=1), FLOOR))))


def fit_numbers(cases: Sequence[CaseEvidence], start: Calibration, only: Sequence[str] = ()) -> Calibration:
    """
    Numbers of least log loss.

    Parameters
    ----------
    cases : sequence of CaseEvidence
        The cases.
    start : Calibration
        Where to start; what the cases do not decide stays near it.
    only : sequence of str
        Numbers that are fitted, the others stay; all of them if empty.

    Returns
    -------
    Calibration
        The numbers, within their bounds.

    Raises
    ------
    ParameterError
        If there is no such number.

    Notes
    -----
    Nelder and Mead in the logarithms, from the start and from hotter and colder ones: the loss has kinks where the first
    answer changes.
    """
    if strange := set(only) - set(BOUNDS):
        raise ParameterError(f"no such number: {', '.join(sorted(strange))}; there are {', '.join(BOUNDS)}")
    names = [n for n in BOUNDS if not only or n in only]
    low, high = np.log([BOUNDS[n][0] for n in names]), np.log([BOUNDS[n][1] for n in names])
    home = np.clip(np.log([max(getattr(start, n), 1e-12) for n in names]), low, high)

    def numbers(x: FloatArray) -> Calibration:
        return replace(start, **dict(zip(names, np.exp(np.clip(x, low, high)).tolist(), strict=True)))

    batch = _Batch(cases)

    def loss(x: FloatArray) -> float:
        return batch.log_loss(numbers(x)) + HOLD * float(np.sum((x - home) ** 2)) / max(len(cases), 1)

    best = home
    for shift in (0.0, 1.0, -1.0):
        # Temperature and sharpness decide which basin is found.
        first = home + shift * np.array([n in ("temperature", "sharpness") for n in names])
        simplex = np.vstack([first, first + 0.7 * np.eye(len(names))])
        found = minimize(
            loss, first, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 1200, "xatol": 1e-2, "fatol": 1e-5}
        )  # fmt: skip
        best = min(best, found.x, key=loss)
    return numbers(best)


def calibrate(
    trials: Sequence[TrialEvidence],
    judges: Sequence[TrialEvidence] = (),
    start: Calibration | None = None,
    only: Sequence[str] = (),
) -> Calibrated:
    """
    Fit the numbers to opened trials and judge them on others.

    Parameters
    ----------
    trials : sequence of TrialEvidence
        Cases to fit on.
    judges : sequence of TrialEvidence
        Cases to judge on.
    start : Calibration, optional
        Where to start; by default what ships with the package.
    only : sequence of str
        Numbers that are fitted, the others stay; all of them if empty.

    Returns
    -------
    Calibrated
        The numbers, with figures.

    Raises
    ------
    ParameterError
        If a trial is in both, by its folder or its seed and severities, or there is no such number.
    """
    for judge in judges:
        for trial in trials:
            if judge.settings == trial.settings or judge.settings.get("seed") == trial.settings.get("seed"):
                raise ParameterError(
                    f"{judge.folder}: has the seed of {trial.folder}, on which the numbers are fitted; judge on another"
                )
    before = shipped() if start is None else start
    fitted = [c for t in trials for c in t.cases]
    judged = [c for t in judges for c in t.cases]
    after = fit_numbers(fitted, before, only)
    sets = [("fitted on, before", fitted, before), ("fitted on, after", fitted, after)]
    if judged:
        sets += [("judged on, before", judged, before), ("judged on, after", judged, after)]
    return Calibrated(before, after, tuple(figures(*s) for s in sets), tuple(trials), tuple(judges), tuple(only))
