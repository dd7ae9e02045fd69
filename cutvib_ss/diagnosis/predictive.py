"""Drift and discrepancy of a fit, and the posterior predictive of records that it has not seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cutvib_ss.diagnosis.directions import Directions, Layout, Sizes, real_rows
from cutvib_ss.diagnosis.discrepancy import weights
from cutvib_ss.diagnosis.likelihood import log_determinant, solved
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.errors import CutvibError
from cutvib_ss.results import ComplexArray, FloatArray

if TYPE_CHECKING:
    from cutvib_ss.diagnosis.prediction import Predicted
    from cutvib_ss.diagnosis.problem import Problem


class Left(NamedTuple):
    """What a fit leaves of one record under its posterior predictive."""

    chi2: FloatArray  # χ² a datum, by channel
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
    def at_largest(self) -> bool:
        """Whether the discrepancies of the nominal model and of a cause are both the largest of their priors."""
        largest = all(getattr(self.sizes, name) >= SETTINGS.sizes[name][-1][0] for name in ("nominal", "cause"))
        return bool(self.layout.nominal and self.layout.pivots) and largest

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

    def with_record(self, name: tuple[float | str, ...], record: int, hits: int) -> Spread:
        """The same with one more record, its hits, and its session: nothing is known of them but the size of their drift."""
        lay = self.layout
        sessions = (*lay.sessions, name) if lay.sessions and name not in lay.sessions else lay.sessions
        records = (*lay.records, record) if lay.records and record not in lay.records else lay.records
        struck = tuple(dict.fromkeys((*lay.hits, *((record, k) for k in range(hits)))))
        if (sessions, records, struck) == (lay.sessions, lay.records, lay.hits):
            return self
        more = replace(lay, sessions=sessions, records=records, hits=struck)
        within = more.first_within + np.arange(lay.first_nominal - lay.first_within)
        old = np.r_[: lay.first_within, within, more.first_nominal : more.first_hit + len(lay.hits)]
        offsets, precision = np.zeros(more.size), np.eye(more.size)
        offsets[old] = self.offsets
        precision[np.ix_(old, old)] = self.precision
        return Spread(more, self.sizes, offsets, precision)

    def left(
        self,
        problem: Problem,
        x: FloatArray,
        name: tuple[float | str, ...],
        record: int,
        show: Callable[[FloatArray], tuple[Predicted, ComplexArray]],
        hits: int = 0,
    ) -> Left:
        """
        One record under the posterior predictive.

        The covariance is 1 + A C Aᵀ in whitened data, A the derivatives to all columns, C their posterior covariance. The drift of
        a session that was not fitted is taken where the record has it, and pays its prior.
        """
        own = self.with_record(name, record, hits)
        lay, scale = own.layout, own.layout.scale(own.sizes)
        drift, _ = weights(problem)
        moved = np.array(lay.drifting, dtype=int)
        z = np.zeros(lay.size)
        mean = own.offsets.copy()
        at = slice(0, 0)
        if name in lay.sessions:
            first = lay.unknowns + lay.per_session * lay.sessions.index(name)
            at = slice(first, first + moved.size)
            z[at], mean[at] = mean[at], 0.0
        new = name not in self.layout.sessions and own.sizes.drift > SETTINGS.predictive_small_drift
        last = z[at].copy()
        for iteration in range(SETTINGS.predictive_iterations if new else 1):
            there = x.copy()
            there[moved] += drift[moved] * own.sizes.drift * z[at] if at.stop else 0.0
            try:
                shown, residual = show(there)
            except CutvibError:
                # No model drifts so far: it stays where it was.
                if iteration == 0:
                    raise
                z[at] = last
                break
            last = z[at].copy()
            chunks = list(Directions(problem, there, [shown], like=lay).chunks())
            if iteration < SETTINGS.predictive_iterations - 1 and new:
                matrix, pulled = own.precision.copy(), np.zeros(lay.size)
                for _, _, c, index, part in chunks:
                    flat = real_rows(part) * scale[index, None]
                    matrix[np.ix_(index, index)] += flat @ flat.T / own.sizes.noise
                    pulled[index] += flat @ (real_rows(residual[None, c])[0] - mean[index] @ flat) / own.sizes.noise
                pulled[at] -= z[at]
                z[at] += solved(matrix, pulled)[at]
                z[at] = np.clip(z[at], -SETTINGS.likelihood_farthest_drift, SETTINGS.likelihood_farthest_drift)
        out = np.empty(residual.shape[0])
        known = 0.0 if not new else float(z[at] @ z[at])
        drifts = []
        squares, count = known, 0
        together, drawn = own.precision.copy(), np.zeros(lay.size)
        for _, _, c, index, part in chunks:
            flat = real_rows(part) * scale[index, None]
            moving = (index >= lay.unknowns) & (index < lay.first_nominal)
            variance = shown.group.variance[0, c] / 2
            variance = np.where(np.isfinite(variance), variance, 0.0)
            drifts.append(
                float(np.mean(np.sum(np.abs(part[moving, 0] * scale[index[moving], None]) ** 2, axis=0) * variance))
            )
            r = real_rows(residual[None, c])[0] - mean[index] @ flat
            inner, pulled = own.precision.copy(), np.zeros(lay.size)
            gram = flat @ flat.T / own.sizes.noise
            inner[np.ix_(index, index)] += gram
            pulled[index] = flat @ r / own.sizes.noise
            together[np.ix_(index, index)] += gram
            drawn += pulled
            squares += float(r @ r) / own.sizes.noise
            count += r.size
            if new:
                pulled[at] -= z[at]
            gain = pulled @ solved(inner, pulled)
            out[c] = (r @ r / own.sizes.noise + known - gain) / r.size
        if new:
            drawn[at] -= z[at]
        squares -= float(drawn @ solved(together, drawn))
        wider = log_determinant(together) - log_determinant(own.precision) + count * float(np.log(own.sizes.noise))
        return Left(out, float(np.mean(drifts)), -0.5 * (squares + wider))
