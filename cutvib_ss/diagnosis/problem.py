"""
A hypothesis as unknowns with priors, and the objective over them.

Measured H = (1 + ε(f)) · predicted H(tuning, effect) + noise. Tuned values are nominal · exp(tolerance · x) with x ~ N(0, 1); each
channel's calibration error ε is complex and smooth over frequency with the tolerance as its standard deviation; the instant of
the blow is fitted where records do not state it; the effect's parameters are even over their range.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.diagnosis.form_errors import Form
from cutvib_ss.diagnosis.hypothesis import Hypothesis, carried_on, stages_of
from cutvib_ss.diagnosis.prediction import Circles, Predicted, Prediction, gained
from cutvib_ss.diagnosis.records import Group, session_of
from cutvib_ss.diagnosis.residual_modes import ResidualMode, residual_modes
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknowns import calibration_shapes, from_unknown, parts_among, to_unknown, tuning_paths
from cutvib_ss.diagnosis.work import count
from cutvib_ss.effects.base import Carried, Effect, Model
from cutvib_ss.model.paths import value_at, with_values
from cutvib_ss.results import ComplexArray, FloatArray

IndexArray: TypeAlias = NDArray[np.intp]
Derivatives: TypeAlias = Literal["no", "of one blow", "of all blows"]
"""Of what simulation is asked beside a restoring force: a record's blow of middle size tells the way, all blows the optimum."""
_KEPT = 64
"""Tuned models, and calibration errors, that a problem keeps: of as many groups as move apart."""


