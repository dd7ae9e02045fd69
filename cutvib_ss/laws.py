"""
Nonlinear force laws at a port: what the element there resists with, as the port moves.

The force f acts against the motion. Laws that belong to a spring (freeplay, bilinear stiffness) are what has to be *added* to the
linear spring k of the model to give the real one, so that k is one of their parameters. Each law gives its force along a history,
its slopes, and its describing function: the complex dynamic stiffness of the fundamental of f under q = A cos ωt (Gelb and
Vander Velde, Multiple-Input Describing Functions, 1968). `cutvib_ss.response.compiled` holds the same laws for time stepping.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.results import ComplexArray, FloatArray

Force: TypeAlias = Callable[..., FloatArray]
Slopes: TypeAlias = Callable[..., tuple[FloatArray, FloatArray]]
Equivalent: TypeAlias = Callable[..., ComplexArray]


@dataclass(frozen=True)
class Law:
    """
    A law between a port's motion and the force against it.

    Parameters
    ----------
    name : str
        Id of the effect of the catalogue.
    units : mapping of str to str
        Names of the parameters, in the order in which functions take them, and units at a joint (N and m in place of N m and
        rad at a port that is a displacement).
    forces : callable
        ``forces(q, v, *values)``: force along histories, as `force`.
    slopes : callable
        ``slopes(q, v, *values)``: ∂f/∂q and ∂f/∂v, of the force's own branch where it has corners.
    stiffness : callable
        ``stiffness(amplitude, omega, *values)``: complex dynamic stiffness of the fundamental.
    moved_by : {"displacement", "velocity"}
        Which motion the force follows.
    memory : bool
        Whether the force depends on the motion's past.
    """

    name: str
    units: Mapping[str, str]
    forces: Force
    slopes: Slopes
    stiffness: Equivalent
    moved_by: Literal["displacement", "velocity"] = "displacement"
    memory: bool = False

    def force(self, q: ArrayLike, v: ArrayLike, *values: float) -> FloatArray:
        """
        Force along a history.

        Parameters
        ----------
        q, v : array_like, shape (..., sample)
            Displacement and velocity of the port; a law with memory starts unloaded at the first sample.
        *values : float
            Parameters, in the order of ``units``.

        Returns
        -------
        ndarray, shape (..., sample)
            Force against the motion.
        """
        return self.forces(np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64), *values)

    def equivalent(self, amplitude: ArrayLike, omega: ArrayLike, *values: float) -> tuple[FloatArray, FloatArray]:
        """
        Equivalent stiffness and damping at an amplitude: the describing function.

        Parameters
        ----------
        amplitude : array_like
            Amplitude of the port's displacement, greater than zero.
        omega : array_like
            Frequency [rad/s].
        *values : float
            Parameters, in the order of ``units``.

        Returns
        -------
        stiffness, damping : ndarray
            k and c of k + iωc, the fundamental of the force over the displacement.
        """
        omega = np.asarray(omega, dtype=np.float64)
        z = self.stiffness(np.asarray(amplitude, dtype=np.float64), omega, *values)
        return z.real.copy(), z.imag / omega


def _nothing(q: FloatArray) -> FloatArray:
    return np.zeros(q.shape)


# --- stiffness that is not straight -----------------------------------------------------------------------------------


def _cubic(q: FloatArray, v: FloatArray, stiffness3: float) -> FloatArray:
    return np.asarray(stiffness3 * q**3)


def _cubic_slopes(q: FloatArray, v: FloatArray, stiffness3: float) -> tuple[FloatArray, FloatArray]:
    return 3.0 * stiffness3 * q**2, _nothing(q)


def _cubic_stiffness(amplitude: FloatArray, omega: FloatArray, stiffness3: float) -> ComplexArray:
    return np.asarray(0.75 * stiffness3 * amplitude**2 + 0j * omega)


def _freeplay(q: FloatArray, v: FloatArray, gap: float, stiffness: float) -> FloatArray:
    return np.asarray(-stiffness * np.clip(q, -gap, gap))


def _freeplay_slopes(q: FloatArray, v: FloatArray, gap: float, stiffness: float) -> tuple[FloatArray, FloatArray]:
    return np.where(np.abs(q) < gap, -stiffness, 0.0), _nothing(q)


def _freeplay_stiffness(amplitude: FloatArray, omega: FloatArray, gap: float, stiffness: float) -> ComplexArray:
    ratio = np.minimum(gap / amplitude, 1.0)
    saturation = 2.0 / np.pi * (np.arcsin(ratio) + ratio * np.sqrt(1.0 - ratio**2))
    return np.asarray(-stiffness * saturation + 0j * omega)


def _bilinear(q: FloatArray, v: FloatArray, asymmetry: float, stiffness: float) -> FloatArray:
    return np.asarray(stiffness * asymmetry * np.abs(q))


def _bilinear_slopes(q: FloatArray, v: FloatArray, asymmetry: float, stiffness: float) -> tuple[FloatArray, FloatArray]:
    return stiffness * asymmetry * np.sign(q), _nothing(q)


def _bilinear_stiffness(amplitude: FloatArray, omega: FloatArray, asymmetry: float, stiffness: float) -> ComplexArray:
    # abs(cos) has a mean and even harmonics, and no fundamental.
    return np.asarray(0j * amplitude * omega)


# --- damping that is not straight -------------------------------------------------------------------------------------


def _friction(q: FloatArray, v: FloatArray, torque: float) -> FloatArray:
    return np.asarray(torque * np.sign(v))


def _friction_slopes(q: FloatArray, v: FloatArray, torque: float) -> tuple[FloatArray, FloatArray]:
    return _nothing(q), _nothing(q)


def _friction_stiffness(amplitude: FloatArray, omega: FloatArray, torque: float) -> ComplexArray:
    return np.asarray(4j * torque / (np.pi * amplitude) + 0.0 * omega)


def _quadratic(q: FloatArray, v: FloatArray, coefficient: float) -> FloatArray:
    return np.asarray(coefficient * v * np.abs(v))


def _quadratic_slopes(q: FloatArray, v: FloatArray, coefficient: float) -> tuple[FloatArray, FloatArray]:
    return _nothing(q), 2.0 * coefficient * np.abs(v)


def _quadratic_stiffness(amplitude: FloatArray, omega: FloatArray, coefficient: float) -> ComplexArray:
    return np.asarray(8j / (3.0 * np.pi) * coefficient * omega**2 * amplitude)


# --- slip -------------------------------------------------------------------------------------------------------------


def _slip(q: FloatArray, v: FloatArray, stiffness: float, slip_torque: float) -> FloatArray:
    force = np.zeros(q.shape)
    for k in range(1, q.shape[-1]):
        elastic = force[..., k - 1] + stiffness * (q[..., k] - q[..., k - 1])
        force[..., k] = np.clip(elastic, -slip_torque, slip_torque)
    return force


def _slip_slopes(q: FloatArray, v: FloatArray, stiffness: float, slip_torque: float) -> tuple[FloatArray, FloatArray]:
    sticks = np.abs(_slip(q, v, stiffness, slip_torque)) < slip_torque
    return np.where(sticks, stiffness, 0.0), _nothing(q)


def _slip_stiffness(amplitude: FloatArray, omega: FloatArray, stiffness: float, slip_torque: float) -> ComplexArray:
    # The loop sticks over the part of a half cycle in which the motion takes back 2 slip_torque/stiffness, then slides.
    reach = np.minimum(slip_torque / (stiffness * amplitude), 1.0) if stiffness > 0.0 else np.ones(amplitude.shape)
    angle = np.arccos(1.0 - 2.0 * reach)
    elastic = stiffness / np.pi * (angle - 0.5 * np.sin(2.0 * angle))
    lost = 4.0 * stiffness / np.pi * reach * (1.0 - reach)
    return np.asarray(elastic + 1j * lost + 0.0 * omega)


LAWS: Mapping[str, Law] = MappingProxyType(
    {
        law.name: law
        for law in (
            Law("cubic_stiffness", {"stiffness3": "N m/rad^3"}, _cubic, _cubic_slopes, _cubic_stiffness),
            Law(
                "freeplay", {"gap": "rad", "stiffness": "N m/rad"}, _freeplay, _freeplay_slopes, _freeplay_stiffness,
            ),
            Law(
                "bilinear_stiffness", {"asymmetry": "1", "stiffness": "N m/rad"},
                _bilinear, _bilinear_slopes, _bilinear_stiffness,
            ),
            Law("dry_friction", {"torque": "N m"}, _friction, _friction_slopes, _friction_stiffness, "velocity"),
            Law(
                "quadratic_damping", {"coefficient": "N m s^2/rad^2"},
                _quadratic, _quadratic_slopes, _quadratic_stiffness, "velocity",
            ),
            Law(
                "joint_slip", {"stiffness": "N m/rad", "slip_torque": "N m"},
                _slip, _slip_slopes, _slip_stiffness, memory=True,
            ),
        )
    }
)  # fmt: skip
"""The laws by the ids of their effects; the order is that of the codes in `cutvib_ss.response.compiled`."""
