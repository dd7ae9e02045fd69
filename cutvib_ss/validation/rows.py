"""The rows of the score: what is asked of the diagnosis, over which cases, and whether the goal is met."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from cutvib_ss.validation.cases import ELEMENT, FEW_PLACES, LEAST, NONE, Case
from cutvib_ss.validation.measured import MeasuredRow
from cutvib_ss.validation.statistics import (
    Estimate,
    calibration_error,
    calibration_error_if_perfect,
    proportion,
    quantile,
    resampled,
)

LARGE, SMALL = 2.0, 0.5
"""Gaps over noise that the goals tell apart: from 2 σ, and from 0.5 σ to 2 σ."""
SURE = 0.9
"""Stated probability from which an answer counts as sure."""

Unit: TypeAlias = Literal["%", "", "s"]
Cases: TypeAlias = Sequence[Case]


@dataclass(frozen=True)
class Row:
    """One figure of the score."""

    key: str  # Its name in JSON
    title: str  # What it is
    unit: Unit  # How it is printed; ``"%"`` is a fraction of one
    estimate: Estimate  # Figure, interval and number of cases
    goal: float | None = None  # What is to be reached; None for a row that only informs
    at_least: bool = True  # Whether more is better
    note: str = ""  # What else to know

    @property
    def met(self) -> bool | None:
        """Whether the figure reaches its goal; None without goal or cases."""
        if self.goal is None or not np.isfinite(self.estimate.value):
            return None
        value = self.estimate.value
        return bool(value >= self.goal if self.at_least else value <= self.goal)


def rows(cases: Cases, measured: Sequence[MeasuredRow] = ()) -> tuple[Row, ...]:
    """All figures of a trial, and of measured machines beside it."""
    return (
        *_causes(cases),
        *_places(cases),
        *_confidence(cases),
        *_oracle(cases),
        *_detection(cases),
        *_how_far(cases),
        *_effort(cases),
        *_measured(measured, cases),
    )


def _kind(cases: Cases, *kinds: str) -> list[Case]:
    return [c for c in cases if c.truth.kind in kinds]


def _gap(cases: Cases, low: float, high: float = np.inf) -> list[Case]:
    return [c for c in cases if low <= c.truth.gap_sigma < high]


def _part(cases: Cases, holds: Callable[[Case], bool]) -> Estimate:
    return proportion([holds(c) for c in cases])


def _causes(cases: Cases) -> list[Row]:
    shows = [c for c in _kind(cases, "single") if not c.truth.hidden]
    single = [c for c in shows if c.truth.grade == 0]
    varied = [c for c in shows if c.truth.grade > 0]
    hidden = [c for c in _kind(cases, "single") if c.truth.hidden]
    faint = _gap(_kind(cases, "single"), 0.0, SMALL)
    stated = [c.answer.probability_that(c.truth) for c in _gap(single, SMALL)]
    everything = [c.answer.probability_that(c.truth) for c in cases]
    return [
        Row("right_large", "right cause first, gap ≥ 2 σ", "%", _part(_gap(single, LARGE), _right), 0.97),
        Row("right_small", "right cause first, gap 0.5-2 σ", "%", _part(_gap(single, SMALL, LARGE), _right), 0.90),
        Row("right_varied", "right cause first, its form varied, gap ≥ 0.5 σ", "%", _part(_gap(varied, SMALL), _right), 0.90,
            note="the cause of another physical form than the catalogue's; an unknown element may stand beside it"),
        Row("right_faint", "right cause first, or no gap seen, gap < 0.5 σ", "%",
            _part(faint, lambda c: c.right or c.answer.verdict == "no_gap")),
        Row("right_hidden", "no gap seen where tolerance hides it", "%",
            _part(hidden, lambda c: c.right or c.answer.verdict == "no_gap"),
            note="the oracle itself states none with 0.5 or more: these cases are in no row of right causes or of misses"),
        Row("right_all", "right answer first, all cases", "%", _part(cases, _right),
            note="none, unknown and pairs are answers too"),
        Row("probability", "mean probability on the true cause, gap ≥ 0.5 σ", "", resampled(stated), 0.90),
        Row("probability_all", "mean probability on the true answer, all cases", "", resampled(everything)),
    ]  # fmt: skip


def _places(cases: Cases) -> list[Row]:
    single = _gap(_kind(cases, "single"), SMALL)
    return [
        Row("place", "right place, one cause, gap ≥ 0.5 σ", "%", _part(single, _right_place), 0.97,
            note=f"or among at most {FEW_PLACES} places that are stated as a set"),
        Row("place_outside", "right place, cause outside the catalogue", "%",
            _part(_kind(cases, "outside"), _right_place), 0.90),
        Row("place_pair", "right places of a pair, or one of them", "%", _part(_kind(cases, "pair"), _right_place)),
    ]  # fmt: skip


def _right_place(case: Case) -> bool:
    return case.right_place


def _right(case: Case) -> bool:
    return case.right


def _confidence(cases: Cases) -> list[Row]:
    p, right = confidences(cases), [c.right for c in cases]
    chance, bound = calibration_error_if_perfect(p)
    both = np.array([p, right], dtype=float).T
    scatter = np.random.default_rng(0).integers(0, max(len(p), 1), (500, len(p)))
    errors = [calibration_error(b[:, 0].tolist(), (b[:, 1] > 0.5).tolist()) for b in both[scatter]] if p else [np.nan]
    low, high = np.quantile(errors, [0.025, 0.975])
    sure = [c for c in cases if c.answer.confidence >= SURE]
    sizes = [len(c.answer.likely) for c in cases if c.answer.entries]
    return [
        Row("coverage", "95 % set holds the truth", "%",
            _part(cases, lambda c: any(c.truth.holds(one) for one in c.answer.likely)), 0.93),
        Row("set_size", "causes in the 95 % set", "", resampled(sizes), 1.6, False, "of the cases that have a diagnosis"),
        Row("calibration_error", "expected calibration error", "",
            Estimate(calibration_error(p, right), float(low), float(high), len(p)), 0.03, False,
            f"perfect calibration would show {chance:.3f} at that many cases, at most {bound:.3f} in 95 of 100 trials"),
        Row("sure_and_wrong", "sure (≥ 0.9) and wrong, of all cases", "%",
            _part(cases, lambda c: c.answer.confidence >= SURE and not c.right), 0.005, False,
            f"{len(sure)} of {len(cases)} answers are sure"),
    ]  # fmt: skip


def _oracle(cases: Cases) -> list[Row]:
    covered = [c for c in cases if c.truth.oracle is not None]
    odds = [c.truth.oracle or {} for c in covered]
    first = [max(o.items(), key=lambda item: item[1])[0] == c.truth.causes for o, c in zip(odds, covered, strict=True)]
    stated = [min(max(o.values()), 1.0) for o in odds]
    best = [-math.log(min(max(o.get(c.truth.causes, 0.0), LEAST), 1.0)) for o, c in zip(odds, covered, strict=True)]
    chance, bound = calibration_error_if_perfect(stated)
    return [
        Row("log_score_lost", "log score lost against the oracle [nats a case]", "", resampled([c.lost for c in covered]),
            0.15, False, f"mean over the {len(covered)} cases that the oracle covers; none counts as less than {LEAST:g}"),
        Row("oracle_log_score", "log score of the oracle itself [nats a case]", "", resampled(best),
            note="what is lost by what cannot be known"),
        Row("oracle_right", "the oracle's own first answer is right", "%", proportion(first)),
        Row("oracle_calibration", "the oracle's own expected calibration error", "",
            resampled([calibration_error(stated, first)] * bool(stated)),
            note=f"perfect calibration would show {chance:.3f} at that many cases, at most {bound:.3f} in 95 of 100 trials"),
    ]  # fmt: skip


def _measured(measured: Sequence[MeasuredRow], cases: Cases) -> list[Row]:
    """Measured machines with a documented or an exactly known cause."""
    added = [c for c in cases if c.truth.machine == "measured"]
    told = [m for m in measured if m.effects is not None]
    faulty = [m for m in told if m.effects != ("none",)]
    halves = [v for m in told if m.effects == ("none",) for v in (m.halves or (m.verdict,))]
    return [
        Row("measured_first", "measured rigs, documented cause first with ≥ 0.5", "%",
            proportion([m.rank == 1 and (m.probability or 0.0) >= 0.5 for m in faulty]), 1.0),
        Row("measured_sure_and_wrong", "measured rigs, sure (≥ 0.9) and wrong", "%",
            proportion([m.sure_and_wrong for m in told]), 0.0, False),
        Row("measured_halves", "measured rigs without a cause, or halves of them: no_gap", "%",
            proportion([v == "no_gap" for v in halves]), 1.0),
        Row("measured_added", "measured rigs with an element added, it and the documented cause named first", "%",
            _part(added, _right)),
        Row("measured_added_one", "… the element or the documented cause named first", "%",
            _part(added, lambda c: bool((c.answer.first or frozenset()) & c.truth.every))),
    ]  # fmt: skip


def confidences(cases: Cases) -> list[float]:
    """What each first answer stated for itself."""
    return [min(max(c.answer.confidence, 0.0), 1.0) for c in cases]


def _detection(cases: Cases) -> list[Row]:
    outside, single, pair = (_kind(cases, kind) for kind in ("outside", "single", "pair"))
    sound = _kind(cases, "none")

    def unknown(case: Case) -> bool:
        return case.answer.verdict in ("unknown", "failed")

    drifting = [c for c in sound if c.truth.drifting]

    return [
        Row("false_alarm", "false alarm on gap-free campaigns", "%",
            _part(sound, lambda c: c.answer.verdict != "no_gap"), 0.01, False, "anything but no_gap is an alarm"),
        Row("false_alarm_drifting", "… where the machine drifts", "%",
            _part(drifting, lambda c: c.answer.verdict != "no_gap"), 0.01, False),
        Row("missed", "no gap seen where there is one ≥ 0.5 σ", "%",
            _part([c for c in _gap([*outside, *single, *pair], SMALL) if not c.truth.hidden],
                  lambda c: c.answer.first in (NONE, None))),
        Row("outside_flagged", "outside the catalogue, flagged: unknown or partly explained", "%",
            _part(outside, lambda c: c.answer.flagged), 0.92),
        Row("outside_unknown", "outside the catalogue, called unknown", "%",
            _part(outside, lambda c: c.answer.verdict == "unknown")),
        Row("inside_unknown", "one cause inside it, called unknown", "%", _part(single, unknown), 0.03, False),
        Row("outside_probability", "mean probability of unknown, outside the catalogue", "",
            resampled([c.answer.probability_that(c.truth) for c in outside]), note="alone or beside a known cause"),
        Row("pair_named", "both causes of a pair named", "%", _part(pair, _right), 0.85),
        Row("pair_one", "at least one cause of a pair named first", "%",
            _part(pair, lambda c: bool((c.answer.first or frozenset()) & c.truth.causes))),
    ]  # fmt: skip


def _how_far(cases: Cases) -> list[Row]:
    inside = _kind(cases, "single", "pair")
    left = [left_over(c) for c in inside]
    seen = [x for x in left if np.isfinite(x)]
    closed = [x for c in inside if np.isfinite(x := excess_closed(c))]
    truly = [c.achieved for c in inside if np.isfinite(c.achieved)]
    over = [s[0] - c.achieved for c in inside if np.isfinite(c.achieved) and (s := stated_closed(c)) is not None]
    note = f"{len(left) - len(seen)} of {len(left)} state none" if len(seen) < len(left) else ""
    return [
        Row("chi2_median", "held-out reduced χ² after, median", "", quantile(seen, 0.5), 1.05, False, note),
        Row("chi2_95", "held-out reduced χ² after, 95th percentile", "", quantile(seen, 0.95), 1.3, False, note),
        Row("achieved", "part of the gap that is closed on fresh records", "%", resampled(truly),
            note="mean; other positions, next to no noise, no calibration errors"),
        Row("overstated", "stated less achieved part", "%", resampled(over), note="mean; above zero: too much is claimed"),
        Row("excess_closed", "excess of the gap over noise that is closed", "%", resampled(closed), 0.98,
            note="mean over cases with a cause of the catalogue whose error is at least a tenth over the noise"),
    ]  # fmt: skip


def left_over(case: Case) -> float:
    """Reduced χ² on held-out records with the cause that the diagnosis would add."""
    known = (e.reduced_chi2 for e in case.answer.entries if ELEMENT not in e.causes)
    return next(known, np.nan)


def excess_closed(case: Case) -> float:
    """Part of the error over noise, on held-out records, that the diagnosis closes."""
    stated = stated_closed(case)
    return float("nan") if stated is None else min(stated[0], 1.0)


def stated_closed(case: Case) -> tuple[float, float, float] | None:
    """Part of the error over noise that a diagnosis says it closes, with its 95 % interval."""
    gap = case.answer.diagnosis.get("gap", {})
    figures = (
        gap.get("before"),
        gap.get("noise_floor"),
        gap.get("shrinkage"),
        *(gap.get("shrinkage_interval") or [None]),
    )
    if any(f is None for f in figures) or figures[0] < 1.1 * figures[1]:
        return None
    before, noise, *shrinkage = (float(f) for f in figures)
    part, low, high = (s * before / (before - noise) for s in shrinkage)
    return part, low, high


def _effort(cases: Cases) -> list[Row]:
    out = []
    for dependent, key, title, middle, goal in (
        (False, "linear", "response alike at all levels", 6.0, 10.0),
        (True, "nonlinear", "response changes with the level", 25.0, 60.0),
    ):
        taken = [
            float(c.run["cpu_seconds"])
            for c in cases
            if c.run.get("cpu_seconds") is not None
            and c.answer.diagnosis.get("where", {}).get("level_dependent") is dependent
        ]
        note = f"longest {max(taken):.3g} s; start-up included" if taken else ""
        title_of = f"time on one core, {{}}: {title}"
        out.append(Row(f"median_{key}", title_of.format("median"), "s", quantile(taken, 0.5), middle, False))
        out.append(
            Row(
                f"time_{key}",
                title_of.format("95th percentile"),
                "s",
                quantile(taken, 0.95),
                goal,
                False,
                note,
            )
        )
    failed = _part(cases, lambda c: c.answer.verdict == "failed")
    return [
        *out,
        Row("failed", "no diagnosis: crashed or took too long", "%", failed, note="count as wrong everywhere"),
    ]