class Problem:
    """The unknowns of one hypothesis on some groups of records, and the objective over them."""

    apart: ClassVar[bool] = False
    """Whether its groups hold every record by itself, none merged with others at its position."""

    def __init__(self, nominal: Model, groups: Sequence[Group], hypothesis: Hypothesis) -> None:
        self.nominal, self.groups, self.hypothesis = nominal, tuple(groups), hypothesis
        self.tuning = tuning_paths(nominal)
        self._nominal_values = [value_at(nominal, path) for path, _ in self.tuning]
        self.channels = tuple(dict.fromkeys(c for g in groups for c in g.channels))
        self.calibration = nominal.tolerance.calibration
        self.free_blow = any(bool(np.isnan(g.blow_at[np.isfinite(g.block)]).any()) for g in groups)
        self.parameters = [
            (k, name, r)
            for k, e in enumerate(hypothesis.effects)
            for name, r in e.ranges_here(nominal, hypothesis.motions.get(e.place)).items()
            # What is not given, or infinite, is not fitted.
            if getattr(e, name) is not None and np.isfinite(getattr(e, name))
        ]
        coupled = np.count_nonzero(nominal.in_modes.assembly.core.coupled)
        self._large = max(1.0, coupled / SETTINGS.search_small_order)
        self.n_tuning = len(self.tuning)
        self.parts = parts_among(nominal, self.tuning)
        """Unknowns that are errors of single parts of a structure's matrices, and of the losses of its modes."""
        self.parts_held = False
        """Whether they are left at the middle of their priors."""
        self.by_simulation: Derivatives = "no"
        """Derivatives by simulation beside a restoring force, but to a structure's parts; else by its equivalent stiffness."""
        shapes = SETTINGS.calibration_shapes if self.calibration > 0 else 0
        self.n_calibration = 2 * shapes * len(self.channels)
        self.n_blow = int(self.free_blow)
        self.force_scaled, self.force_offset = self._force_scaled(), self._force_offset()
        self._blow = self.n_tuning + self.n_calibration
        self._shared_by_all = self._blow + self.n_blow
        self._offset = self._shared_by_all + len(self.force_scaled)
        self.first_effect = self._offset + int(self.force_offset > 0.0)
        self.size = self.first_effect + len(self.parameters)
        self._n_shapes = shapes
        self.band = (min(float(g.freq[0]) for g in groups), max(float(g.freq[-1]) for g in groups))
        self.shapes = [self.shapes_at(g.freq) for g in groups]
        self.sessions = tuple(dict.fromkeys(session_of(same[0]) for g in groups for same in g.entries))
        self.drifting_within: tuple[int, ...] = ()
        """Records that drift within their session."""
        self._circles: list[Circles | None] = [None] * len(self.groups)
        self._tuned: dict[bytes, Model] = {}
        self._gains: dict[tuple[tuple[str, ...], bytes, bytes], ComplexArray] = {}
        self.count = sum(2 * int(np.count_nonzero(np.isfinite(g.variance))) for g in groups)

    @cached_property
    def residual_modes(self) -> tuple[ResidualMode, ...]:
        """Modes that the model leaves out, by input and channel; none where it holds all."""
        return residual_modes(self.nominal, self.groups, self.band[1])

    def _force_scaled(self) -> tuple[tuple[int, int], ...]:
        """Records, by group and row, whose force is known only roughly: none matters where the response is linear."""
        return ()

    def _force_offset(self) -> float:
        """Standard deviation of a constant force beside the recorded one [N]: no linear response shows it."""
        return 0.0

    def offset_of(self, x: FloatArray) -> float:
        """The constant force beside the recorded one [N]."""
        return self.force_offset * float(x[self._offset]) if self.force_offset > 0.0 else 0.0

    def force_unknowns(self, x: FloatArray) -> FloatArray:
        """Unknowns of the forces that are known only roughly."""
        return x[self._shared_by_all : self._offset]

    def start(self, warm: FloatArray | None = None) -> FloatArray:
        """Unknowns to start from."""
        x = np.zeros(self.size)
        if warm is not None:
            known = self.first_effect if warm.size in (self.first_effect, self.size) else self._shared_by_all
            x[:known] = warm[:known]
        low, high = self.bounds()
        for i, (k, name, r) in enumerate(self.parameters):
            at = self.first_effect + i
            x[at] = np.clip(to_unknown(getattr(self.hypothesis.effects[k], name), r), low[at], high[at])
        return x

    @property
    def even(self) -> NDArray[np.bool_]:
        """Unknowns whose priors are even over a unit range."""
        out = np.zeros(self.size, dtype=bool)
        out[self.first_effect :] = [r.scale != "normal" for _, _, r in self.parameters]
        return out

    def tuned(self, x: FloatArray) -> Model:
        """The nominal model with its values moved; that of the last unknowns is kept."""
        key = x[: self.n_tuning].tobytes()
        if key not in self._tuned:
            if len(self._tuned) >= _KEPT:
                self._tuned.clear()
            self._tuned[key] = self._tuned_at(x)
        return self._tuned[key]

    def _tuned_at(self, x: FloatArray) -> Model:
        steps = zip(self.tuning, self._nominal_values, x, strict=False)
        values = {path: value * float(np.exp(tolerance * step)) for (path, tolerance), value, step in steps}
        # A drift that is followed far may ask for more than critical damping, at which there is no mode.
        return with_values(
            self.nominal,
            {
                path: min(v, SETTINGS.fit_most_damping) if path[-1] == "damping_ratio" else v
                for path, v in values.items()
            },
        )

    def effects(self, x: FloatArray) -> tuple[Effect, ...]:
        """The effects at their fitted values."""
        changes: list[dict[str, float]] = [{} for _ in self.hypothesis.effects]
        for i, (k, name, r) in enumerate(self.parameters):
            changes[k][name] = from_unknown(float(x[self.first_effect + i]), r)[0]
        return tuple(e.changed(c) for e, c in zip(self.hypothesis.effects, changes, strict=True))

    def applied(self, x: FloatArray) -> Model:
        """The tuned model with the effects."""
        model = self.tuned(x)
        for e in self.effects(x):
            model = e.apply(model)
        return model

    def model_of(self, x: FloatArray, group: Group) -> Model:
        """The model of the records of a group."""
        return self.applied(x)

    def blow_at(self, x: FloatArray) -> float:
        """Instant of the blow where records do not state it."""
        mean, std = SETTINGS.record_blow_at, SETTINGS.record_blow_at_std
        return max(mean + std * float(x[self._blow]), 0.0) if self.n_blow else 0.0

    def struck_at(self, x: FloatArray, blow_at: float) -> FloatArray:
        """The same unknowns with the blow at another instant, within its bounds."""
        low, high = self.bounds()
        out, k = x.copy(), self._blow
        out[k] = np.clip((blow_at - SETTINGS.record_blow_at) / SETTINGS.record_blow_at_std, low[k], high[k])
        return out

    def prior_precision(self) -> FloatArray:
        """Precision of the priors of the unknowns; none for effects, whose priors are even."""
        return np.where(self.even, 0.0, 1.0)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Ends of the unknowns' ranges."""
        high = np.full(self.size, SETTINGS.fit_within)
        low = -high
        if self.n_blow:
            low[self._blow], high[self._blow] = -1.0, 6.0
        even = self.even
        low[even], high[even] = 0.0, 1.0
        normal = ~even
        normal[: self.first_effect] = False
        low[normal], high[normal] = -SETTINGS.unknown_farthest, SETTINGS.unknown_farthest
        return low, high

    def each(self, x: FloatArray | Sequence[FloatArray]) -> list[FloatArray]:
        """Unknowns of each group."""
        return [x] * len(self.groups) if isinstance(x, np.ndarray) else list(x)

    def predictions(self, x: FloatArray | Sequence[FloatArray]) -> Sequence[Predicted]:
        """The model seen through the estimator of each group."""
        each = self.each(x)
        models = self._models(each)
        count(self._large * SETTINGS.search_response * sum(g.data.size for g in self.groups))
        out = [
            Prediction(model, g, self.blow_at(own), c)
            for model, g, own, c in zip(models, self.groups, each, self._circles, strict=True)
        ]
        self._circles = [p.circles for p in out]
        return out

    def aside(self, x: Sequence[FloatArray]) -> Sequence[Predicted]:
        """Predictions at unknowns close to the last ones, whose circles around slow poles stay."""
        circles = list(self._circles)
        out = self.predictions(x)
        self._circles = circles
        return out

    def _models(self, each: Sequence[FloatArray]) -> list[Model]:
        """The model of each group; groups that share their unknowns share it."""
        built: dict[int, Model] = {}
        return [built[id(x)] if id(x) in built else built.setdefault(id(x), self.applied(x)) for x in each]

    def share(self, other: Problem) -> None:
        """Start from another problem's circles around slow poles, tuned models and calibration errors, on the same groups."""
        if self.nominal is other.nominal and [id(g) for g in self.groups] == [id(g) for g in other.groups]:
            # The circles serve while they hold this one's poles.
            self._circles = [c if c is None or c.steady else replace(c, steady=True) for c in other._circles]
            self._tuned, self._gains = other._tuned, other._gains

    def forget_circles(self) -> None:
        """Draw the circles around slow poles anew at the next prediction."""
        self._circles = [None] * len(self.groups)

    def shapes_at(self, freq: FloatArray) -> FloatArray:
        """Shapes of a calibration error, shape (shape, frequency)."""
        return calibration_shapes(freq, self.band, self._n_shapes)

    def calibration_of(self, channels: Sequence[str], freq: FloatArray, x: FloatArray) -> ComplexArray:
        """Calibration error of channels."""
        key = (tuple(channels), freq.tobytes(), x[self.n_tuning : self._blow].tobytes())
        if key not in self._gains:
            if len(self._gains) >= _KEPT:
                self._gains.clear()
            self._gains[key] = self._calibration_at(channels, freq, x)
        return self._gains[key]

    def _calibration_at(self, channels: Sequence[str], freq: FloatArray, x: FloatArray) -> ComplexArray:
        shapes = self.shapes_at(freq)
        k = shapes.shape[0]
        rows = np.ones((len(channels), freq.size), dtype=np.complex128)
        for row, c in zip(rows, channels, strict=True):
            if c in self.channels:
                own = x[self.own(c, k)]
                row += self.calibration * ((own[:k] + 1j * own[k:]) @ shapes)
        return rows

    def shown(self, p: Predicted, x: FloatArray) -> ComplexArray:
        """A prediction with its channels' calibration errors."""
        return gained(p, lambda freq: self.calibration_of(p.group.channels, freq, x))

    def residuals(self, x: FloatArray | Sequence[FloatArray]) -> tuple[Sequence[Predicted], list[ComplexArray], float]:
        """Weighted residuals."""
        predictions = self.predictions(x)
        out, total = [], 0.0
        for g, p, own in zip(self.groups, predictions, self.each(x), strict=True):
            r = (g.data - self.shown(p, own)) * g.weight
            out.append(r)
            # A restoring force whose motion has run away leaves infinitely much: such a step is refused.
            with np.errstate(over="ignore"):
                total += float(np.sum(r.real**2 + r.imag**2))
        return predictions, out, total

    def jacobian(self, x: FloatArray, p: Predicted) -> ComplexArray:
        """
        Weighted derivatives of a prediction, of records that were fitted or of others, to the unknowns that move every channel.

        Shape (unknown, position, channel, frequency).
        """
        g = p.group
        weight = self.calibration_of(g.channels, g.freq, x) * g.weight
        slopes = np.array(self._slopes(x, p)).reshape(-1, *g.data.shape)
        count(self._large * slopes.size)
        return np.asarray(weight * slopes)

    def form_at(self, predictions: Sequence[Predicted]) -> Form:
        """Errors of the form of restoring forces: of a linear hypothesis none."""
        return ()

    def form_errors(self, x: FloatArray, predictions: Sequence[Predicted], form: Form) -> dict[int, ComplexArray]:
        """What errors of a restoring force's form do to records, by these: nothing where there is none."""
        return {}

    def own(self, channel: str, count: int) -> IndexArray:
        """Unknowns of a channel's calibration."""
        return self.n_tuning + 2 * count * self.channels.index(channel) + np.arange(2 * count)

    @property
    def constant_gains(self) -> dict[str, tuple[int, int]]:
        """Unknowns that are the constant part of each channel's calibration error, real and imaginary."""
        firsts = {c: int(self.own(c, self._n_shapes)[0]) for c in self.channels if self._n_shapes}
        return {c: (first, first + self._n_shapes) for c, first in firsts.items()}

    @property
    def shared(self) -> IndexArray:
        """Unknowns that move every channel."""
        return np.concatenate([np.arange(self.n_tuning), np.arange(self.n_tuning + self.n_calibration, self.size)])

    def _slopes(self, x: FloatArray, p: Any) -> list[ComplexArray]:
        """Derivatives of a prediction to tuning, instant of the blow and the effects' parameters."""
        effects = self.effects(x)
        stages = stages_of(self.tuned(x), effects)
        moves = [*self._tuning_moves(effects, stages)]
        moves += [self._effect_moves(x, i, effects, stages) for i in range(len(self.parameters))]
        slopes = p.derivatives([carried for _, carried in moves])
        slopes *= np.array([scale for scale, _ in moves])[:, None, None, None]
        out = list(slopes)
        if self.n_blow:
            out.insert(self.n_tuning, SETTINGS.record_blow_at_std * p.by_blow_at())
        return out

    def _tuning_moves(self, effects: Sequence[Effect], stages: Sequence[Model]) -> Iterator[tuple[float, Carried]]:
        """What moves with each tuned value, and by how much a unit of its unknown."""
        for i, (path, tolerance) in enumerate(self.tuning):
            if self.parts_held and i in self.parts.all:
                yield 0.0, ()
            else:
                yield tolerance * value_at(stages[0], path), carried_on(((path, 1.0),), effects, stages, 0)

    def _effect_moves(
        self, x: FloatArray, i: int, effects: Sequence[Effect], stages: Sequence[Model]
    ) -> tuple[float, Carried]:
        """What moves with an effect's parameter, and by how much a unit of its unknown."""
        index, name, r = self.parameters[i]
        moved = effects[index].moved_by(stages[index], stages[index + 1])[name]
        return from_unknown(float(x[self.first_effect + i]), r)[1], carried_on(moved, effects, stages, index + 1)
