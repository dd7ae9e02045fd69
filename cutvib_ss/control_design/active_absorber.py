"""The active absorber: an inertial actuator that its own stroke, fed back late by the right time, tunes to the tool."""

from __future__ import annotations

import cmath
from math import pi

import control

from cutvib_ss.absorber import WORKING_FREQUENCY
from cutvib_ss.control_design.hardware import Hardware, InertialActuator, pade_delay
from cutvib_ss.errors import DesignError
from cutvib_ss.parameters import check_number
from cutvib_ss.units import DERIVATIVE_ORDER


def active_absorber(
    hardware: Hardware,
    frequency: float = WORKING_FREQUENCY,
    damping_ratio: float = 0.005,
    pade_order: int = 3,
) -> control.StateSpace:
    """
    The delayed feedback of the stroke that turns an inertial actuator into an absorber of another tuning and damping.

    Parameters
    ----------
    hardware : Hardware
        One inertial actuator and one sensor of its stroke.
    frequency : float
        Frequency to which the absorber is tuned [Hz].
    damping_ratio : float
        Damping that is left to it there; zero makes the loop marginal.
    pade_order : int
        Order of the Padé approximation of the delay.

    Returns
    -------
    control.StateSpace
        Stroke to command: a gain and a delay.

    Raises
    ------
    DesignError
        If the hardware is of another kind.

    Notes
    -----
    The delayed resonator (Olgac and Holm-Hansen, A novel active vibration absorption technique: delayed resonator, Journal of
    Sound and Vibration 176, 1994), short of its marginal gain. With D the way from the stroke through sensor, delay and coil
    to the force, the mass follows m s² + c s + k + D K: gain and delay of K are such that this is 2ζω m s at s = jω. It knows
    the actuator alone, and serves every machine and position.
    """
    if len(hardware.actuators) != 1 or len(hardware.sensors) != 1:
        raise DesignError("an active absorber takes one inertial actuator and one sensor")
    [actuator], [sensor] = hardware.actuators, hardware.sensors
    if not isinstance(actuator, InertialActuator) or sensor.port != actuator.stroke:
        raise DesignError("an active absorber takes an inertial actuator and a sensor of its stroke (stroke_<port>)")
    w = 2 * pi * check_number("frequency", frequency, 0.0, strict=True)
    zeta = check_number("damping_ratio", damping_ratio, 0.0)
    own, s = actuator.suspension, 1j * w
    late = cmath.exp(-s * hardware.sampling.delay) if hardware.sampling else 1.0
    way = complex(actuator.lag(s)) * complex(sensor.filter(s)) * late * s ** DERIVATIVE_ORDER[sensor.quantity]
    wanted = own.mass * w**2 - own.stiffness + s * (2 * zeta * w * own.mass - own.damping)
    gain = wanted / way
    turn = -cmath.phase(gain) % (2 * pi)
    # Half a turn is a sign: the delay stays below half a period.
    sign, turn = (-1.0, turn - pi) if turn >= pi else (1.0, turn)
    return control.ss(
        sign * abs(gain) * pade_delay(turn / w, pade_order), inputs=list(hardware.signals),
        outputs=list(hardware.commands), name="active absorber",
    )  # fmt: skip
