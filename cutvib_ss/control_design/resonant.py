"""Resonant control: a narrow resonator at the tool's frequency and each harmonic, its phase set by the plant's."""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np
from scipy import linalg

from cutvib_ss.absorber import WORKING_FREQUENCY
from cutvib_ss.control_design.weights import commands_and_signals, one_loop
from cutvib_ss.parameters import check_number


def resonant(
    plant: control.StateSpace,
    gain: float = 3.0,
    frequency: float = WORKING_FREQUENCY,
    harmonics: Sequence[int] = (1, 2, 3),
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
    A bank Σ (aₙ s + bₙ)/(s² + 2ζωₙ s + ωₙ²), its a and b solved for K(jωₙ) = -gain/G(jωₙ) at every harmonic: the loop
    transfer -KG is real and positive there, as far from -1 as it can turn. The states do not depend on the plant, only a and b
    do, so that a family over positions has common coordinates.
    """
    part = one_loop(plant)
    (command,), (signal,) = commands_and_signals(plant)
    check_number("gain", gain, 0.0, strict=True)
    check_number("width", width, 0.0, strict=True)
    w = 2 * np.pi * check_number("frequency", frequency, 0.0, strict=True) * np.asarray(harmonics, dtype=float)
    a, b = [], []
    for own in w:
        a.append(np.array([[0.0, own], [-own, -2 * width * own]]))
        b.append(np.array([[0.0], [np.sqrt(2 * width * own)]]))
    bank = control.ss(linalg.block_diag(*a), np.vstack(b), np.eye(2 * w.size), np.zeros((2 * w.size, 1)))
    # Each state's response at each harmonic; the row that reads them is real, so that both parts count.
    states, wanted = bank(1j * w)[:, 0].T, -gain / part(1j * w)
    read = np.linalg.solve(np.vstack([states.real, states.imag]), np.concatenate([wanted.real, wanted.imag]))
    return control.ss(bank.A, bank.B, read[None], [[0.0]], inputs=[signal], outputs=[command], name="resonant")
