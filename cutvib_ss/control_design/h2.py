"""H2 control: the least motion at the tool's frequency under a weight on the effort beside it."""

from __future__ import annotations

import control

from cutvib_ss.absorber import WORKING_FREQUENCY
from cutvib_ss.control_design.synthesis import h2_synthesis
from cutvib_ss.control_design.weights import commands_and_signals, generalised_plant


def h2(
    plant: control.StateSpace,
    effort: float = 0.4,
    noise: float = 0.04,
    frequency: float = WORKING_FREQUENCY,
    width: float = 0.003,
    output: str = "tool_x",
) -> control.StateSpace:
    """
    The H2 optimal controller for a motion weighed at the tool's frequency.

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
    output : str
        The motion that is to be small.

    Returns
    -------
    control.StateSpace
        Signals to commands.

    Raises
    ------
    DesignError
        If no controller stabilises the plant.
    """
    commands, signals = commands_and_signals(plant)
    weighted = generalised_plant(plant, effort, noise, frequency, width, output)
    found, _ = h2_synthesis(weighted, len(signals), len(commands))
    return control.ss(found, inputs=signals, outputs=commands, name="h2")
