"""
Margins of a loop: disk margin from a norm, gain, phase and delay margin from its crossings.

Of a loop with several commands the classical margins are taken one loop at a time, the others closed; the disk margin holds for
all at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import control
import numpy as np
from scipy import optimize

from cutvib_ss.control_design.loop import in_rad_per_s
from cutvib_ss.control_design.norms import peak_gain
from cutvib_ss.results import ComplexArray, FloatArray

_AROUND = np.array([-30.0, -8.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 8.0, 30.0])
"""Where a resonance is looked at, in half-widths from its centre."""
_DEFECTIVE = 1e9
"""Condition of the eigenvectors from which the sum over modes loses too many digits."""


@dataclass(frozen=True)
class Margins:
    """
    How far a stable loop is from instability.

    Parameters
    ----------
    disk : float
        α of the balanced disk margin, 0 to 2.
    gain_up, gain_down : float
        Factors on the loop's gain that it bears, above and below one; infinite and zero where no factor is too much.
    phase : float
        Phase that it bears, either way [°]; infinite where the gain never crosses one.
    delay : float
        Further delay that it bears [s]; infinite likewise.
    """

    disk: float
    gain_up: float
    gain_down: float
    phase: float
    delay: float

    @property
    def gain(self) -> float:
        """The smaller of the two gain margins [dB]."""
        up = 20 * np.log10(self.gain_up)
        return float(min(up, -20 * np.log10(self.gain_down)) if self.gain_down > 0 else up)


def disk_margin(gain: control.StateSpace) -> float:
    """
    Balanced disk margin of a stable loop.

    Parameters
    ----------
    gain : control.StateSpace
        Loop transfer L, with negative feedback.

    Returns
    -------
    float
        α = 1/‖S - I/2‖∞ with S = (I + L)⁻¹.

    Notes
    -----
    Seiler, Packard and Gahinet, An introduction to disk margins, IEEE Control Systems 40(5), 2020: the loop stays stable as long
    as gain and phase at the command change by a factor within the disk of diameter (1 - α/2)/(1 + α/2) to its inverse. The
    norm comes from a Hamiltonian (SLICOT AB13DD), so that no grid can miss a sharp peak, as `control.disk_margins` may. For
    several commands at once it is a lower bound.
    """
    eye = control.ss([], [], [], np.eye(gain.noutputs), gain.dt)
    difference = eye.feedback(gain) - 0.5 * eye
    return 1.0 / peak_gain(difference)


def margins(gain: control.StateSpace, poles: ComplexArray) -> Margins:
    """
    Margins of a stable loop.

    Parameters
    ----------
    gain : control.StateSpace
        Loop transfer L, with negative feedback, continuous or sampled.
    poles : ndarray of complex, shape (pole,)
        Poles of the closed loop [rad/s], for the grid on which crossings are sought.

    Returns
    -------
    Margins
        Worst over all commands and crossings.

    Notes
    -----
    In state space throughout: `control.stability_margins` goes through polynomials, which lightly damped plants of fifty
    states do not survive.
    """
    period = float(gain.dt or 0.0)
    mine = np.asarray(gain.poles(), dtype=np.complex128)
    grid = _grid(np.concatenate([in_rad_per_s(mine, period) if period else mine, poles]), period)
    transfer, direct = _Transfer(gain), _Transfer(control.ss([], [], [], gain.D))
    up, down, phase, delay = np.inf, 0.0, np.inf, np.inf
    for k in range(gain.noutputs):
        values = _one_loop(transfer, grid, k)

        def at(w: float, k: int = k) -> complex:
            return complex(_one_loop(transfer, np.array([w]), k)[0])

        crossed = [at(w).real for w in _crossings(lambda w: at(w).imag, grid, values.imag)]
        # At rest, and at the last frequency, the transfer is real without crossing anything.
        fast = at(np.pi / period) if period else complex(_one_loop(direct, np.zeros(1), k)[0])
        for real in [*crossed, at(0.0).real, fast.real]:
            if np.isfinite(real) and real < 0.0:
                up, down = (min(up, -1 / real), down) if real > -1.0 else (up, max(down, -1 / real))
        for w in _crossings(lambda w: abs(at(w)) - 1.0, grid, np.abs(values) - 1.0):
            # How far the phase lies above -180 degrees: lag uses it up, lead uses up the rest of the turn.
            lag = float(np.mod(np.angle(at(w)) + np.pi, 2 * np.pi))
            phase = min(phase, np.degrees(min(lag, 2 * np.pi - lag)))
            delay = min(delay, lag / w)
    return Margins(disk_margin(gain), up, down, phase, delay)


class _Transfer:
    """A loop transfer on the imaginary axis, or the unit circle, by its modes."""

    def __init__(self, gain: control.StateSpace) -> None:
        self.gain = gain
        # A crossing takes some twenty single frequencies, for each of which SLICOT would balance and reduce A anew.
        values, vectors = (np.asarray(part, dtype=np.complex128) for part in np.linalg.eig(gain.A))
        self.modes: tuple[ComplexArray, ComplexArray, ComplexArray] | None = None
        if not gain.nstates or np.linalg.cond(vectors) < _DEFECTIVE:
            right = np.asarray(np.linalg.solve(vectors, gain.B), dtype=np.complex128)
            self.modes = values, np.asarray(gain.C @ vectors, dtype=np.complex128), right

    def __call__(self, omega: FloatArray) -> ComplexArray:
        """Values, shape (frequency, output, input)."""
        at = np.exp(1j * omega * self.gain.dt) if self.gain.dt else 1j * omega
        if self.modes is None:
            return np.moveaxis(np.asarray(self.gain(at, squeeze=False, warn_infinite=False)), -1, 0)
        poles, left, right = self.modes
        with np.errstate(divide="ignore", invalid="ignore"):
            out: ComplexArray = (left / (at[:, None, None] - poles)) @ right + self.gain.D
        return out


def _one_loop(gain: _Transfer, omega: FloatArray, k: int) -> ComplexArray:
    """Loop transfer at one command, the other loops closed."""
    values = gain(omega)
    n = values.shape[1]
    others = [i for i in range(n) if i != k]
    out: ComplexArray = values[:, k, k]
    if others:
        inner = np.eye(n - 1) + values[:, others][:, :, others]
        out = out - (values[:, [k]][:, :, others] @ np.linalg.solve(inner, values[:, others][:, :, [k]]))[:, 0, 0]
    return out


def _grid(poles: ComplexArray, period: float) -> FloatArray:
    top = np.pi / period if period else 10 * float(np.abs(poles).max(initial=1.0))
    low = min(1.0, 1e-3 * top)
    poles = poles[(poles.imag > 0) & (poles.imag < top)]
    fine = (poles.imag[:, None] + np.abs(poles.real)[:, None] * _AROUND).ravel()
    grid = np.concatenate([np.geomspace(low, top * (1 - 1e-6), 200), fine])
    return np.unique(grid[(grid >= low) & (grid < top)])


def _crossings(function: Callable[[float], float], grid: FloatArray, values: FloatArray) -> list[float]:
    hits = np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:]))
    return [float(optimize.brentq(function, grid[i], grid[i + 1], rtol=1e-12)) for i in hits]
