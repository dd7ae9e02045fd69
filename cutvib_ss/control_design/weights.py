"""
The generalised plant: what is disturbed, what is weighed, what is measured.

Weights on commands and noise are relative: to the motion that a unit command makes at the tool's frequency, and to what a sensor
reads there under a unit of cutting force. The same figures then serve an actuator on the tool and one on the head, twenty times
less effective.
"""

from __future__ import annotations

import control
import numpy as np

from cutvib_ss.errors import DesignError, ParameterError
from cutvib_ss.parameters import check_number
from cutvib_ss.results import FloatArray


def commands_and_signals(plant: control.StateSpace) -> tuple[list[str], list[str]]:
    """Names of a plant's commands and of its sensors' signals."""
    commands = [name for name in plant.input_labels if name.startswith("u_")]
    signals = [name for name in plant.output_labels if name.startswith("y_")]
    if not commands or not signals:
        raise ParameterError("the plant has no commands u_… or no signals y_…; make it with control_plant")
    return commands, signals


def one_loop(plant: control.StateSpace) -> control.StateSpace:
    """From the one command of a plant to its one signal."""
    commands, signals = commands_and_signals(plant)
    if len(commands) > 1 or len(signals) > 1:
        raise DesignError("this controller takes one actuator and one sensor; LQG, H2 and H∞ take several")
    return plant[signals[0], commands[0]]


def working_gains(plant: control.StateSpace, frequency: float, output: str = "tool_x") -> tuple[FloatArray, FloatArray]:
    """What commands and sensors are worth at a frequency."""
    commands, signals = commands_and_signals(plant)
    s = 2j * np.pi * check_number("frequency", frequency, 0.0, strict=True)
    response = np.abs(plant[[output, *signals], ["force", *commands]](s, squeeze=False))
    return response[0, 1:], response[1:, 0]


def tone(frequency: float, width: float) -> control.StateSpace:
    """A weight that is one at a frequency and falls off beside it."""
    w = 2 * np.pi * check_number("frequency", frequency, 0.0, strict=True)
    zeta = check_number("width", width, 0.0, strict=True)
    a = [[0.0, w], [-w, -2 * zeta * w]]
    root = np.sqrt(2 * zeta * w)
    return control.ss(a, [[0.0], [root]], [[0.0, root]], [[0.0]])


def effort_weight(frequency: float, notch: float = 0.1, width: float = 0.3) -> control.StateSpace:
    """A weight on commands that lets them pass at the tool's frequency and little beside it."""
    passing = tone(frequency, width)
    return control.ss(passing.A, passing.B, -(1.0 - notch) * passing.C, [[1.0]])


def generalised_plant(
    plant: control.StateSpace,
    effort: float,
    noise: float,
    frequency: float,
    width: float,
    output: str = "tool_x",
) -> control.StateSpace:
    """The plant with weights for H2 and H∞ synthesis."""
    commands, signals = commands_and_signals(plant)
    check_number("effort", effort, 0.0, strict=True)
    check_number("noise", noise, 0.0, strict=True)
    m, p = len(commands), len(signals)
    of_commands, of_signals = working_gains(plant, frequency, output)
    part = plant[[output, *signals], ["force", *commands]]
    b = np.hstack([part.B[:, :1], np.zeros((part.nstates, p)), part.B[:, 1:]])
    c = np.vstack([part.C[:1], np.zeros((m, part.nstates)), part.C[1:]])
    d = np.zeros((1 + m + p, 1 + p + m))
    d[0, 0], d[0, 1 + p :] = part.D[0, 0], part.D[0, 1:]
    d[1 : 1 + m, 1 + p :] = effort * np.diag(of_commands)
    d[1 + m :, 1 : 1 + p] = noise * np.diag(of_signals)
    unweighted = control.ss([], [], [], np.eye(p))
    weighted = control.append(tone(frequency, width), *[effort_weight(frequency)] * m, unweighted)
    whole = weighted * control.ss(part.A, b, c, d)
    return control.ss(
        whole.A, whole.B, whole.C, whole.D,
        inputs=["force", *(f"noise_{s}" for s in signals), *commands],
        outputs=[f"weighted_{output}", *(f"weighted_{u}" for u in commands), *signals],
    )  # fmt: skip
