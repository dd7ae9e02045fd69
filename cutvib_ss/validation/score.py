"""The score of some cases: rows with goals, confusion, calibration, and every case that was sure and wrong."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from cutvib_ss.results import FloatArray
from cutvib_ss.results.display import finite
from cutvib_ss.validation.cases import NONE, UNKNOWN, Case, Causes, name_of
from cutvib_ss.validation.measured import MeasuredRow
from cutvib_ss.validation.rows import (
    LARGE,
    SMALL,
    SURE,
    Row,
    confidences,
    excess_closed,
    left_over,
    rows,
    stated_closed,
)
from cutvib_ss.validation.statistics import (
    Bin,
    Estimate,
    calibration_error,
    calibration_error_if_perfect,
    proportion,
    reliability,
    risk_coverage,
)

SCHEMA = "cutvib-blind-score/1"
SEVERITIES = (0.0, SMALL, 1.0, LARGE, 5.0, 15.0, math.inf)
"""Limits of the gap over noise between which cases are counted together."""


@dataclass(frozen=True)
class Confusion:
    """How often each truth got each name."""

    truths: tuple[str, ...]  # Rows and columns
    named: tuple[str, ...]
    counts: np.ndarray[tuple[int, ...], np.dtype[np.int64]]  # Cases


@dataclass(frozen=True)
class Group:
    """Cases counted together."""

    name: str  # What they share
    right: Estimate  # Part whose first answer is right
    probability: float  # Mean probability on the truth
    confidence: float  # Mean probability that the first answer stated for itself
    calibration_error: float  # Expected calibration error, and what perfect calibration would show at that many cases
    if_perfect: float


@dataclass(frozen=True)
class Shrinkage:
    """How far the gap is said to shrink, and how far it does."""

    name: str  # The case
    stated: float  # Part of the error over noise that is said to be closed on held-out records, and its 95 % interval
    low: float
    high: float
    # Part of the nominal model's error that is closed on fresh records, without noise and at other positions
    achieved: float
    right: bool  # Whether the first answer is the truth


@dataclass(frozen=True)
class Score:
    """A trial's score."""

    about: Mapping[str, Any]  # When, by which code, how many cases of which kind
    rows: tuple[Row, ...]  # The figures
    causes: Confusion  # Truths against names
    places: Confusion
    bins: tuple[Bin, ...]  # Reliability
    coverage: FloatArray  # Part of wrong answers among the surest
    risk: FloatArray
    by_severity: tuple[Group, ...]  # Cases with one cause by size of the gap
    by_cause: tuple[Group, ...]  # All cases by cause
    # All cases by kind, by how far the machine moves, by kind of the machine; those with one cause by how far its
    # form is from the catalogue's
    groups: Mapping[str, tuple[Group, ...]]
    cases: tuple[Case, ...]  # All cases
    baselines: Mapping[str, tuple[Row, ...]] = field(default_factory=dict)  # The same figures of simpler methods

    @property
    def shrinkage(self) -> tuple[Shrinkage, ...]:
        """Cases of which it is known how far the gap shrank on fresh records."""
        return tuple(s for s in map(_shrinkage, self.cases) if s is not None)

    @property
    def sure_and_wrong(self) -> tuple[Case, ...]:
        """Cases whose first answer was stated with at least 0.9 and is wrong, the surest first."""
        found = [c for c in self.cases if c.answer.confidence >= SURE and not c.right]
        return tuple(sorted(found, key=lambda c: -c.answer.confidence))

    def to_dict(self) -> dict[str, Any]:
        """The score as plain data; what is not finite becomes None."""
        p, right = confidences(self.cases), [c.right for c in self.cases]
        chance, bound = calibration_error_if_perfect(p)
        data = {
            "schema": SCHEMA,
            "trial": dict(self.about),
            "rows": [_row(r) for r in self.rows],
            "confusion": {
                name: {"truths": list(m.truths), "named": list(m.named), "counts": m.counts.tolist()}
                for name, m in (("causes", self.causes), ("places", self.places))
            },
            "reliability": {
                "calibration_error": calibration_error(p, right),
                "if_perfect": {"mean": chance, "quantile95": bound},
                "bins": [
                    {"low": b.low, "high": b.high, "confidence": b.confidence, **_estimate(b.right, "right")}
                    for b in self.bins
                ],
            },
            "risk_coverage": {"coverage": self.coverage.tolist(), "risk": self.risk.tolist()},
            "shrinkage": [vars(s) for s in self.shrinkage],
            "by_severity": [_group(g) for g in self.by_severity],
            "by_cause": [_group(g) for g in self.by_cause],
            "groups": {title: [_group(g) for g in own] for title, own in self.groups.items()},
            "sure_and_wrong": [c.name for c in self.sure_and_wrong],
            "cases": [case_data(c) for c in self.cases],
            "baselines": {name: [_row(r) for r in own] for name, own in self.baselines.items()},
        }
        cleaned: dict[str, Any] = finite(data)
        return cleaned


