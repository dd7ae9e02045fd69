"""
Actuators, sensors and the sampling between them: what a controller meets besides the machine.

An actuator is a port on which a command acts. An inertial one carries a moving mass on a suspension; its coil pushes the
machine one way and the mass the other. `control_plant` joins them to the machine at a position.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from types import MappingProxyType

import control
import numpy as np

from cutvib_ss.absorber import WORKING_FREQUENCY, attach_absorber
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.measurement_chain import MeasurementChain
from cutvib_ss.parameters import AbsorberParameters, check_number
from cutvib_ss.results import Quantity
from cutvib_ss.units import DERIVATIVE_ORDER

MOTIONS = ("tool_x", "tool_z", "base_x", "head_x")
"""Motions of the machine that a plant gives besides its sensors."""

TYPICAL_NOISE: Mapping[Quantity, float] = MappingProxyType(
    {"displacement": 1e-9, "velocity": 1e-6, "acceleration": 1e-3}
)
"""Noise of plain sensors with their converters, one-sided [m/√Hz, m/s/√Hz, m/s^2/√Hz]: assumptions, not data."""


@dataclass(frozen=True)
class ForceActuator:
    """
    An actuator that pushes the machine at a port against ground.

    Parameters
    ----------
    port : str
        Where it acts: ``base``, ``head_x``, ``tool_x`` or any other port of the head or the rail.
    bandwidth : float
        Corner of amplifier and coil, a lag of first order [Hz].
    """

    port: str = "base"
    bandwidth: float = 2000.0

    def __post_init__(self) -> None:
        check_number("actuator.bandwidth", self.bandwidth, 0.0, strict=True)

    @property
    def command(self) -> str:
        """Name of its command [N]."""
        return f"u_{self.port}"

    @property
    def lag(self) -> control.StateSpace:
        """Amplifier and coil, from command to force."""
        w = 2 * np.pi * self.bandwidth
        return control.ss([[-w]], [[w]], [[1.0]], [[0.0]])


@dataclass(frozen=True)
class InertialActuator(ForceActuator):
    """
    An actuator whose coil pushes the machine at a port against a moving mass.

    Parameters
    ----------
    port : str
        Where it sits.
    bandwidth : float
        Corner of amplifier and coil, a lag of first order [Hz].
    mass : float
        Moving mass [kg].
    frequency : float
        Natural frequency of the mass on its suspension [Hz].
    damping_ratio : float
        Of the suspension.
    """

    port: str = "head_x"
    mass: float = 1.0
    frequency: float = 30.0
    damping_ratio: float = 0.3

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.suspension

    @property
    def suspension(self) -> AbsorberParameters:
        """The mass on its suspension: with no command, the actuator is an absorber."""
        return AbsorberParameters(self.frequency, self.damping_ratio, self.mass)

    @property
    def stroke(self) -> str:
        """Name of the motion of the mass against the machine."""
        return f"stroke_{self.port}"


@dataclass(frozen=True)
class Sensor:
    """
    A sensor with its anti-aliasing filter.

    Parameters
    ----------
    port : str
        What it reads: ``tool_x``, ``tool_z``, ``base_x``, ``head_x``, any other port, or ``stroke_<port>`` of an inertial
        actuator.
    quantity : {"displacement", "velocity", "acceleration"}
        Which motion.
    noise : float, optional
        Density of its noise, one-sided [unit of the quantity/√Hz]; by default that of a plain sensor (`TYPICAL_NOISE`).
    bandwidth : float
        Corner of the anti-aliasing filter, Butterworth of second order [Hz].
    """

    port: str = "tool_x"
    quantity: Quantity = "acceleration"
    noise: float | None = None
    bandwidth: float = 2000.0

    def __post_init__(self) -> None:
        if self.quantity not in DERIVATIVE_ORDER:
            raise ParameterError(f"sensor.quantity {self.quantity!r} is not one of {', '.join(DERIVATIVE_ORDER)}")
        if self.noise is not None:
            check_number("sensor.noise", self.noise, 0.0, strict=True)
        check_number("sensor.bandwidth", self.bandwidth, 0.0, strict=True)

    @property
    def signal(self) -> str:
        """Name of what it gives."""
        return f"y_{self.port}"

    @property
    def noise_density(self) -> float:
        """Density of its noise, one-sided [unit of the quantity/√Hz]."""
        return TYPICAL_NOISE[self.quantity] if self.noise is None else self.noise

    @property
    def filter(self) -> control.StateSpace:
        """The anti-aliasing filter."""
        w = 2 * np.pi * self.bandwidth
        return control.ss([[0.0, w], [-w, -sqrt(2) * w]], [[0.0], [w]], [[1.0, 0.0]], [[0.0]])


@dataclass(frozen=True)
class Sampling:
    """
    How a digital controller samples, computes and holds.

    Parameters
    ----------
    rate : float
        Samples per second [Hz].
    computation : float
        From the sample to the command that it leads to [s].
    """

    rate: float = 10_000.0
    computation: float = 1e-4

    def __post_init__(self) -> None:
        check_number("sampling.rate", self.rate, 0.0, strict=True)
        check_number("sampling.computation", self.computation, 0.0)

    @property
    def period(self) -> float:
        """Between two samples [s]."""
        return 1.0 / self.rate

    @property
    def delay(self) -> float:
        """The computation and, of the hold, half a period [s]: what a continuous design counts with."""
        return self.computation + self.period / 2


@dataclass(frozen=True)
class Hardware:
    """
    All that stands between controller and machine.

    Parameters
    ----------
    actuators : tuple of ForceActuator
        At least one.
    sensors : tuple of Sensor
        At least one.
    sampling : Sampling, optional
        None for an analogue controller.
    pade_order : int
        Order of the Padé approximation of the delay in plants for continuous design.

    Raises
    ------
    ParameterError
        If a signal's name occurs twice, or there is no actuator or sensor.
    """

    actuators: tuple[ForceActuator, ...] = (InertialActuator(),)
    sensors: tuple[Sensor, ...] = (Sensor(),)
    sampling: Sampling | None = Sampling()
    pade_order: int = 2

    def __post_init__(self) -> None:
        for names, what in ((self.commands, "actuator"), (self.signals, "sensor")):
            if not names:
                raise ParameterError(f"hardware needs at least one {what}")
            if len(set(names)) < len(names):
                raise ParameterError(f"two {what}s share a port ({', '.join(names)}); give each a port of its own")

    @property
    def commands(self) -> tuple[str, ...]:
        """Names of the commands: the outputs of a controller."""
        return tuple(a.command for a in self.actuators)

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the sensors' signals: the inputs of a controller."""
        return tuple(s.signal for s in self.sensors)


