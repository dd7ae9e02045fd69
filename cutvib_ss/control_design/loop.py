"""
The closed loop as it would run: a controller on the machine, sampled exactly where it is digital.

A controller K turns sensors' signals into commands, u = K y. Of a digital loop the controller sees the plant at its samples:
held commands that arrive late, in closed form (Åström and Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, Chapter 2).
Between samples the motion goes on; its fundamental at the frequency of the force is what the responses give.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg, signal

from cutvib_ss.control_design.hardware import Sampling
from cutvib_ss.errors import ParameterError
from cutvib_ss.results import ComplexArray, FloatArray


@dataclass(frozen=True)
class Loop:
    """
    A controller on a plant.

    Parameters
    ----------
    plant : control.StateSpace
        From `control_plant` with ``delayed=False``: ``force`` and commands to motions and sensors' signals.
    controller : control.StateSpace
        Signals to commands, continuous or at the sampling's period.
    sampling : Sampling, optional
        None for an analogue controller.

    Raises
    ------
    ParameterError
        If the controller's signals are not the plant's, or its period is not the sampling's.
    """

    plant: control.StateSpace
    controller: control.StateSpace
    sampling: Sampling | None = None

    def __post_init__(self) -> None:
        signals, commands = tuple(self.controller.input_labels), tuple(self.controller.output_labels)
        theirs = tuple(self.plant.output_labels[-len(signals) :]), tuple(self.plant.input_labels[1:])
        if (signals, commands) != theirs:
            raise ParameterError(
                f"the controller goes from {', '.join(signals)} to {', '.join(commands)}, the hardware from "
                f"{', '.join(theirs[0])} to {', '.join(theirs[1])}; give the hardware that it was designed for"
            )
        period = self.controller.dt or 0.0
        if self.sampling is None and period:
            raise ParameterError("a sampled controller needs hardware with a sampling")
        if self.sampling is not None:
            if period and not np.isclose(period, self.sampling.period, rtol=1e-9):
                raise ParameterError(f"the controller runs at {period:g} s, the hardware at {self.sampling.period:g} s")
            object.__setattr__(self, "controller", discretised(self.controller, self.sampling))

    @cached_property
    def seen(self) -> control.StateSpace:
        """The plant from commands to signals as the controller sees it."""
        part = self.plant[-self.controller.ninputs :, 1:]
        return part if self.sampling is None else sampled(part, self.sampling)

    @cached_property
    def gain(self) -> control.StateSpace:
        """Loop transfer at the commands, -K G: the loop is stable or not as I + gain has it."""
        return -self.controller * self.seen

    @cached_property
    def poles(self) -> ComplexArray:
        """Poles of the closed loop [rad/s]; of a sampled one log(z)/T."""
        poles: ComplexArray = np.asarray(self.seen.feedback(self.controller, sign=1).poles(), dtype=np.complex128)
        return poles if self.sampling is None else in_rad_per_s(poles, self.sampling.period)

    def response(self, freq: ArrayLike) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """
        Responses to the cutting force.

        Parameters
        ----------
        freq : array_like, shape (frequency,)
            Frequencies [Hz].

        Returns
        -------
        passive, closed : ndarray, shape (output, frequency)
            The plant's motions and signals per newton with no command, and with the loop closed.
        command : ndarray, shape (command, frequency)
            Commands per newton.
        """
        s = 2j * np.pi * np.atleast_1d(np.asarray(freq, dtype=float))
        plant, nu, ny = self._stacked(self.plant, s), self.controller.noutputs, self.controller.ninputs
        held = np.ones(s.size, dtype=np.complex128)
        z = s
        if self.sampling is not None:
            period = self.sampling.period
            z = np.exp(s * period)
            held = (1.0 - 1.0 / z) / (s * period) * np.exp(-s * self.sampling.computation)
        k, g = self._stacked(self.controller, z), self._stacked(self.seen, z)
        closing = np.asarray(np.linalg.solve(np.eye(nu) - k @ g, k @ plant[:, -ny:, :1]), dtype=np.complex128)
        passive = plant[:, :, 0]
        closed = passive + (plant[:, :, 1:] @ closing)[:, :, 0] * held[:, None]
        return passive.T, closed.T, closing[:, :, 0].T

    @staticmethod
    def _stacked(system: control.StateSpace, at: ComplexArray) -> ComplexArray:
        """Response with the frequency first, shape (frequency, output, input)."""
        values: ComplexArray = np.moveaxis(np.asarray(system(at, squeeze=False)), -1, 0)
        return values

    def command_noise(self, noise: ArrayLike) -> float:
        """
        Command that the sensors' noise alone causes.

        Parameters
        ----------
        noise : array_like, shape (signal,)
            One-sided densities of the noise after the filter [unit/√Hz].

        Returns
        -------
        float
            RMS of the commands together [N].
        """
        from_noise = self.controller.feedback(self.seen, sign=1)
        scale = np.diag(np.asarray(noise, dtype=float))
        a, b, c, d = from_noise.A, from_noise.B @ scale, from_noise.C, from_noise.D @ scale
        if self.sampling is None:
            spread, rate = linalg.solve_continuous_lyapunov(a, -b @ b.T), 1.0
            if np.any(d):
                return float("inf")
        else:
            spread, rate = linalg.solve_discrete_lyapunov(a, b @ b.T), self.sampling.rate
        return float(np.sqrt(np.trace(c @ spread @ c.T + d @ d.T) * rate / 2))


def in_rad_per_s(poles: ArrayLike, period: float) -> ComplexArray:
    """Poles of a sampled system as those of a continuous one."""
    z = np.asarray(poles, dtype=np.complex128)
    return np.asarray(np.log(np.where(np.abs(z) < 1e-30, 1e-30, z)) / period, dtype=np.complex128)


def discretised(controller: control.StateSpace, sampling: Sampling) -> control.StateSpace:
    """
    A continuous controller as its samples, ramp-invariant.

    Parameters
    ----------
    controller : control.StateSpace
        Continuous; one that is sampled already is given back.
    sampling : Sampling
        The sampling.

    Returns
    -------
    control.StateSpace
        At the sampling's period, signals named as before.

    Notes
    -----
    A first-order hold keeps every pole where it is, so that a resonator keeps its frequency, and adds no delay. A bilinear
    transform would shift the second harmonic of 217 Hz by 2.7 Hz at 10 kHz.
    """
    if controller.dt:
        return controller
    a, b, c, d, _ = signal.cont2discrete(
        (controller.A, controller.B, controller.C, controller.D), sampling.period, method="foh"
    )
    return control.ss(
        a, b, c, d, sampling.period, inputs=controller.input_labels, outputs=controller.output_labels,
        name=controller.name,
    )  # fmt: skip


def sampled(plant: control.StateSpace, sampling: Sampling) -> control.StateSpace:
    """
    A plant at its samples, commands held and late.

    Parameters
    ----------
    plant : control.StateSpace
        Continuous, without direct feedthrough.
    sampling : Sampling
        The sampling; its computation may take any time.

    Returns
    -------
    control.StateSpace
        At the sampling's period; commands on their way are states.

    Raises
    ------
    ParameterError
        If the plant has direct feedthrough.

    Notes
    -----
    A delay τ = (d-1)T + τ', 0 < τ' ≤ T, gives x(k+1) = Φx(k) + Γ₁u(k-d) + Γ₀u(k-d+1) with Γ₀ = ∫₀^(T-τ') exp(As)B ds and
    Γ₁ = exp(A(T-τ')) ∫₀^τ' exp(As)B ds.
    """
    if np.any(plant.D):
        raise ParameterError(
            "a plant with direct feedthrough from command to sensor cannot be sampled; filter its sensor"
        )
    period, n, m = sampling.period, plant.nstates, plant.ninputs
    steps = ceil(sampling.computation / period - 1e-9)
    late = sampling.computation - (steps - 1) * period if steps else 0.0
    first, gamma_late = _held(plant, late)
    rest, gamma = _held(plant, period - late)
    a, b, c = np.zeros((n + steps * m, n + steps * m)), np.zeros((n + steps * m, m)), plant.C
    a[:n, :n] = rest @ first
    # The newer command of the two acts last; with no delay it is the only one.
    if steps <= 1:
        b[:n] = gamma
    else:
        a[:n, n + (steps - 2) * m : n + (steps - 1) * m] = gamma
    if steps:
        a[:n, n + (steps - 1) * m :] += rest @ gamma_late
        b[n : n + m] = np.eye(m)
        a[n + m :, n : n + (steps - 1) * m] = np.eye((steps - 1) * m)
    c = np.hstack([plant.C, np.zeros((plant.noutputs, steps * m))])
    return control.ss(
        a, b, c, plant.D, period, inputs=plant.input_labels, outputs=plant.output_labels, name="sampled plant"
    )


def _held(plant: control.StateSpace, time: float) -> tuple[FloatArray, FloatArray]:
    """How states move in a time, and what a held input of one adds."""
    n = plant.nstates
    whole = linalg.expm(np.block([[plant.A, plant.B], [np.zeros((plant.ninputs, n + plant.ninputs))]]) * time)
    return whole[:n, :n], whole[:n, n:]
