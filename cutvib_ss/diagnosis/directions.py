"""
Low-rank Gaussian directions of the residual: repeatability, discrepancy, modes that are left out, and what a hand's hits do.

Each is a column over all data beside the unknowns; `likelihood` says what they stand for, and integrates them out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.diagnosis.discrepancy import cause_weights, features, pivots_of, shapes_over, smooth_shapes, weights
from cutvib_ss.diagnosis.form_errors import Form
from cutvib_ss.diagnosis.hit_errors import taken_in
from cutvib_ss.diagnosis.layout import Layout
from cutvib_ss.diagnosis.normal_matrix import Alike, Columns, add_products
from cutvib_ss.diagnosis.records import Entry, session_of
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.units import DERIVATIVE_ORDER

if TYPE_CHECKING:
    from cutvib_ss.diagnosis.prediction import Predicted
    from cutvib_ss.diagnosis.problem import Problem


class Curvature(NamedTuple):
    """What a discrepancy adds, weighted, of each group of records."""

    shared: list[ComplexArray]  # To the derivatives to the unknowns that move every channel
    plain: list[ComplexArray]  # To the prediction


class Directions:
    """
    Unit directions of drift and discrepancy of a problem's records, at one set of unknowns.

    Every direction is a row of the problem's Jacobian, or the prediction itself, times a smooth real function.
    """

    def __init__(
        self,
        problem: Problem,
        x: FloatArray | Sequence[FloatArray],
        predictions: Sequence[Predicted],
        spread: bool = True,
        like: Layout | None = None,
        form: tuple[Form, Mapping[int, ComplexArray]] = ((), {}),
    ) -> None:
        self.problem, self.form_errors, self.groups = problem, form[1], [p.group for p in predictions]
        band = problem.band
        self.smooth = [smooth_shapes(g.freq, band) for g in self.groups]
        self.drift, self.nominal = drift, nominal = weights(problem)
        each = [x] * len(predictions) if isinstance(x, np.ndarray) else list(x)
        self.cause = cause_weights(problem, each[0])
        hits = tuple(sorted({key for g in self.groups for row in g.hits for key in row})) if spread else ()
        self.layout = like or Layout(
            problem.size,
            problem.sessions if spread else (),
            problem.channels,
            tuple(np.flatnonzero(drift).tolist()),
            tuple(np.flatnonzero(nominal).tolist()) if spread else (),
            pivots_of(problem) if spread and np.any(self.cause) else (),
            self.smooth[0].shape[0],
            problem.drifting_within if spread else (),
            cause_drifts=bool(spread and np.any(self.cause)),
            hits=hits,
            errors=taken_in(self.groups, hits),
            parts=problem.parts,
            residual_modes=problem.residual_modes if spread else (),
            form=form[0] if spread else (),
        )
        self.shared = [problem.jacobian(own, p) for own, p in zip(each, predictions, strict=True)]
        self.plain = [p.data * g.weight for p, g in zip(predictions, self.groups, strict=True)]

    def chunks(self) -> Iterator[tuple[int, np.ndarray, int, np.ndarray, ComplexArray]]:
        """Group, its rows of one session, channel, columns, and the weighted directions there (column, row, frequency)."""
        lay, problem = self.layout, self.problem
        shapes = lay.shapes
        own_nominal = lay.first_nominal + np.arange(2 * shapes * len(lay.nominal))
        for i, (g, shared) in enumerate(zip(self.groups, self.shared, strict=True)):
            calibration = problem.calibration * problem.shapes_at(g.freq)
            names = [session_of(same[0]) for same in g.entries]
            # Records that drift by themselves are taken one by one.
            members = [(name, same[0].record) for name, same in zip(names, g.entries, strict=True)]
            keys = members if lay.records else [(name, -1) for name in names]
            count = len(calibration)
            cause = np.tensordot(self.cause, shared[len(shared) - len(self.cause) :], 1) if lay.pivots else None
            for name, record in dict.fromkeys(keys):
                rows = np.array([k for k, other in enumerate(keys) if other == (name, record)])
                firsts = []
                if name in lay.sessions:
                    firsts.append(lay.unknowns + lay.per_session * lay.sessions.index(name))
                if record in lay.records:
                    firsts.append(lay.first_within + lay.per_session * lay.records.index(record))
                for c, channel in enumerate(g.channels):
                    index, parts = [problem.shared], [shared[:, rows, c]]
                    if channel in problem.channels and count:
                        index.append(problem.own(channel, count))
                        # A calibration error multiplies the prediction itself.
                        real = calibration[:, None] * self.plain[i][rows, c]
                        parts.append(np.concatenate([real, 1j * real]))
                    for first in firsts:
                        moved = np.array(lay.drifting, dtype=int)
                        index.append(first + np.arange(moved.size))
                        parts.append(self.drift[moved, None, None] * shared[moved][:, rows, c])
                        if channel in lay.channels:
                            gain = first + moved.size + 2 * lay.channels.index(channel)
                            index.append(np.array([gain, gain + 1]))
                            parts.append(np.array([1.0, 1j])[:, None, None] * self.plain[i][rows, c])
                        if lay.cause_drifts and cause is not None:
                            index.append(np.array([first + lay.per_session - 1]))
                            parts.append(cause[None, rows, c])
                    if lay.nominal:
                        moved = np.array(lay.nominal)
                        index.append(own_nominal)
                        parts.append(self._smoothed(self.nominal[moved, None, None] * shared[moved][:, rows, c], i))
                    if cause is not None:
                        own_shapes = self.of_cause(i, rows)
                        real = own_shapes.swapaxes(0, 1) * cause[rows, c]
                        index.append(lay.first_cause + np.arange(2 * len(lay.pivots)))
                        parts.append(np.concatenate([real, 1j * real]))
                    added: dict[int, ComplexArray] = {}
                    for j, row in enumerate(rows.tolist()):
                        for column, shown in self._added(i, row):
                            if shown[c].any():
                                empty = np.zeros((len(rows), g.freq.size), dtype=np.complex128)
                                added.setdefault(column, empty)[j] = shown[c]
                    if added:
                        index.append(np.array(list(added)))
                        parts.append(np.array(list(added.values())))
                    yield i, rows, c, np.concatenate(index), np.concatenate(parts)

    def of_cause(self, group: int, rows: np.ndarray) -> FloatArray:
        """Shapes of the cause's discrepancy at some rows of a group, shape (row, shape, frequency)."""
        g = self.groups[group]
        return np.array([shapes_over(self.layout.pivots, *features(g, k, self.problem)) for k in rows.tolist()])

    def _smoothed(self, rows: ComplexArray, group: int) -> ComplexArray:
        """Rows times each smooth shape, real and imaginary, shape (row · 2 shape, position, frequency)."""
        real = rows[:, None] * self.smooth[group][:, None, :]
        return np.stack([real, 1j * real], axis=1).reshape(-1, *rows.shape[1:])

    def normal(
        self, residuals: Sequence[ComplexArray], curvature: Curvature | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Normal matrix and gradient of the data in all columns, at unit sizes; with what a discrepancy adds to derivatives."""
        size, shared = self.layout.size, self.problem.shared
        # Behind the columns the residual, one more for what has none, and what is added to derivatives.
        beside = size + 2 + np.arange(0 if curvature is None else shared.size)
        matrix = np.zeros((size + 2 + beside.size, size + 2 + beside.size))
        alike: dict[tuple[object, ...], list[int]] = {}
        for i, g in enumerate(self.groups):
            alike.setdefault((g.channels, g.freq.tobytes()), []).append(i)
        for which in alike.values():
            add_products(matrix, self._alike(which, residuals, curvature), self._columns(which, beside))
        if beside.size:
            matrix[shared] += matrix[beside]
            matrix[:, shared] += matrix[:, beside]
        return matrix[:size, :size], matrix[:size, size]

    def _alike(self, which: Sequence[int], residuals: Sequence[ComplexArray], curvature: Curvature | None) -> Alike:
        """Groups on the same lines and channels together."""
        lay, first = self.layout, which[0]
        shared = np.concatenate([self.shared[i] for i in which], axis=1)
        plain = np.concatenate([self.plain[i] for i in which])
        of_cause, cause = np.zeros((1, 0, plain.shape[-1])), None
        if lay.pivots:
            cause = np.tensordot(self.cause, shared[len(shared) - len(self.cause) :], 1)
            shapes = [self.of_cause(i, np.arange(len(self.groups[i].data))) for i in which]
            of_cause = np.concatenate(shapes)
            if np.array_equal(of_cause, np.broadcast_to(of_cause[:1], of_cause.shape)):
                of_cause = of_cause[:1]
        if curvature is not None:
            shared = np.concatenate([shared, np.concatenate([curvature.shared[i] for i in which], axis=1)])
            plain = plain + np.concatenate([curvature.plain[i] for i in which])
        return Alike(
            shared=shared,
            residual=np.concatenate([residuals[i] for i in which]),
            cause=cause,
            plain=plain,
            added=[[shown for _, shown in self._added(i, row)] for i, row in self._rows_of(which)],
            calibration=self.problem.calibration * self.problem.shapes_at(self.groups[first].freq),
            smooth=self.smooth[first],
            of_cause=of_cause,
            nominal=[(k, float(self.nominal[k])) for k in lay.nominal],
        )

    def _columns(self, which: Sequence[int], beside: NDArray[np.intp]) -> Columns:
        """Where the products of their columns go."""
        lay, problem, channels = self.layout, self.problem, self.groups[which[0]].channels
        most, n = max(len(self._added(i, row)) for i, row in self._rows_of(which)), len(problem.shared) + beside.size
        first_added = n + 1 + bool(lay.pivots)
        plain = first_added + most
        moved = np.array(lay.drifting, dtype=int)
        gains = [(lay.channels.index(name), c) for c, name in enumerate(channels) if name in lay.channels]
        # Drift of a session, or of a record: columns from its first one, atoms, and weights.
        at = [*range(moved.size), *(moved.size + 2 * k + turned for k, _ in gains for turned in (0, 1))]
        of = [*moved.tolist(), *(plain + c + turned * len(channels) for _, c in gains for turned in (0, 1))]
        weight = [*self.drift[moved].tolist(), *[1.0] * (2 * len(gains))]
        if lay.cause_drifts and lay.pivots:
            at, of, weight = [*at, lay.per_session - 1], [*of, n + 1], [*weight, 1.0]
        of_one = []
        for i, row in self._rows_of(which):
            added = [column for column, _ in self._added(i, row)]
            firsts = self._drifts_of(i, row)
            index = [
                *problem.shared.tolist(),
                *beside.tolist(),
                lay.size,
                *(first + k for first in firsts for k in at),
                *added,
            ]
            atoms = [*range(n + 1), *of * len(firsts), *range(first_added, first_added + len(added))]
            weights = [*[1.0] * (n + 1), *weight * len(firsts), *[1.0] * len(added)]
            of_one.append((np.array(index), np.array(atoms), np.array(weights)))
        shapes = len(problem.shapes_at(self.groups[which[0]].freq))
        own = [
            problem.own(name, shapes) if name in problem.channels else np.full(2 * shapes, lay.size + 1)
            for name in channels
        ]
        return Columns(of_one, np.concatenate([*own, np.arange(lay.first_nominal, lay.first_form)]))

    def _rows_of(self, which: Sequence[int]) -> list[tuple[int, int]]:
        """Rows of some groups."""
        return [(i, row) for i in which for row in range(len(self.groups[i].data))]

    def _drifts_of(self, group: int, row: int) -> list[int]:
        """First columns of the drift of a row's session and record."""
        lay, entry = self.layout, self.groups[group].entries[row][0]
        name, out = session_of(entry), []
        if name in lay.sessions:
            out.append(lay.unknowns + lay.per_session * lay.sessions.index(name))
        if entry.record in lay.records:
            out.append(lay.first_within + lay.per_session * lay.records.index(entry.record))
        return out

    def _added(self, group: int, row: int) -> list[tuple[int, ComplexArray]]:
        """What is added to a row by errors of form, residual modes and its hits: columns, and shapes (channel, frequency)."""
        if (group, row) not in self._found:
            lay, g = self.layout, self.groups[group]
            hits = g.hits[row] if g.hits else {}
            own = [(lay.first_hit + lay.hits.index(key), shown) for key, shown in hits.items() if key in lay.hits]
            for k, mode in enumerate(lay.residual_modes):
                if mode.input == g.inputs[row] and mode.channel in g.channels:
                    c = g.channels.index(mode.channel)
                    shown = np.zeros(g.data.shape[1:], dtype=np.complex128)
                    shown[c] = mode.receptance(g.freq) * (2j * np.pi * g.freq) ** DERIVATIVE_ORDER[g.quantities[c]]
                    own.append((lay.first_residual + k, shown))
            errors = self.form_errors.get(g.entries[row][0].record, ())
            own += [(lay.first_form + k, shown) for k, shown in enumerate(errors)]
            self._found[group, row] = [(column, shown * g.weight[row]) for column, shown in own]
        return self._found[group, row]

    @cached_property
    def _found(self) -> dict[tuple[int, int], list[tuple[int, ComplexArray]]]:
        return {}

    def correlation(self, residuals: Sequence[ComplexArray], coefficients: FloatArray, reduced: float) -> float:
        """
        How many residuals tell the same thing, the directions taken out with their coefficients; 1 where they are white.

        Along frequency that is the integrated correlation 1 + 2 Σ ρ, summed up to the first lag at which ρ does not stand out
        (Sokal 1997, on autocorrelation times). Beyond the noise as stated what is correlated along frequency is an error of the
        model, and all responses show the same one: 1 + 2 N Σ ρ, with N the number of responses, as if they were one cluster (Liang
        and Zeger 1986). So does what the steps of a converter make of the noise. Else noise is each response's own. `reduced` is χ²
        a datum against the noise as stated.
        """
        sums: dict[int, float] = {}
        for i, rows, c, index, part in self.chunks():
            r = residuals[i][rows, c] - np.tensordot(coefficients[index], part, 1)
            for lag in range(min(SETTINGS.likelihood_most_lags, r.shape[-1] // 3)):
                power = float(np.sum((r[:, lag:] * r[:, : r.shape[-1] - lag].conj()).real))
                sums[lag] = sums.get(lag, 0.0) + power * r.shape[-1] / (r.shape[-1] - lag)
        count = sum(g.data.size for g in self.groups)
        responses = sum(g.data.shape[0] * g.data.shape[1] for g in self.groups)
        by_steps = _rounded_share([e for g in self.groups for same in g.entries for e in same])
        alike = 1.0 + (responses - 1.0) * max(1.0 - 1.0 / max(reduced, 1e-300), by_steps)
        total = 1.0
        for lag in range(1, len(sums)):
            rho = sums[lag] / max(sums[0], 1e-300)
            if rho < max(SETTINGS.likelihood_correlated, 2.0 / np.sqrt(count)):
                break
            total += 2.0 * alike * rho
        return total

    def flat(self) -> FloatArray:
        """All columns over all data, shape (column, datum): of each group the real parts, then the imaginary ones."""
        size = sum(g.data.size for g in self.groups)
        out = np.zeros((self.layout.size, 2 * size))
        offset = 0
        starts = []
        for g in self.groups:
            starts.append(offset)
            offset += 2 * g.data.size
        for i, rows, c, index, part in self.chunks():
            g = self.groups[i]
            at = np.arange(g.data.size).reshape(g.data.shape)[rows, c].ravel() + starts[i]
            values = part.reshape(len(part), -1)
            out[np.ix_(index, at)] = values.real
            out[np.ix_(index, at + g.data.size)] = values.imag
        return out


def real_rows(rows: ComplexArray) -> FloatArray:
    """Complex rows as real ones: products are real parts of inner products."""
    return np.ascontiguousarray(rows.reshape(len(rows), -1)).view(np.float64)


def _rounded_share(entries: Sequence[Entry]) -> float:
    """Share of their variance that the steps of converters make: of all data that tell something."""
    told = [e.rounded[e.precision > 0.0] if e.rounded is not None else np.zeros(e.count // 2) for e in entries]
    return float(np.mean(np.concatenate(told))) if any(share.size for share in told) else 0.0
