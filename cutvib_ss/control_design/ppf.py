"""Positive position feedback: a damped second-order filter from the motion to a force at the same place."""

from __future__ import annotations

import control
import numpy as np

from cutvib_ss.absorber import WORKING_FREQUENCY
from cutvib_ss.control_design.margins import margins
from cutvib_ss.control_design.weights import commands_and_signals, one_loop
from cutvib_ss.errors import DesignError
from cutvib_ss.parameters import check_number
from cutvib_ss.results import Quantity


def positive_position_feedback(
    plant: control.StateSpace,
    frequency: float = WORKING_FREQUENCY,
    damping_ratio: float = 0.2,
    share: float = 0.5,
    quantity: Quantity = "acceleration",
) -> control.StateSpace:
    """
    Positive position feedback through one filter.

    Parameters
    ----------
    plant : control.StateSpace
        From `control_plant`, with one actuator and one sensor at its port.
    frequency : float
        Natural frequency of the filter [Hz].
    damping_ratio : float
        Of the filter.
    share : float
        Gain, as a part of the smallest one at which the loop turns unstable.
    quantity : {"displacement", "acceleration"}
        What the sensor reads. An accelerometer's signal over -ω² stands for the displacement: the same at the filter's
        frequency, less below, where the displacement of the rail's first mode would use the gain up.

    Returns
    -------
    control.StateSpace
        Signal to command, two states.

    Raises
    ------
    DesignError
        If no gain makes the loop unstable, the sensor reads a velocity, or there are several actuators or sensors.

    Notes
    -----
    u = g ω²/(s² + 2ζω s + ω²) y, y a displacement (Fanson and Caughey, Positive position feedback control for large space
    structures, AIAA Journal 28(4), 1990). At the filter's resonance the command lags by 90°: it opposes the velocity.
    """
    part = one_loop(plant)
    (command,), (signal,) = commands_and_signals(plant)
    w = 2 * np.pi * check_number("frequency", frequency, 0.0, strict=True)
    zeta = check_number("damping_ratio", damping_ratio, 0.0, strict=True)
    if quantity not in ("displacement", "acceleration"):
        raise DesignError(f"positive position feedback takes displacement or acceleration, not {quantity}")
    sign = 1.0 if quantity == "displacement" else -1.0
    filter_ = control.ss([[0.0, w], [-w, -2 * zeta * w]], [[0.0], [w]], [[sign, 0.0]], [[0.0]])
    loop = -filter_ * part
    # Of a gain so small that the closed loop's poles are the open one's.
    bears = margins(1e-9 * loop, loop.poles()).gain_up * 1e-9
    if not np.isfinite(bears):
        raise DesignError(
            "positive position feedback: no gain turns this loop unstable; is the sensor at the actuator?"
        )
    return control.ss(share * bears * filter_, inputs=[signal], outputs=[command], name="ppf")
