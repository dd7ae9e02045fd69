"""
Sine records as a nonlinear model shows them: on which branch of the response each line is.

Where the response folds, a slow sweep stays on its branch until that ends, and jumps; a real one may jump earlier, for anything
that disturbs it. So between the folds the lines before some line lie on the branch that the sweep follows, those behind on the
other: the record says which line, in the last part before the fold. The model's own folds are off by some lines: behind one its
branch goes on, straight, for a part of what lies between the two. Under a held response nothing folds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cutvib_ss.diagnosis.records import Group
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.model.paths import Path
from cutvib_ss.response.harmonic_balance import SineSweep
from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.results.arrays import positions_given


@dataclass(frozen=True)
class SweptRecord:
    """A sine record as a model shows it."""

    branches: tuple[SineSweep, ...]  # Swept up; where that jumps, swept down too
    which: np.ndarray  # Branch of each line
    # Of lines behind the end of their branch the last two on it, of others themselves twice; shape (2, line)
    ends: np.ndarray
    beyond: FloatArray  # How far behind it they are, over the distance of these two

    def _taken(self, values: Sequence[ComplexArray]) -> ComplexArray:
        last, before = (np.stack(values)[self.which, :, at].T for at in self.ends)
        out: ComplexArray = last + self.beyond * (last - before)
        return out

    @property
    def data(self) -> ComplexArray:
        """Responses, shape (channel, frequency)."""
        return self._taken([b.data[0] for b in self.branches])

    def derivative(self, path: Path) -> ComplexArray:
        """Their derivative to one of the model's values, each line on its branch."""
        return self._taken([b.derivative(path)[0] for b in self.branches])


def swept(model: Model, group: Group, row: int) -> SweptRecord:
    """A sine record of a group."""
    sine, position = group.entries[row][0].sine, group.positions[row : row + 1]
    assert sine is not None

    def made(direction: Literal["up", "down"], controlled: Literal["force", "response"] = "force") -> SineSweep:
        return SineSweep(
            model,
            positions_given(position),
            group.freq,
            sine.force if sine.held is None else sine.held,
            direction,
            SETTINGS.simulation_harmonics,
            group.channels,
            SETTINGS.simulation_hysteresis_at,
            controlled,
            group.inputs[row],
        )

    first, every = np.zeros(group.freq.size, dtype=int), np.arange(group.freq.size)
    whole = np.stack([every, every]), np.zeros(every.size)
    if sine.held is not None:
        return SweptRecord((made("up", "response"),), first, *whole)
    up = made("up")
    if not up.folds:
        return SweptRecord((up,), first, *whole)
    size = np.abs(up.data[0])
    both = (up, made("down"))
    apart = np.any(
        np.abs(up.data[0] - both[1].data[0]) > SETTINGS.simulation_branches_apart * size.max(axis=1, keepdims=True),
        axis=0,
    )
    apart, ends, beyond = _reaching(apart, group.freq)
    alone = (SweptRecord((b,), first, e, t) for b, e, t in zip(both, ends, beyond, strict=True))
    left = [np.sum(np.abs(group.data[row] - one.data) ** 2 / group.variance[row], axis=0) for one in alone]
    which = branches(sine.direction, apart, left[0], left[1])
    return SweptRecord(both, which, ends[which, :, every].T, beyond[which, every])


def _reaching(apart: np.ndarray, freq: FloatArray) -> tuple[np.ndarray, np.ndarray, FloatArray]:
    """Lines that may be on either branch, and of that swept up and that swept down how each goes on behind its end."""
    # A jump of the model is off by some lines, and a line on the wrong branch would outweigh all others.
    wide, ends, beyond = apart.copy(), np.tile(np.arange(apart.size), (2, 2, 1)), np.zeros((2, apart.size))
    for a, b in _runs(apart):
        more = max(round(SETTINGS.simulation_late_jump * (b - a)), 1)
        for k, last, inward, behind in ((0, b - 1, -1, slice(b, b + more)), (1, a, 1, slice(max(a - more, 0), a))):
            before = last + inward if b - a > 1 else last
            wide[behind], ends[k, 0, behind], ends[k, 1, behind] = True, last, before
            if before != last:
                beyond[k, behind] = (freq[behind] - freq[last]) / (freq[last] - freq[before])
    return wide, ends, beyond


def _runs(apart: np.ndarray) -> list[tuple[int, int]]:
    """First line of each run, and that behind it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], apart.astype(int), [0]]))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def branches(direction: str | None, apart: np.ndarray, up: FloatArray, down: FloatArray) -> np.ndarray:
    """Branch of each line, 0 up and 1 down, from what either leaves there; all lines that are not between folds are on both."""
    if direction == "random":
        # Each line was come to by itself.
        return np.where(apart & (down < up), 1, 0)
    options = [_followed(d, apart, up, down) for d in ((direction,) if direction is not None else ("up", "down"))]
    return min(options, key=lambda which: float(np.sum(np.where(which == 0, up, down))))


def _followed(direction: str, apart: np.ndarray, up: FloatArray, down: FloatArray) -> np.ndarray:
    """Of each run of lines between folds those before some line on the branch that is followed, those behind on the other."""
    if direction == "down":
        return 1 - _followed("up", apart[::-1], down[::-1], up[::-1])[::-1]
    which = np.zeros(apart.size, dtype=int)
    for a, b in _runs(apart):
        # Squares of a jump before line a + k, k from none to all of them.
        cost = np.concatenate([[0.0], np.cumsum(up[a:b])]) + np.concatenate([np.cumsum(down[a:b][::-1])[::-1], [0.0]])
        # Behind the last it is the fold itself: at equal cost the sweep goes on.
        allowed = cost[b - a - max(round(SETTINGS.simulation_early_jump * (b - a)), 1) :][::-1]
        which[b - int(np.argmin(allowed)) : b] = 1
    return which