def scored(cases: Sequence[Case], about: Mapping[str, Any], measured: Sequence[MeasuredRow] = ()) -> Score:
    """The score of some cases, and of measured machines beside them."""
    kinds = Counter(c.truth.kind for c in cases)
    coverage, risk = risk_coverage(confidences(cases), [c.right for c in cases])
    single = [c for c in cases if c.truth.kind == "single"]
    return Score(
        about={**about, "cases": len(cases), "kinds": dict(sorted(kinds.items())), **_accounts(cases)},
        rows=rows(cases, measured),
        causes=_confusion(cases, lambda c: _truth(c), _named),
        places=_confusion(cases, lambda c: "+".join(sorted(c.truth.place)), lambda c: "+".join(sorted(c.answer.place))),
        bins=reliability(confidences(cases), [c.right for c in cases]),
        coverage=coverage,
        risk=risk,
        by_severity=tuple(
            _grouped(_size(low, high), own)
            for low, high in pairwise(SEVERITIES)
            if (own := [c for c in single if low <= c.truth.gap_sigma < high])
        ),
        by_cause=tuple(
            _grouped(name, [c for c in cases if _truth(c) == name]) for name in sorted({_truth(c) for c in cases})
        ),
        groups={
            "by kind": _by(cases, lambda c: c.truth.kind),
            "by repeatability": _by(cases, _repeatability),
            "by size of the gap, all that have one": tuple(
                _grouped(_size(low, high), own)
                for low, high in pairwise(SEVERITIES)
                if (own := [c for c in cases if c.truth.kind != "none" and low <= c.truth.gap_sigma < high])
            ),
            "by form, one cause": _by(single, lambda c: GRADES[min(c.truth.grade, len(GRADES) - 1)]),
            "by machine": _by(cases, lambda c: c.truth.machine),
        },
        cases=tuple(cases),
    )


def _accounts(cases: Sequence[Case]) -> dict[str, Any]:
    """What the rig refused to integrate, by kind of the case, and cases with blows whose motion is unstable."""
    refused: Counter[str] = Counter()
    for c in cases:
        refused[_truth(c)] += int(c.truth.label.get("redrawn") or 0)
    unstable = sum(bool(c.truth.label.get("unstable_blows")) for c in cases)
    return {
        "refused_draws": {name: n for name, n in sorted(refused.items()) if n},
        "cases_with_unstable_blows": unstable,
    }


GRADES = ("0: the catalogue's", "1: near it", "2: another", "3: of its kind only")
"""How far the form of a cause is from the catalogue's."""


def _by(cases: Sequence[Case], name: Callable[[Case], str]) -> tuple[Group, ...]:
    return tuple(_grouped(one, [c for c in cases if name(c) == one]) for one in sorted({name(c) for c in cases}))


def _size(low: float, high: float) -> str:
    return f"{low:g}-{high:g} σ" if math.isfinite(high) else f"≥ {low:g} σ"


def _repeatability(case: Case) -> str:
    """How far the machine moves between sessions."""
    if not case.truth.drifting:
        return "repeats"
    drift = float(case.truth.label["conditions"]["repeatability"].get("drift", 0.0))
    stated = case.truth.label["conditions"]["repeatability"].get("stated") is not None
    size = "below 0.3 %" if drift < 0.003 else "0.3-2 %" if drift < 0.02 else "over 2 %"
    return f"drifts {size}, {'stated' if stated else 'not stated'}"


def _shrinkage(case: Case) -> Shrinkage | None:
    stated = stated_closed(case)
    if stated is None or not math.isfinite(case.achieved):
        return None
    return Shrinkage(case.name, *stated, case.achieved, case.right)


def _truth(case: Case) -> str:
    return "pair" if case.truth.kind == "pair" else case.truth.name


