"""The problem of a hypothesis on records of which some drift: the tuned values that each of its groups has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cutvib_ss.diagnosis.discrepancy import weights
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.layout import Sizes
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import By, Records, session_of
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.effects.base import Model
from cutvib_ss.results import FloatArray


class Drifted:
    """Problems of one hypothesis whose groups hold all records, those of a session, or one each: as many as the drift asks for."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.whole = problem = problems[-1]
        # Sessions in another order would have other columns.
        self.problems = [p if p.sessions == problem.sessions else problem for p in problems]
        weight, _ = weights(problem)
        self.drifting = np.flatnonzero(weight)
        self.weight = weight[self.drifting]
        self.n_sessions = len(problem.sessions)

    @property
    def none(self) -> FloatArray:
        """No drift of any session, and of any record that drifts beside its own; shape (session and record, tuned value)."""
        return np.zeros((self.n_sessions + len(self.whole.drifting_within), self.drifting.size))

    def sizes(self, sizes: Sizes) -> FloatArray:
        """Size of the drift of each session and record, shape (session and record, 1)."""
        return np.repeat([sizes.drift, sizes.within], [self.n_sessions, len(self.whole.drifting_within)])[:, None]

    def of(self, spread: Spread) -> FloatArray:
        """The drift that a fit found."""
        return spread.drifts(self.whole.sessions, self.whole.drifting_within, self.drifting.size)

    def at(self, x: FloatArray, drift: FloatArray) -> tuple[Problem, list[FloatArray]]:
        """The problem whose groups move apart, and the unknowns of each group."""
        moves = int(np.any(drift)) + int(np.any(drift[self.n_sessions :]))
        problem = self.problems[min(moves, len(self.problems) - 1)]
        if not moves:
            return problem, [x] * len(problem.groups)
        each = []
        for g in problem.groups:
            own, entry = x.copy(), g.entries[0][0]
            moved = drift[problem.sessions.index(session_of(entry))].copy()
            if moves > 1:
                moved += drift[self.n_sessions + problem.drifting_within.index(entry.record)]
            own[self.drifting] += self.weight * moved
            each.append(own)
        return problem, each


def problems_of(
    nominal: Model, records: Records, hypothesis: Hypothesis, spread: bool, apart: bool = False
) -> tuple[Problem, ...]:
    """The problem with all records together and, to follow drift, by session, and by record where the machine moves."""
    # Without drift the sessions need not be told apart, and many positions are predicted at once.
    followed: tuple[By, ...] = ("session", "record") if records.moving else ("session",)
    return tuple(problem_for(nominal, records, hypothesis, apart, by) for by in (None, *(followed if spread else ())))
