"""Drift and discrepancy of a fit, and the posterior predictive of records that it has not seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from cutvib_ss.diagnosis.directions import Directions, real_rows
from cutvib_ss.diagnosis.discrepancy import weights
from cutvib_ss.diagnosis.hit_errors import Hit
from cutvib_ss.diagnosis.layout import Layout, Sizes
from cutvib_ss.diagnosis.likelihood import log_determinant, solved
from cutvib_ss.diagnosis.residual_modes import ResidualMode
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.errors import CutvibError
from cutvib_ss.results import ComplexArray, FloatArray

if TYPE_CHECKING:
    from cutvib_ss.diagnosis.prediction import Predicted
    from cutvib_ss.diagnosis.problem import Problem


Show: TypeAlias = Callable[["FloatArray"], "tuple[Predicted, ComplexArray]"]
"""A record as predicted from some unknowns, and its weighted residual."""

NO_HITS: Mapping[Hit, float] = {}
"""Of a record of no blows."""


class Left(NamedTuple):
    """What a fit leaves of one record under its posterior predictive."""

    chi2: FloatArray  # χ² per datum, by channel
    drift: float  # Mean square of what drift alone leaves
    # Log predictive density of all channels together, against that of the noise as stated: a constant of the data is left out
    log_density: float


@dataclass(frozen=True)
class Spread:
    """Drift and discrepancy of a fit."""

    layout: Layout  # Columns: the unknowns, then the directions
    sizes: Sizes  # Sizes of the directions
    offsets: FloatArray  # Coefficients of the directions, in their sizes; zero for the unknowns
    precision: FloatArray  # Posterior precision of all columns

    @property
    def noise(self) -> float:
        """Factor on the noise of records that were not fitted: no less than one."""
        # What a restoring force does to a response has been seen as scatter of the records that it explains. At another level there
        # is more of it or less, and the noise stated of those records is not too large by as much.
        return max(self.sizes.noise, 1.0)

    @property
    def at_largest(self) -> bool:
        """Whether the discrepancies of the nominal model and of a cause are both the largest of their priors."""
        return bool(self.layout.nominal and self.layout.pivots) and self.largest("nominal") and self.largest("cause")

    def largest(self, name: str) -> bool:
        """Whether a size is the largest of its prior."""
        return bool(getattr(self.sizes, name) >= SETTINGS.sizes[name][-1][0])

    def is_large(self, name: str) -> bool:
        """Whether a size is larger than the median of its prior."""
        return sum(p for size, p in SETTINGS.sizes[name] if size <= getattr(self.sizes, name)) > 0.5 + 1e-9

    def drifts(self, sessions: Sequence[tuple[float | str, ...]], records: Sequence[int], count: int) -> FloatArray:
        """Drift of the tuned values of some sessions, then of some records; zero of those that were not fitted."""
        lay = self.layout
        out = np.zeros((len(sessions) + len(records), count))
        if len(lay.drifting) == count:
            for k, name in enumerate((*sessions, *records)):
                if name in (own := lay.sessions if k < len(sessions) else lay.records):
                    size = self.sizes.drift if k < len(sessions) else self.sizes.within
                    at = lay.unknowns if k < len(sessions) else lay.first_within
                    at += lay.per_session * own.index(name)
                    out[k] = size * self.offsets[at : at + count]
        return out

    def of_record(
        self,
        name: tuple[float | str, ...],
        record: int,
        hits: Mapping[Hit, float],
        modes: Sequence[ResidualMode] = (),
        pivots: tuple[tuple[float, float], ...] = (),
    ) -> Spread:
        """
        The same for one record in its columns, all others being left at their best.

        It shows some residual modes, and a cause's discrepancy at points of its own.
        """
        lay = self.layout
        seen = {(m.input, m.channel) for m in lay.residual_modes}
        own = replace(
            lay,
            sessions=(name,) if lay.sessions else (),
            records=(record,) if lay.records else (),
            pivots=pivots or lay.pivots,
            residual_modes=(*lay.residual_modes, *(m for m in modes if (m.input, m.channel) not in seen)),
            hits=tuple(hits),
            errors=tuple(hits.values()),
        )
        # Columns here and there of the unknowns and of what all records share, then of what was seen of this one.
        there, here = (
            [
                np.arange(at.unknowns),
                at.first_nominal + np.arange(lay.first_cause - lay.first_nominal),
                # Real parts, then imaginary ones, of the pivots and of those that the record has beside.
                at.first_cause + np.arange(len(lay.pivots)),
                at.first_cause + len(at.pivots) + np.arange(len(lay.pivots)),
                at.first_form + np.arange(lay.first_hit - lay.first_form),
            ]
            for at in (lay, own)
        )
        if name in lay.sessions:
            there.append(lay.unknowns + lay.per_session * lay.sessions.index(name) + np.arange(lay.per_session))
            here.append(lay.unknowns + np.arange(lay.per_session))
        if record in lay.records:
            there.append(lay.first_within + lay.per_session * lay.records.index(record) + np.arange(lay.per_session))
            here.append(own.first_within + np.arange(lay.per_session))
        for k, key in enumerate(own.hits):
            if key in lay.hits:
                there.append(np.array([lay.first_hit + lay.hits.index(key)]))
                here.append(np.array([own.first_hit + k]))
        known, at = np.concatenate(there), np.concatenate(here)
        # Nothing is known of the rest but its size.
        offsets, precision = np.zeros(own.size), np.eye(own.size)
        offsets[at] = self.offsets[known]
        precision[np.ix_(at, at)] = self._precision_of(tuple(known.tolist()))
        return Spread(own, self.sizes, offsets, precision)

    def _precision_of(self, columns: tuple[int, ...]) -> FloatArray:
        """Posterior precision of some columns, the others integrated out."""
        if columns not in self._found:
            own = np.array(columns)
            others = np.setdiff1d(np.arange(self.layout.size), own)
            between, inner = self.precision[np.ix_(others, own)], self.precision[np.ix_(own, own)]
            if others.size:
                inner = inner - between.T @ solved(self.precision[np.ix_(others, others)], between)
            self._found[columns] = inner
        return self._found[columns]

    @cached_property
    def _found(self) -> dict[tuple[int, ...], FloatArray]:
        return {}

    def left(
        self,
        problem: Problem,
        x: FloatArray,
        name: tuple[float | str, ...],
        record: int,
        show: Show,
        afar: Show,
        hits: Mapping[Hit, float] = NO_HITS,
        modes: Sequence[ResidualMode] = (),
        pivots: tuple[tuple[float, float], ...] = (),
    ) -> Left:
        """
        One record under the posterior predictive.

        The covariance is 1 + A C Aᵀ in whitened data, A the derivatives to all columns, C their posterior covariance. Where drift
        of the session or of the record is not known yet, a record may tell more of it, and of the unknowns, than is small: they
        are taken where the record has them, by Gauss-Newton steps, and pay their prior. `afar` shows it with a widened noise. Its
        hits, residual modes of an input that was not struck elsewhere, and a cause's discrepancy at levels or positions that were
        not fitted (`pivots`), are known by their sizes only.
        """
        own = self.of_record(name, record, hits, modes, pivots)
        columns = _drifts(own.layout, name, record, own.sizes)
        seen = (name in self.layout.sessions, record in self.layout.records)
        new = any(not seen[k] and size > SETTINGS.predictive_small_drift for k, _, size in columns)
        seeing = _Seeing(own, problem, x, [(at, size) for _, at, size in columns], show)
        best = seeing.at(np.zeros(own.layout.size))
        if new and best.left > SETTINGS.fit_hopeless * 2 * best.residual.size:
            # Of sharp resonances far from where they are expected first order tells little: a widened noise has no side minima.
            rough = replace(seeing, show=afar)
            there = seeing.at(rough.climbed(rough.at(best.moved)).moved)
            best = there if there.left < best.left else best
        return seeing.judged(seeing.climbed(best) if new else best)


class _Seen(NamedTuple):
    """A record from where some columns have moved to."""

    moved: FloatArray  # By how much, from their posterior mean
    shown: Predicted
    residual: ComplexArray
    directions: Directions
    precision: FloatArray  # Of all columns with the record
    left: float  # Squares of the residual and of the priors, the columns that are left at their best to first order
    step: FloatArray  # To that best, of the columns that are followed


@dataclass(frozen=True)
class _Seeing:
    """What is needed to look at one record from where columns have moved to."""

    own: Spread
    problem: Problem
    x: FloatArray
    drifts: list[tuple[np.ndarray, float]]  # Columns of session and record, and the size of their drift
    show: Show

    @property
    def followed(self) -> np.ndarray:
        """Columns that are moved for good, the others to first order."""
        return np.concatenate([np.arange(self.own.layout.unknowns), *(at for at, _ in self.drifts)])

    def within(self, moved: FloatArray) -> FloatArray:
        """Moved columns within the bounds of the unknowns, drifts within what their size allows."""
        out, n, most = moved.copy(), self.own.layout.unknowns, SETTINGS.likelihood_farthest_drift
        low, high = self.problem.bounds()
        unit = self.own.layout.scale(self.own.sizes)[:n]
        there = np.clip(self.x + unit * out[:n], np.minimum(low, self.x), np.maximum(high, self.x))
        out[:n] = (there - self.x) / unit
        for at, _ in self.drifts:
            out[at] = np.clip(self.own.offsets[at] + out[at], -most, most) - self.own.offsets[at]
        return out

    def at(self, moved: FloatArray) -> _Seen:
        """The record from there."""
        own, lay = self.own, self.own.layout
        scale, noise = lay.scale(own.sizes), own.noise
        weight, tuned = weights(self.problem)[0], np.array(lay.drifting, dtype=int)
        there, mean = self.x + (scale * moved)[: lay.unknowns], own.offsets.copy()
        for at, size in self.drifts:
            there[tuned] += weight[tuned] * size * (own.offsets[at] + moved[at])
            mean[at] = 0.0
        mean[lay.first_hit :] -= lay.errors / scale[lay.first_hit :]
        shown, residual = self.show(there)
        directions = Directions(self.problem, there, [shown], like=lay)
        gram, inner = directions.normal([residual[None]])
        gram *= scale * scale[:, None] / noise
        inner *= scale / noise
        # The directions stand at their mean.
        matrix, pulled = own.precision + gram, inner - gram @ mean - own.precision @ moved
        squares = float(np.sum(np.abs(residual) ** 2)) / noise - 2.0 * float(inner @ mean) + float(mean @ gram @ mean)
        squares += float(moved @ own.precision @ moved)
        best = solved(matrix, pulled)
        step = np.zeros(lay.size)
        step[self.followed] = best[self.followed]
        return _Seen(moved, shown, residual, directions, matrix, squares - float(pulled @ best), step)

    def climbed(self, best: _Seen) -> _Seen:
        """Where Gauss-Newton steps lead."""
        step, longer = best.step, np.inf
        for _ in range(SETTINGS.predictive_iterations):
            try:
                there = self.at(self.within(best.moved + step))
            except CutvibError:
                step, longer = step / 2.0, np.inf
                continue
            gained = best.left - there.left
            if abs(gained) < SETTINGS.predictive_gain * there.left:
                return there if gained > 0.0 else best
            if gained > 0.0:
                best, step, longer = there, there.step, np.inf
            elif -4.0 * gained >= longer:
                # The parabola through what this step and one of twice its length lose rises from the start: none shorter gains.
                break
            else:
                step, longer = step / 2.0, -gained
        return best

    def judged(self, seen: _Seen) -> Left:
        """Residual of each channel by itself, and of all together."""
        own, lay = self.own, self.own.layout
        mean, noise, scale = own.offsets.copy(), own.noise, lay.scale(own.sizes)
        for at, _ in self.drifts:
            mean[at] = 0.0
        mean[lay.first_hit :] -= lay.errors / scale[lay.first_hit :]
        known, back = float(seen.moved @ own.precision @ seen.moved), own.precision @ seen.moved
        out, drifts, count = np.empty(seen.residual.shape[0]), [], 0
        for _, _, c, index, part in seen.directions.chunks():
            flat = real_rows(part) * scale[index, None]
            moving = (index >= lay.unknowns) & (index < lay.first_nominal)
            variance = seen.shown.group.variance[0, c] / 2
            variance = np.where(np.isfinite(variance), variance, 0.0)
            drifting = np.abs(part[moving, 0] * scale[index[moving], None]) ** 2
            drifts.append(float(np.mean(np.sum(drifting, axis=0) * variance)))
            r = real_rows(seen.residual[None, c])[0] - mean[index] @ flat
            inner, pulled = own.precision.copy(), -back
            inner[np.ix_(index, index)] += flat @ flat.T / noise
            pulled[index] += flat @ r / noise
            out[c] = (r @ r / noise + known - float(pulled @ solved(inner, pulled))) / r.size
            count += r.size
        wider = log_determinant(seen.precision) - log_determinant(own.precision) + count * float(np.log(noise))
        return Left(out, float(np.mean(drifts)), -0.5 * (seen.left + wider))


def _drifts(
    lay: Layout, name: tuple[float | str, ...], record: int, sizes: Sizes
) -> list[tuple[int, np.ndarray, float]]:
    """Columns of the drift of a session (0) and of a record (1) that have any, with the size of each."""
    out = []
    for k, (own, among, first, size) in enumerate(
        ((name, lay.sessions, lay.unknowns, sizes.drift), (record, lay.records, lay.first_within, sizes.within))
    ):
        if own in among:
            start = first + lay.per_session * among.index(own)
            out.append((k, start + np.arange(len(lay.drifting)), size))
    return out
