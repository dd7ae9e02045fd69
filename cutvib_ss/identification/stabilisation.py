"""Poles of a measured response for models of growing order: least-squares complex frequency domain, and which poles stay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cutvib_ss.errors import IdentificationError, ParameterError
from cutvib_ss.results import ComplexArray, FloatArray, FrequencyResponse, MeasuredFrequencyResponse
from cutvib_ss.results.display import Drawn, Table, data_frame

_ARC = 0.92
"""Part of the unit circle that the band covers: over all of it the ends of the band would have to join."""
_MOST_DAMPED = 0.2
"""Poles of a larger damping ratio are no modes of a structure."""


@dataclass(frozen=True, repr=False)
class Stabilisation(Drawn):
    """
    Poles by model order, and how far each agrees with one of the order before.

    Parameters
    ----------
    order : ndarray of int, shape (pole,)
        Model order that gave the pole.
    natural_freq : ndarray, shape (pole,)
        Natural frequency [Hz].
    damping_ratio : ndarray, shape (pole,)
        Damping ratio [-].
    stable : ndarray of int, shape (pole,)
        0: new at this order; 1: its frequency was there at the order before; 2: frequency and damping were.
    freq, modulus : ndarray, shape (frequency,)
        Frequencies [Hz], and the mean over outputs of the modulus, each over its root mean square.
    position : float
        y_b / L of the head; NaN without one.
    """

    order: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
    natural_freq: FloatArray
    damping_ratio: FloatArray
    stable: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
    freq: FloatArray
    modulus: FloatArray
    position: float = float("nan")

    def columns(self, fewest: int = 5) -> tuple[tuple[float, float, int], ...]:
        """
        Poles that stay: median natural frequency [Hz], median damping ratio, and number of orders, of each column of the diagram.

        Parameters
        ----------
        fewest : int
            Orders at which a pole has to be stable in frequency and damping.

        Returns
        -------
        tuple of (float, float, int)
            In ascending frequency.
        """
        kept = np.flatnonzero(self.stable == 2)
        kept = kept[np.argsort(self.natural_freq[kept])]
        if not kept.size:
            return ()
        # A column ends where the next frequency is further away than the tolerance within which poles count as the same.
        breaks = np.flatnonzero(np.diff(self.natural_freq[kept]) > 0.01 * self.natural_freq[kept][1:]) + 1
        return tuple(
            (
                float(np.median(self.natural_freq[c])),
                float(np.median(self.damping_ratio[c])),
                int(np.unique(self.order[c]).size),
            )
            for c in np.split(kept, breaks)
            if np.unique(self.order[c]).size >= fewest
        )

    def to_dataframe(self) -> Any:
        """
        The poles as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each pole, from 1: order of the model, natural frequency [Hz], damping ratio, and how far it is stable
            (0, 1 or 2).
        """
        columns = {
            "order": self.order,
            "natural_freq [Hz]": self.natural_freq,
            "damping_ratio": self.damping_ratio,
            "stable": self.stable,
        }
        return data_frame(columns, "pole", range(1, self.order.size + 1))

    def _table(self) -> Table:
        rows = [(f"{f:.2f}", f"{100 * ratio:.3f}", f"{orders}") for f, ratio, orders in self.columns()]
        place = "" if np.isnan(self.position) else f" at y/L = {self.position:.4g}"
        title = f"{len(rows)} poles that stay{place}, of models up to order {self.order.max(initial=0)}"
        return Table(title, ("frequency [Hz]", "damping [%]", "orders"), rows)


def stabilisation(
    frf: FrequencyResponse,
    *,
    position: float | None = None,
    band: tuple[float, float] | None = None,
    highest_order: int = 40,
    freq_tolerance: float = 0.01,
    damping_tolerance: float = 0.1,
) -> Stabilisation:
    """
    Stabilisation diagram of a response: poles of common-denominator models of order 2 to ``highest_order``.

    Parameters
    ----------
    frf : FrequencyResponse
        Responses at evenly spaced frequencies; of a measured one, lines weigh by their variance.
    position : float, optional
        Which position y_b / L, where there are several.
    band : (float, float), optional
        Lines to use [Hz]; all by default.
    highest_order : int
        Highest order of the denominator; one pole is one order, for the band is one-sided.
    freq_tolerance, damping_tolerance : float
        Relative differences from the order before, up to which a pole is the same in frequency and in damping.

    Returns
    -------
    Stabilisation
        Stable poles inside of the band alone.

    Raises
    ------
    ParameterError
        If there are several positions and none is chosen, or the band or order is none.
    IdentificationError
        If the frequencies are not even or too few.

    Notes
    -----
    With the band mapped on the unit circle, z = exp(jωT), each response is B_k(z) / A(z). Multiplied by A the error is
    linear in both; elimination of every B_k leaves the normal equations of A alone (Verboven, thesis, VUB 2002,
    Eq. 5.26). Coefficients are complex, for the band has no mirror image. The coefficient of z⁰ is held at one:
    poles that the data do not ask for then come out unstable and are left out (Cauberghe, Guillaume, Verboven et al.,
    Mech. Syst. Signal Process. 18, 2004).
    """
    chosen = frf if position is None else frf.sel(position=position)
    if chosen.positions.size > 1:
        raise ParameterError(f"choose one of the positions {chosen.positions.tolist()}")
    low, high = (0.0, np.inf) if band is None else band
    if not 0.0 <= low < high or highest_order < 2:
        raise ParameterError(
            f"band = {band}, highest_order = {highest_order}: needs 0 <= low < high, and an order of at least 2"
        )
    used = np.flatnonzero((chosen.freq >= low) & (chosen.freq <= high) & (chosen.freq > 0))
    freq = chosen.freq[used]
    if used.size < 2 * highest_order:
        raise IdentificationError(
            f"{used.size} frequencies from {low:g} to {high:g} Hz are too few for order {highest_order}; "
            "take a lower order or a wider band"
        )
    steps = np.diff(freq)
    if np.ptp(steps) > 1e-3 * steps.mean():
        raise IdentificationError("the frequencies are not evenly spaced; a stabilisation diagram needs them so")
    rows = chosen.data[0][..., used].reshape(-1, used.size)
    scale = np.sqrt(np.mean(np.abs(rows) ** 2, axis=-1, keepdims=True))
    weight = 1.0 / scale * np.ones_like(freq)
    if isinstance(chosen, MeasuredFrequencyResponse):
        deviation = np.sqrt(chosen.variance[0][..., used].reshape(-1, used.size))
        weight = 1.0 / np.maximum(deviation, 1e-3 * scale)
    equations = _equations(rows, weight, highest_order)
    span = (freq[-1] - freq[0]) / _ARC
    found: list[tuple[int, float, float, int]] = []
    before = np.empty(0, complex)
    for n in range(2, highest_order + 1):
        poles = _poles(equations, n, freq[0], span)
        # Of a resonance at least half lies in the band: what only its end asks for is no mode.
        room = np.minimum(poles.imag - 2 * np.pi * freq[0], 2 * np.pi * freq[-1] - poles.imag)
        poles = poles[room >= -poles.real]
        for p in poles:
            found.append(
                (n, abs(p) / (2 * np.pi), -p.real / abs(p), _agreement(p, before, freq_tolerance, damping_tolerance))
            )
        before = poles
    order, natural, damping, stable = (np.array(c) for c in zip(*found, strict=True)) if found else (np.empty(0),) * 4
    return Stabilisation(
        order.astype(np.int64), natural.astype(float), damping.astype(float), stable.astype(np.int64), freq,
        np.mean(np.abs(rows) / scale, axis=0), float(chosen.positions[0]),
    )  # fmt: skip


def _equations(rows: ComplexArray, weight: FloatArray, order: int) -> list[tuple[ComplexArray, ComplexArray]]:
    """Of each response the columns of B and of A at the highest order, weighted; a lower order takes the first of them."""
    powers = np.exp(2j * np.pi * _ARC * np.outer(np.linspace(0.0, 1.0, rows.shape[1]), np.arange(order + 1)))
    return [(w[:, None] * powers, -(w * h)[:, None] * powers) for h, w in zip(rows, weight, strict=True)]


def _poles(equations: list[tuple[ComplexArray, ComplexArray]], n: int, start: float, span: float) -> ComplexArray:
    """Poles [rad/s] of the model of one order, those that are stable and no more than well damped."""
    total = np.zeros((n + 1, n + 1), complex)
    for of_b, of_a in equations:
        q, _ = np.linalg.qr(of_b[:, : n + 1])
        denominator = of_a[:, : n + 1]
        rest = denominator - q @ (q.conj().T @ denominator)
        total += rest.conj().T @ rest
    a = np.concatenate([[1.0], np.linalg.lstsq(total[1:, 1:], -total[1:, 0], rcond=None)[0]])
    z = np.roots(a[::-1])
    z = z[np.abs(z) > 0]
    # z = exp(s T) with T = 1 / span, from the lower end of the band on.
    turn = np.angle(z) % (2 * np.pi)
    s = span * np.log(np.abs(z)) + 1j * (span * turn + 2 * np.pi * start)
    kept: ComplexArray = s[(s.real < 0) & (-s.real < _MOST_DAMPED * np.abs(s))]
    return kept


def _agreement(pole: complex, before: ComplexArray, freq_tolerance: float, damping_tolerance: float) -> int:
    """Whether a pole was there at the order before: 0 no, 1 in frequency, 2 in frequency and damping."""
    if not before.size:
        return 0
    nearest = before[np.argmin(np.abs(np.abs(before) - abs(pole)))]
    if abs(abs(nearest) - abs(pole)) > freq_tolerance * abs(pole):
        return 0
    damping, other = -pole.real / abs(pole), -nearest.real / abs(nearest)
    return 2 if abs(damping - other) <= damping_tolerance * damping else 1
