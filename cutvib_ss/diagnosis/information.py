"""
What a planned campaign's records would hold of a cause: its small change of the responses, less what tuning and calibration could
make of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize

from cutvib_ss.diagnosis.layout import Sizes, deviations
from cutvib_ss.diagnosis.prediction import Prediction
from cutvib_ss.diagnosis.records import Group, merged
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.severity import Run
from cutvib_ss.diagnosis.simulated import simulated
from cutvib_ss.diagnosis.unknowns import calibration_shapes, parts_among, tuning_paths
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.model.paths import value_at
from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.results.arrays import position_at


@dataclass(frozen=True)
class Seen:
    """A shape of a cause at the severity that is just seen."""

    run: Run  # The shape
    severity: float  # The severity
    gain: float  # χ² that a fit with it would gain there
    atom: FloatArray  # Weighted small change of the responses, real parts then imaginary

    @property
    def value(self) -> float:
        """The parameter that tells the severity."""
        return float(getattr(self.run.at(self.severity), self.run.head))

    @property
    def size(self) -> float:
        """How strong it is, comparable between shapes."""
        return self.run.size(self.severity)


class Space:
    """Changes of planned responses, less what tuning and calibration could make of them."""

    def __init__(self, model: Model, group: Group, error: float) -> None:
        self.model, self.group = model, group
        (self.sites,) = merged([same[0] for same in group.entries])
        at = {position_at(y): k for k, y in enumerate(self.sites.positions)}
        self.row = np.array([at[position_at(y)] for y in group.positions])
        shown = Prediction(model, self.sites)
        self.plain = shown.data
        self.peak = np.abs(self.plain).max(axis=(0, 2))
        # An error that is smooth over frequency is no smaller for being seen on many lines.
        alike = max(1.0, SETTINGS.seen_smooth / float(group.freq[1] - group.freq[0]))
        self.weight = np.sqrt(2.0 / (group.variance + alike * (error * np.abs(self.plain[self.row])) ** 2))
        tuning = tuning_paths(model)
        # Errors of a structure's parts have no size before they are measured: that from which fits start.
        known = deviations(parts_among(model, tuning), len(tuning), Sizes())
        columns = [
            std * tolerance * value_at(model, path) * shown.derivative(((path, 1.0),))
            for std, (path, tolerance) in zip(known, tuning, strict=True)
        ]
        calibration = model.tolerance.calibration
        band = (float(group.freq[0]), float(group.freq[-1]))
        for c in range(len(group.channels)):
            for part in (1.0, 1j):
                for shape in calibration_shapes(
                    group.freq, band, SETTINGS.calibration_shapes if calibration > 0 else 0
                ):
                    column = np.zeros_like(self.plain)
                    column[:, c] = part * calibration * shape * self.plain[:, c]
                    columns.append(column)
        self.nuisance = np.array([self._flat(c[self.row]) for c in columns])
        self.matrix = self.nuisance @ self.nuisance.T + np.eye(len(columns))
        self.inverse = np.linalg.inv(self.matrix)
        self.still: ComplexArray | None = None

    def _flat(self, change: np.ndarray) -> FloatArray:
        weighted = (self.weight * change).ravel()
        return np.concatenate([weighted.real, weighted.imag])

    def change(self, run: Run, severity: float) -> ComplexArray:
        """Change of the responses at a severity."""
        effect = run.at(severity)
        model = effect.apply(self.model)
        if effect.linear:
            out: ComplexArray = (Prediction(model, self.sites).data - self.plain)[self.row]
            return out
        if self.still is None:
            self.still = simulated(self.model, self.group).data
        # Against a simulation without it, so that the stepping's error is in both.
        shown: ComplexArray = simulated(model, self.group).data - self.still
        return shown

    def gram(self, atoms: Sequence[FloatArray]) -> FloatArray:
        """Inner products of changes, the nuisances projected out."""
        stack = np.array(atoms)
        with_nuisance = stack @ self.nuisance.T
        product: FloatArray = stack @ stack.T - with_nuisance @ self.inverse @ with_nuisance.T
        return product

    def seen(self, run: Run, threshold: float) -> Seen | None:
        """The severity that is just seen."""
        try:
            severity, change = self._small(run)
        except CutvibError:
            return None
        atom = self._flat(change)
        with_nuisance = self.nuisance @ atom
        hidden = self.inverse @ with_nuisance
        plain = float(atom @ atom)
        gain = plain - float(with_nuisance @ hidden)
        if not np.isfinite(gain) or gain <= 0.0:
            return None
        if run.whole:
            return Seen(run, 1.0, gain, atom) if gain / 2 >= threshold else None
        factor = float(np.sqrt(2 * threshold / gain))
        low = SETTINGS.fit_within / max(float(np.abs(hidden).max()), 1e-12)
        if low < factor:
            # Tuning comes to its bounds first, and what is beyond shows.
            factor = self._bounded(with_nuisance, plain, threshold, low, factor)
        if not run.believable(severity * factor):
            return None
        return Seen(run, severity * factor, gain * factor**2, atom)

    def _bounded(self, with_nuisance: FloatArray, plain: float, threshold: float, low: float, high: float) -> float:
        """Multiple of a change at which half of its gain is the threshold, the nuisances within their bounds."""
        root = np.linalg.cholesky(self.matrix)
        target = linalg.solve_triangular(root, with_nuisance, lower=True)

        def excess(log_factor: float) -> float:
            factor = float(np.exp(log_factor))
            found = optimize.lsq_linear(root.T, factor * target, (-SETTINGS.fit_within, SETTINGS.fit_within), tol=1e-8)
            return factor**2 * (plain - float(target @ target)) + 2 * float(found.cost) - 2 * threshold

        if excess(np.log(low)) >= 0.0:
            return low
        if excess(np.log(high)) <= 0.0:
            # Bounds can only add to the gain: less is rounding, of a change that tuning all but makes.
            return high
        return float(np.exp(optimize.brentq(excess, np.log(low), np.log(high), xtol=0.02)))

    def _small(self, run: Run) -> tuple[float, ComplexArray]:
        severity, change = 1.0, self.change(run, 1.0)
        small = SETTINGS.seen_small if run.effect.linear else SETTINGS.seen_small_law
        for _ in range(0 if run.whole else SETTINGS.seen_steps):
            ratio = float((np.abs(change).max(axis=(0, 2)) / self.peak).max())
            if ratio <= small:
                break
            severity *= small / (2 * ratio)
            change = self.change(run, severity)
        return severity, change


def left_over(gram: FloatArray, mine: int, theirs: Sequence[int], most: int) -> float:
    """Residual of a change after the best fit of another cause."""
    chosen: list[int] = []
    left = float(gram[mine, mine])
    for _ in range(min(most, len(theirs))):
        best = (left, -1)
        for k in theirs:
            if k in chosen:
                continue
            index = [*chosen, k]
            inner = gram[np.ix_(index, index)]
            size = np.sqrt(np.diag(inner))
            cross = gram[mine, index] / size
            fitted = np.linalg.lstsq(inner / np.outer(size, size), cross, rcond=1e-9)[0]
            remaining = float(gram[mine, mine] - cross @ fitted)
            if remaining < best[0]:
                best = (remaining, k)
        if best[1] < 0:
            break
        left = best[0]
        chosen.append(best[1])
    return max(left, 0.0)
