"""
What is unknown and depends on the level: a restoring force at a port, or an error of a channel, smooth over frequency and level.

    z(ω, a) = scale Σ_kl (a_kl + i b_kl) g_k(ln ω) h_l(ln a),   coefficients N(0, 1)

with g and h the shapes of reduced-rank Gaussian processes: the describing function of any force across the port, or of a sensor
that is not linear, to first order in what it does within a record. Of a sine the level a is the amplitude of the response line by
line, of a blow its peak force. A known restoring force has to do better than this with two or three parameters, or its form is
wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cutvib_ss.diagnosis.discrepancy import level_of
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.prediction import Prediction
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.model.elements import SMOOTH_LENGTH, smooth_process
from cutvib_ss.model.paths import Path, part_at, with_values
from cutvib_ss.results import ComplexArray, FloatArray

if TYPE_CHECKING:
    from cutvib_ss.diagnosis.prediction import Predicted
    from cutvib_ss.diagnosis.records import Group


class ByLevelProblem(Problem):
    """Something unknown that depends on the level, records apart, one a group: coefficients (shape over frequency, over level)."""

    apart = True

    def __init__(self, nominal: Model, groups: Sequence[Group], hypothesis: Hypothesis) -> None:
        super().__init__(nominal, groups, hypothesis)
        levels = [level_of(g, row) for g in self.groups for row in range(len(g.data))]
        low, high = min(float(w.min()) for w in levels), max(float(w.max()) for w in levels)
        self.ends = (low, high)
        self.n_levels = 1 + int(np.ceil((high - low) / SETTINGS.unknown_level_spacing))
        # Of each frequency shape all level shapes, one after the other.
        self.parameters = [p for p in self.parameters for _ in range(self.n_levels)]
        self.size = self.first_effect + len(self.parameters)

    def _levels(self, group: Group) -> FloatArray:
        """Shapes over the level at a group's lines, shape (level shape, frequency)."""
        scale = SMOOTH_LENGTH / SETTINGS.discrepancy_amplitude_length
        u = level_of(group, 0) * scale
        ends = (self.ends[0] * scale, self.ends[1] * scale)
        return np.asarray(smooth_process(u, ends, self.n_levels)).real if self.n_levels > 1 else np.ones((1, u.size))

    def start(self, warm: FloatArray | None = None) -> FloatArray:
        x = np.zeros(self.size)
        if warm is not None:
            known = warm.size if warm.size == self.size else min(warm.size, self.first_effect)
            x[:known] = warm[:known]
        return x

    def _coefficients(self, x: FloatArray) -> FloatArray:
        """Shape (coefficient of `SmoothElement`, level shape)."""
        return x[self.first_effect :].reshape(-1, self.n_levels)

    def model_of(self, x: FloatArray, group: Group) -> Model:
        """The model at the level of a record."""
        shapes = self._levels(group)
        if np.ptp(shapes, axis=1).max() < 1e-12:
            shapes = shapes[:, :1]
        values = self._coefficients(x) @ shapes
        model = self.applied(x)
        paths = self._paths(model)
        coefficients = tuple(float(v[0]) if v.size == 1 else tuple(v.tolist()) for v in values)
        element = replace(part_at(model, paths[0]), coefficients=coefficients)
        return with_values(model, dict.fromkeys(paths, element))

    def _paths(self, model: Model) -> tuple[Path, ...]:
        """Where a model holds what is unknown."""
        [own] = self.hypothesis.effects
        found: tuple[Path, ...] = own.paths(model)  # type: ignore[attr-defined]
        return found

    def effects(self, x: FloatArray) -> tuple[Effect, ...]:
        """The element at the middle of the levels."""
        [own] = self.hypothesis.effects
        middle = self._coefficients(x).mean(axis=1)
        names = [name for _, name, _ in self.parameters[:: self.n_levels]]
        return (own.changed(dict(zip(names, middle.tolist(), strict=True))),)

    def _models(self, each: Sequence[FloatArray]) -> list[Model]:
        return [self.model_of(x, g) for x, g in zip(each, self.groups, strict=True)]

    def _slopes(self, x: FloatArray, p: Predicted) -> list[ComplexArray]:
        assert isinstance(p, Prediction)
        shapes = self._levels(p.group)
        effects = self.effects(x)
        stages = [self.tuned(x), p.model]
        moves = list(self._tuning_moves(effects, stages))
        slopes = p.derivatives([carried for _, carried in moves])
        out = [scale * slope for (scale, _), slope in zip(moves, slopes, strict=True)]
        if self.n_blow:
            out.append(SETTINGS.record_blow_at_std * p.by_blow_at())
        # The shapes vary little between a line and the circles around the poles beside it.
        paths = self._paths(p.model)
        unit = p.derivative(tuple(((*path, "unit"), 1.0) for path in paths))
        for row in part_at(p.model, paths[0]).shapes(p.s):
            out += [shape * row * unit for shape in shapes]
        return out
