"""H∞ control: mixed sensitivity of motion and effort under the cutting force and the sensors' noise."""

from __future__ import annotations

import control

from cutvib_ss.absorber import WORKING_FREQUENCY
from cutvib_ss.control_design.synthesis import hinf_synthesis
from cutvib_ss.control_design.weights import commands_and_signals, generalised_plant


def hinf(
    plant: control.StateSpace,
    effort: float = 0.4,
    noise: float = 0.04,
    frequency: float = WORKING_FREQUENCY,
    width: float = 0.003,
    slack: float = 1.5,
    output: str = "tool_x",
) -> control.StateSpace:
    """
    An H∞ controller whose norm has been verified.

    Parameters
    ----------
    plant : control.StateSpace
        From `control_plant`.
    effort : float
        Weight on the motion that a command makes, away from the frequency, against that on the motion at it.
    noise : float
        Noise of each sensor, against what it reads of a unit force at the frequency.
    frequency, width : float
        Centre [Hz] and damping ratio of the weight on the motion.
    slack : float
        Factor on the smallest γ that was reached.
    output : str
        The motion that is to be small.

    Returns
    -------
    control.StateSpace
        Signals to commands.

    Raises
    ------
    DesignError
        If no controller keeps its norm.

    Notes
    -----
    The force enters where it does on the machine, not at the plant's output: the textbook's S/KS problem would have the
    controller cancel every lightly damped pole (Sefton and Glover, Pole/zero cancellations in the general H∞ problem with
    reference to a two block design, Systems & Control Letters 14, 1990), and loses its own margins when one moves.
    """
    commands, signals = commands_and_signals(plant)
    weighted = generalised_plant(plant, effort, noise, frequency, width, output)
    found, _ = hinf_synthesis(weighted, len(signals), len(commands), slack)
    return control.ss(found, inputs=signals, outputs=commands, name="hinf")
