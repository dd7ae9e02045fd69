"""Resonant control: a narrow resonator at the tool's frequency and each harmonic, its phase set by the plant's."""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np

from cutvib_ss.absorber import WORKING_FREQUENCY
from cutvib_ss.control_design.weights import commands_and_signals, one_loop
from cutvib_ss.parameters import check_number


def resonant(
    plant: control.StateSpace,
    gain: float = 3.0,
    frequency: float = WORKING_FREQUENCY,
    harmonics: Sequence[int] = (1,),
    width: float = 0.002,
) -> control.StateSpace:
    """
    Resonators that leave 1/(1 + gain) of the motion at the sensor, at each harmonic.

    Parameters
    ----------
    plant : control.StateSpace
        From `control_plant`, with one actuator and one sensor.
    gain : float
        Loop gain at the harmonics.
    frequency : float
        Fundamental [Hz].
    harmonics : sequence of int
        Which ones.
    width : float
        Damping ratio of the resonators; the loop acts over (1 + gain) times that band.

    Returns
    -------
    control.StateSpace
        Signal to command, two states a harmonic.

    Raises
    ------
    DesignError
        If there are several actuators or sensors.

    Notes
    -----
    Each resonator is (a s + b)/(s² + 2ζω s + ω²) with a and b such that K(jω) = -gain/G(jω): the loop transfer -KG is real
    and positive there, as far from -1 as it can turn. The states do not depend on the plant, only a and b do, so that a
    family over positions has common coordinates.
    """
    part = one_loop(plant)
    (command,), (signal,) = commands_and_signals(plant)
    check_number("gain", gain, 0.0, strict=True)
    check_number("width", width, 0.0, strict=True)
    bank = control.ss([], [], [], [[0.0]])
    for n in harmonics:
        w = 2 * np.pi * n * check_number("frequency", frequency, 0.0, strict=True)
        # a jω + b at the resonance, where the denominator is 2ζω jω.
        top = -gain / complex(part(1j * w)) * 2j * width * w**2
        root = np.sqrt(2 * width * w)
        bank = bank + control.ss(
            [[0.0, w], [-w, -2 * width * w]], [[0.0], [root]], [[top.real / w / root, top.imag / w / root]], [[0.0]]
        )
    return control.ss(bank, inputs=[signal], outputs=[command], name="resonant")
