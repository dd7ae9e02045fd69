"""
Loops around a nonlinear element, amplitude by amplitude: its describing function stands in for it.

At an amplitude A of its port's motion a law f(q, v) acts on the fundamental as k(A) + iω c(A) does. With that spring and damper in
its place the loop is linear again, and has poles and margins of its own at every amplitude. Where a pole crosses the axis, a limit
cycle is predicted, which is the condition 1 + N(A, ω) G(iω) = 0 in other words: one that attracts if the loop gains damping as
the amplitude grows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize

from cutvib_ss.absorber import WORKING_FREQUENCY
from cutvib_ss.control_design.check import full_order
from cutvib_ss.control_design.hardware import Hardware, control_plant
from cutvib_ss.control_design.loop import Loop
from cutvib_ss.control_design.margins import disk_margin
from cutvib_ss.control_design.scheduling import ScheduledController
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.elements import Attachment, SpringDamperMass
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.parameters import check_number
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import FloatArray, read_only


@dataclass(frozen=True)
class LimitCycle:
    """
    A predicted limit cycle.

    Parameters
    ----------
    position : float
        y_b / L.
    amplitude : float
        Amplitude of the element's port [rad or m].
    frequency : float
        Frequency [Hz].
    attracts : bool
        Whether motion nearby tends to it; if not, it is the edge beyond which motion grows.
    """

    position: float
    amplitude: float
    frequency: float
    attracts: bool


@dataclass(frozen=True)
class AmplitudeMargins:
    """
    A loop around a nonlinear element, over amplitude and position.

    Parameters
    ----------
    element : NonlinearElement
        The element.
    amplitudes : array_like, shape (amplitude,)
        Amplitudes of its port's motion [rad or m]; of a law of the velocity, at the working frequency.
    positions : array_like, shape (position,)
        y_b / L.
    growth_rate, growth_freq : array_like, shape (amplitude, position)
        Largest real part of the loop's poles [1/s], and the frequency of that pole [Hz].
    disk_margin : array_like, shape (amplitude, position)
        Balanced disk margin at the commands; zero where the loop is unstable.
    limit_cycles : tuple of LimitCycle
        Limit cycles between the smallest amplitude and the largest.
    """

    element: NonlinearElement
    amplitudes: FloatArray
    positions: FloatArray
    growth_rate: FloatArray
    growth_freq: FloatArray
    disk_margin: FloatArray
    limit_cycles: tuple[LimitCycle, ...]

    def __post_init__(self) -> None:
        for name in ("amplitudes", "positions", "growth_rate", "growth_freq", "disk_margin"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    @property
    def worst(self) -> tuple[float, float, float]:
        """The smallest disk margin, with the amplitude and the position where it is."""
        i, k = np.unravel_index(np.argmin(self.disk_margin), self.disk_margin.shape)
        return float(self.disk_margin[i, k]), float(self.amplitudes[i]), float(self.positions[k])


def quasi_linear(
    machine: Machine, amplitude: float, element: int = 0, working_frequency: float = WORKING_FREQUENCY
) -> Machine:
    """
    A machine with the describing function of a nonlinear element in its place.

    Parameters
    ----------
    machine : Machine
        The machine.
    amplitude : float
        Amplitude of the port's motion [rad or m].
    element : int
        Which of the machine's nonlinear elements.
    working_frequency : float
        Frequency [Hz] at which the amplitude is taken where the law follows the velocity, and at which a loss that does not
        depend on frequency (slip) becomes a damper.

    Returns
    -------
    Machine
        With a spring and a damper at the port, and no nonlinear element: others are left out.

    Raises
    ------
    ParameterError
        If there is no such element, or the amplitude is not positive.

    Notes
    -----
    For laws of the displacement without memory and for laws of the velocity this is exact at every frequency, the amplitude being
    that of the displacement and of the velocity (over the working frequency).

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> stiffening = NonlinearElement("joint2", "cubic_stiffness", {"stiffness3": 8e9})
    >>> quasi_linear(replace(published_machine(), nonlinear=(stiffening,)), 1e-3).attachments[-1].element.stiffness
    6000.0
    """
    if not 0 <= element < len(machine.nonlinear):
        raise ParameterError(
            f"the machine has {len(machine.nonlinear)} nonlinear elements; there is no number {element}"
        )
    amplitude = check_number("amplitude", amplitude, 0.0, strict=True)
    e = machine.nonlinear[element]
    stiffness, damping = e.restoring_force.equivalent(amplitude, 2 * np.pi * working_frequency)
    stand_in = Attachment(e.port, SpringDamperMass(stiffness=float(stiffness), damping=float(damping)))
    return replace(machine, nonlinear=(), attachments=(*machine.attachments, stand_in))


def working_amplitudes(
    machine: Machine,
    forces: ArrayLike,
    positions: ArrayLike,
    element: int = 0,
    working_frequency: float = WORKING_FREQUENCY,
) -> FloatArray:
    """
    How far a nonlinear element's port moves under the tool, by the linear machine.

    Parameters
    ----------
    machine : Machine
        The machine.
    forces : array_like, shape (amplitude,)
        Amplitudes of the cutting force [N].
    positions : array_like, shape (position,)
        y_b / L; the largest motion counts.
    element : int
        Which nonlinear element.
    working_frequency : float
        Frequency of the tool [Hz].

    Returns
    -------
    ndarray, shape (amplitude,)
        Amplitudes [rad or m].
    """
    linear, port = replace(machine, nonlinear=()), machine.nonlinear[element].port
    moved = frequency_response(linear, positions, [working_frequency], form="receptance", outputs=[port])
    return np.asarray(forces, dtype=np.float64) * float(np.abs(moved.data).max())


def amplitude_margins(
    controller: control.StateSpace | ScheduledController,
    machine: Machine,
    amplitudes: ArrayLike,
    positions: ArrayLike,
    hardware: Hardware | None = None,
    element: int = 0,
    working_frequency: float = WORKING_FREQUENCY,
) -> AmplitudeMargins:
    """
    Stability and margins of a controller on a machine with a nonlinear element, amplitude by amplitude.

    Parameters
    ----------
    controller : control.StateSpace or ScheduledController
        The controller.
    machine : Machine
        The machine, with its nonlinear elements.
    amplitudes : array_like, shape (amplitude,)
        Amplitudes of the element's port [rad or m], rising.
    positions : array_like, shape (position,)
        y_b / L.
    hardware : Hardware, optional
        Actuators, sensors and sampling.
    element : int
        Which nonlinear element; the others are left out.
    working_frequency : float
        Frequency of the tool [Hz].

    Returns
    -------
    AmplitudeMargins
        The margins, and the limit cycles that are predicted.

    Raises
    ------
    ParameterError
        If there is no such element, or amplitudes are not positive and rising.

    Notes
    -----
    The method of the describing function (Gelb and Vander Velde, Multiple-Input Describing Functions, 1968): harmonics of the
    element's force are taken to die out in the structure. It predicts; it does not prove.
    """
    steps = np.atleast_1d(np.asarray(amplitudes, dtype=np.float64))
    if steps.ndim != 1 or not np.isfinite(steps).all() or not np.all(np.diff(steps) > 0) or not steps[0] > 0:
        raise ParameterError("amplitudes must be positive and rising")
    places = np.atleast_1d(np.asarray(positions, dtype=np.float64))
    full, kit = full_order(machine), hardware or Hardware()

    def loop(amplitude: float, position: float) -> Loop:
        own = controller.at(position) if isinstance(controller, ScheduledController) else controller
        model = quasi_linear(full, amplitude, element, working_frequency)
        return Loop(control_plant(model, position, kit, False, working_frequency), own, kit.sampling)

    shape = (steps.size, places.size)
    growth, freq, disk = np.empty(shape), np.empty(shape), np.zeros(shape)
    cycles = []
    for k, place in enumerate(places):
        for i, amplitude in enumerate(steps):
            here = loop(float(amplitude), float(place))
            slowest = _slowest(here)
            growth[i, k], freq[i, k] = slowest.real, abs(slowest.imag) / (2 * np.pi)
            disk[i, k] = disk_margin(here.gain) if slowest.real < 0 else 0.0

        def slowest_at(amplitude: float, position: float = float(place)) -> complex:
            return _slowest(loop(amplitude, position))

        cycles += _cycles(slowest_at, steps, growth[:, k], float(place))
    return AmplitudeMargins(full.nonlinear[element], steps, places, growth, freq, disk, tuple(cycles))


def _slowest(loop: Loop) -> complex:
    return complex(loop.poles[np.argmax(loop.poles.real)])


def _cycles(
    slowest: Callable[[float], complex], amplitudes: FloatArray, growth: FloatArray, place: float
) -> list[LimitCycle]:
    """Amplitudes at which the slowest pole crosses the imaginary axis."""
    out = []
    for i in np.flatnonzero(np.signbit(growth[:-1]) != np.signbit(growth[1:])):
        low, high = np.log(amplitudes[i : i + 2])
        at = np.exp(optimize.brentq(lambda u: slowest(float(np.exp(u))).real, low, high, xtol=1e-4))
        frequency = abs(slowest(float(at)).imag) / (2 * np.pi)
        out.append(LimitCycle(place, float(at), frequency, bool(growth[i] > 0.0)))
    return out