def control_plant(
    machine: Machine,
    position: float,
    hardware: Hardware | None = None,
    delayed: bool = True,
    viscous_at: float = WORKING_FREQUENCY,
) -> control.StateSpace:
    """
    The machine with actuators and sensors, from cutting force and commands to motions and sensors' signals.

    Parameters
    ----------
    machine : Machine
        The machine; nonlinear elements and the measurement chain of a campaign take no part.
    position : float
        y_b / L of the head.
    hardware : Hardware, optional
        Actuators, sensors and sampling.
    delayed : bool
        Whether commands pass a Padé approximation of the sampling's delay: wanted for a continuous design, not where the
        plant is sampled itself.
    viscous_at : float
        Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

    Returns
    -------
    control.StateSpace
        Inputs ``force`` and the commands [N]; outputs the accelerations `MOTIONS` [m/s^2] and the sensors' signals.

    Raises
    ------
    ParameterError
        If a sensor reads the stroke of an actuator that is not there.
    CouplingError
        If the machine has no such port.

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> plant = control_plant(published_machine(), 0.5)
    >>> plant.input_labels, plant.output_labels[-1], plant.nstates
    (['force', 'u_head_x'], 'y_tool_x', 19)
    """
    kit = hardware or Hardware()
    model = replace(machine, chain=MeasurementChain())
    strokes: dict[str, tuple[str, str]] = {}
    for actuator in kit.actuators:
        if isinstance(actuator, InertialActuator):
            # Named by its place among the known attachments, which come before those of effects.
            known = len((model.bare or model).attachments)
            model = attach_absorber(model, actuator.suspension, actuator.port)
            strokes[actuator.stroke] = (f"attached{known + 1}_mass", actuator.port)
    pushed = [(a.port, *(strokes[a.stroke][:1] if isinstance(a, InertialActuator) else ())) for a in kit.actuators]
    read = [strokes.get(name, (name,)) for name in (*MOTIONS, *(s.port for s in kit.sensors))]
    for sensor in kit.sensors:
        if sensor.port.startswith("stroke_") and sensor.port not in strokes:
            raise ParameterError(
                f"a sensor reads {sensor.port}; there are the strokes {', '.join(strokes) or 'of none'}"
            )
    ports_in, ports_out = [list(dict.fromkeys(p for pair in pairs for p in pair)) for pairs in (pushed, read)]
    bare = model.plant(position, inputs=["force", *ports_in], outputs=ports_out, viscous_at=viscous_at)
    push = np.block([[1.0, np.zeros((1, len(pushed)))], [np.zeros((len(ports_in), 1)), _against(pushed, ports_in)]])
    # States as large as the accelerations, by one factor at all positions: motions beside filters would be 1e-6 of them.
    size = (2 * np.pi * viscous_at) ** 2
    b, rows = size * bare.B @ push, _against(read, ports_out).T @ bare.C / size
    orders = [2] * len(MOTIONS) + [DERIVATIVE_ORDER[s.quantity] for s in kit.sensors]
    # A force moves neither displacement nor velocity at once; acceleration it does.
    c = np.array([row @ np.linalg.matrix_power(bare.A, n) for row, n in zip(rows, orders, strict=True)])
    d = np.array([row @ bare.A @ b if n == 2 else np.zeros(b.shape[1]) for row, n in zip(rows, orders, strict=True)])
    before = [_unit(1), *(a.lag for a in kit.actuators)]
    if delayed and kit.sampling is not None:
        late = pade_delay(kit.sampling.delay, kit.pade_order)
        before[1:] = [lag * late for lag in before[1:]]
    after = [_unit(len(MOTIONS)), *(s.filter for s in kit.sensors)]
    whole = control.append(*after) * control.ss(bare.A, b, c, d) * control.append(*before)
    return control.ss(
        whole.A, whole.B, whole.C, whole.D, inputs=["force", *kit.commands], outputs=[*MOTIONS, *kit.signals],
        name="plant",
    )  # fmt: skip


def pade_delay(delay: float, order: int) -> control.StateSpace:
    """Padé approximation of a delay, in states of one size."""
    if delay == 0.0 or order == 0:
        return _unit(1)
    # In units of the delay; in seconds the coefficients would lie many decades apart.
    scaled = control.ss(control.tf(*control.pade(1.0, order)))
    return control.ss(scaled.A / delay, scaled.B / sqrt(delay), scaled.C / sqrt(delay), scaled.D)


def _against(pairs: Sequence[tuple[str, ...]], ports: Sequence[str]) -> np.ndarray:
    """Columns over ports: one for the first of a pair, minus one for the second, against which it pushes or is read."""
    out = np.zeros((len(ports), len(pairs)))
    for k, pair in enumerate(pairs):
        for port, sign in zip(pair, (1.0, -1.0), strict=False):
            out[ports.index(port), k] = sign
    return out


def _unit(n: int) -> control.StateSpace:
    return control.ss([], [], [], np.eye(n))