def _named(case: Case) -> str:
    first = case.answer.first
    if first is None:
        return "failed"
    # Pairs are many and rare: one column for those that are right, one for others.
    if len(first) > 1:
        return "pair" if first == case.truth.causes else "another pair"
    return name_of(first)


def _confusion(cases: Sequence[Case], truth: Callable[[Case], str], named: Callable[[Case], str]) -> Confusion:
    pairs = Counter((truth(c), named(c) or "failed") for c in cases)
    truths = sorted({t for t, _ in pairs}, key=_last)
    names = sorted({n for _, n in pairs} | {t for t in truths if not t.startswith("outside:")}, key=_last)
    counts = np.array([[pairs[t, n] for n in names] for t in truths], dtype=np.int64).reshape(len(truths), len(names))
    return Confusion(tuple(truths), tuple(names), counts)


def _last(name: str) -> tuple[int, str]:
    """Causes in order, then what is none."""
    late = ("none", "pair", "another pair", "outside", "unknown", "failed")
    head = name.split(":")[0]
    return (late.index(head) + 1 if head in late else 0, name)


def _grouped(name: str, cases: Sequence[Case]) -> Group:
    stated = [c.answer.probability_that(c.truth) for c in cases]
    p, right = confidences(cases), [c.right for c in cases]
    chance, _ = calibration_error_if_perfect(p)
    return Group(
        name, proportion(right), float(np.mean(stated)), float(np.mean(p)), calibration_error(p, right), chance
    )


def case_data(case: Case) -> dict[str, Any]:
    """One case as plain data."""
    gap = case.answer.diagnosis.get("gap", {})
    first: Causes | None = case.answer.first
    return {
        "campaign": case.name,
        "kind": case.truth.kind,
        "truth": case.truth.name,
        "truth_place": "+".join(sorted(case.truth.place)),
        "form": case.truth.label.get("form"),
        "grade": case.truth.grade,
        "machine": case.truth.machine,
        "repeatability": _repeatability(case),
        "gap_sigma": case.truth.gap_sigma,
        "severity": case.truth.label.get("severity"),
        "verdict": case.answer.verdict,
        "named": None if first is None else name_of(first),
        "named_place": "+".join(sorted(case.answer.place)),
        "place_set": sorted(case.answer.place_set),
        "right_place": case.right_place,
        "confidence": case.answer.confidence,
        "probability_of_truth": case.answer.probability_that(case.truth),
        "probability_of_none": case.answer.probability_of(NONE),
        "probability_of_unknown": case.answer.probability_of(UNKNOWN),
        "probability_of_truth_by_oracle": None
        if case.truth.oracle is None
        else case.truth.oracle.get(case.truth.causes, 0.0),
        "log_score_lost": case.lost,
        "hidden": case.truth.hidden,
        "set_size": len(case.answer.likely),
        "right": case.right,
        "reduced_chi2": left_over(case),
        "excess_closed": excess_closed(case),
        "shrinkage": gap.get("shrinkage"),
        "shrinkage_interval": gap.get("shrinkage_interval"),
        "achieved": case.achieved,
        "seconds": case.run.get("cpu_seconds"),
        "message": _last_words(case) if case.answer.verdict == "failed" else "",
    }


def _last_words(case: Case) -> str:
    """Why there is no diagnosis: the last line of what the process said, but for the command line's own good-bye."""
    said = [
        line for line in str(case.run.get("message", "")).splitlines() if line and "a fault of the program" not in line
    ]
    return f"{case.run.get('status', 'failed')}: {said[-1]}" if said else str(case.run.get("status", "failed"))


def _row(row: Row) -> dict[str, Any]:
    return {
        "key": row.key,
        "title": row.title,
        "unit": row.unit,
        **_estimate(row.estimate, "value"),
        "goal": row.goal,
        "at_least": row.at_least,
        "met": row.met,
        "note": row.note,
    }


def _estimate(estimate: Estimate, name: str) -> dict[str, Any]:
    return {name: estimate.value, "interval": [estimate.low, estimate.high], "cases": estimate.cases}


def _group(group: Group) -> dict[str, Any]:
    return {
        "name": group.name,
        **_estimate(group.right, "right"),
        "probability": group.probability,
        "confidence": group.confidence,
        "calibration_error": group.calibration_error,
        "if_perfect": group.if_perfect,
    }
