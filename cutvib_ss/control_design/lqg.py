"""LQG: state feedback and a Kalman filter, for a cutting force of coloured noise around the tool's frequency."""

from __future__ import annotations

import control
import numpy as np

from cutvib_ss.absorber import WORKING_FREQUENCY
from cutvib_ss.control_design.weights import commands_and_signals, tone, working_gains
from cutvib_ss.errors import DesignError
from cutvib_ss.parameters import check_number


def lqg(
    plant: control.StateSpace,
    effort: float = 0.12,
    noise: float = 0.04,
    frequency: float = WORKING_FREQUENCY,
    width: float = 0.01,
    output: str = "tool_x",
) -> control.StateSpace:
    """
    The linear quadratic Gaussian controller.

    Parameters
    ----------
    plant : control.StateSpace
        From `control_plant`.
    effort : float
        Cost of the motion that a command makes at the frequency, against that of the motion itself.
    noise : float
        Density of each sensor's noise, against what it reads of a force of unit density at the frequency.
    frequency, width : float
        Centre [Hz] and damping ratio of the force's spectrum.
    output : str
        The motion that is to be small.

    Returns
    -------
    control.StateSpace
        Signals to commands, of the plant's order and two.

    Raises
    ------
    DesignError
        If a Riccati equation has no solution.

    Notes
    -----
    `control.lqr` and `control.lqe` with ``method="scipy"``; the SLICOT solver leaves residuals of 1e-4 on these plants.
    """
    commands, signals = commands_and_signals(plant)
    check_number("effort", effort, 0.0, strict=True)
    check_number("noise", noise, 0.0, strict=True)
    of_commands, of_signals = working_gains(plant, frequency, output)
    coloured = plant * control.append(tone(frequency, width), control.ss([], [], [], np.eye(len(commands))))
    row = plant.output_labels.index(output)
    c_z, c_y = coloured.C[row : row + 1], coloured.C[-len(signals) :]
    d_z, b_w, b_u = coloured.D[row : row + 1, 1:], coloured.B[:, :1], coloured.B[:, 1:]
    cost = effort**2 * np.diag(of_commands**2) + d_z.T @ d_z
    spread = noise**2 * np.diag(of_signals**2)
    try:
        feedback, _, _ = control.lqr(coloured.A, b_u, c_z.T @ c_z, cost, c_z.T @ d_z, method="scipy")
        gain, _, _ = control.lqe(coloured.A, b_w, c_y, np.eye(1), spread, method="scipy")
    except (np.linalg.LinAlgError, ValueError) as error:
        raise DesignError(f"LQG: a Riccati equation has no solution ({error})") from error
    return control.ss(
        coloured.A - b_u @ feedback - gain @ c_y, gain, -feedback, np.zeros((len(commands), len(signals))),
        inputs=signals, outputs=commands, name="lqg",
    )  # fmt: skip
