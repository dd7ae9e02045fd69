"""
The tuned vibration absorber (Section 7): by Sherman-Morrison on frequency responses, as a subsystem, and its design.

Sign of Eqs. 23 and 24. An element attached at coordinate r takes the force z x_r from the structure: z is the force
that moves the element's foot over the foot's displacement, both in one direction (a spring to ground has z = k, a mass
z = -ω² m). The structure then sees f - z x_r at r. With x_p = a_pq f - a_pr z x_r and x_r = a_rq f / (1 + z a_rr),

    a_pq' = a_pq - z a_pr a_rq / (1 + z a_rr),

which is Eq. 23 with its bracket multiplied out, and adds z to the dynamic stiffness at r. For a mass on spring and
damper z = -ω² m_a (k_a + jωc_a) / (k_a - ω² m_a + jωc_a), Eq. 24.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal

from cutvib_ss.errors import ParameterError
from cutvib_ss.machine import Machine
from cutvib_ss.parameters import TABLE_7_PRINTED, AbsorberParameters, check_number, table_7
from cutvib_ss.response.condensed import as_laplace
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import AbsorberCheck, ComplexArray, FloatArray, FrequencyResponse, read_only
from cutvib_ss.slots import ModelT
from cutvib_ss.subsystems.elements import Attachment, SprungMass

WORKING_FREQUENCY = 217.0
"""Fundamental frequency of the cutting tool's force [Hz] (Section 2)."""

_PEAK_PROMINENCE = 0.02
"""A peak stands out of its surroundings by this part of the largest value."""


@dataclass(frozen=True)
class AbsorberStudy:
    """
    Absorbers over a grid of tunings and dampings, each judged by its worst position.

    Parameters
    ----------
    working_frequency : float
        Frequency of the tool's force [Hz].
    positions : array_like, shape (position,)
        Positions y_b / L over which the worst is taken.
    tuning : array_like, shape (tuning,)
        Tuning frequencies [Hz].
    damping_ratio : array_like, shape (damping,)
        Damping ratios of the absorber.
    before : array_like, shape (position,)
        Modulus of the driving-point accelerance at the working frequency without an absorber [m/s^2/N].
    worst : array_like, shape (tuning, damping)
        Largest modulus over the positions with the absorber [m/s^2/N].
    best : AbsorberParameters
        The absorber whose worst position is the best.
    """

    working_frequency: float
    positions: FloatArray
    tuning: FloatArray
    damping_ratio: FloatArray
    before: FloatArray
    worst: FloatArray
    best: AbsorberParameters

    def __post_init__(self) -> None:
        for name in ("positions", "tuning", "damping_ratio", "before", "worst"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))


def absorber_of(mass: float, stiffness: float, damping: float, source: str = "") -> AbsorberParameters:
    """
    An absorber from its physical values.

    Parameters
    ----------
    mass : float
        m_a [kg].
    stiffness : float
        k_a [N/m].
    damping : float
        c_a [N s/m].
    source : str
        Where the values come from.

    Returns
    -------
    AbsorberParameters
        With the tuning frequency and damping ratio that Eqs. 25 and 26 give.

    Examples
    --------
    >>> absorber_of(0.08, 14_195.0, 8.52).frequency
    67.04
    """
    check_number("absorber.mass", mass, 0.0, strict=True)
    check_number("absorber.stiffness", stiffness, 0.0, strict=True)
    frequency = (stiffness / mass) ** 0.5 / (2 * pi)
    return AbsorberParameters(frequency, damping / (2 * (stiffness * mass) ** 0.5), mass, source=source)


def printed_absorber() -> AbsorberParameters:
    """
    The absorber that Table 7's printed k_a and c_a would make, were the misprint taken at its word.

    Returns
    -------
    AbsorberParameters
        Tuned to 67 Hz instead of 212 Hz.
    """
    return absorber_of(
        table_7().mass, TABLE_7_PRINTED["stiffness"], TABLE_7_PRINTED["damping"], source="Table 7, k_a as printed"
    )


def dynamic_stiffness(absorber: AbsorberParameters, freq: ArrayLike, decay_rate: float = 0.0) -> ComplexArray:
    """
    Force on the absorber's foot over the foot's displacement (Eq. 24).

    Parameters
    ----------
    absorber : AbsorberParameters
        The absorber.
    freq : array_like, shape (frequency,)
        Frequencies [Hz].
    decay_rate : float
        σ [1/s]; the result is at s = σ + jω.

    Returns
    -------
    ndarray of complex, shape (frequency,)
        z [N/m]; -ω² m_a well below the tuning frequency.
    """
    _, s = as_laplace(freq, decay_rate)
    k, c, m = absorber.stiffness, absorber.damping, absorber.mass
    z: ComplexArray = m * s**2 * (k + s * c) / (k + s * c + m * s**2)
    return z


def sherman_morrison(receptance: ArrayLike, coordinate: int, stiffness: ArrayLike) -> ComplexArray:
    """
    Receptance matrix of a structure once an element is attached at one of its coordinates (Eq. 23).

    Parameters
    ----------
    receptance : array_like of complex, shape (..., n, n, frequency)
        Displacement over force [m/N] at n coordinates, outputs then inputs in the same order.
    coordinate : int
        Index r of the coordinate at which the element sits.
    stiffness : array_like of complex, shape (frequency,)
        Dynamic stiffness z of the element [N/m], force on it over its displacement.

    Returns
    -------
    ndarray of complex, shape (..., n, n, frequency)
        The modified receptance.

    Raises
    ------
    ParameterError
        If the matrix is not square, or has no such coordinate.

    Notes
    -----
    Computed as a_pq - z a_pr a_rq / (1 + z a_rr): Eq. 23 with its bracket multiplied out, without the difference of two
    large products that Eq. 23 takes near a resonance.
    """
    a, z = np.asarray(receptance, dtype=np.complex128), np.asarray(stiffness, dtype=np.complex128)
    if a.ndim < 3 or a.shape[-3] != a.shape[-2]:
        raise ParameterError(f"a receptance of shape {a.shape} is not square; give (..., n, n, frequency)")
    if not 0 <= coordinate < a.shape[-2]:
        raise ParameterError(f"coordinate = {coordinate} is not one of the {a.shape[-2]}, counted from 0")
    column, row = a[..., :, coordinate, :], a[..., coordinate, :, :]
    driving = a[..., coordinate, coordinate, :]
    factor = (z / (1.0 + z * driving))[..., None, None, :]
    modified: ComplexArray = a - factor * column[..., :, None, :] * row[..., None, :, :]
    return modified


def absorbed_response(
    frf: FrequencyResponse, absorber: AbsorberParameters, output: str = "tool_x", input: str = "force"
) -> FrequencyResponse:
    """
    Frequency responses, computed or measured, as an absorber at one of their driving points would change them.

    Parameters
    ----------
    frf : FrequencyResponse
        Responses of any form; of its inputs only the one at the absorber is needed for each response to it.
    absorber : AbsorberParameters
        The absorber.
    output, input : str
        The output and the input that belong to the coordinate at which it sits, in one direction.

    Returns
    -------
    FrequencyResponse
        The modified responses, of the same form.

    Raises
    ------
    ParameterError
        If the output or the input is not there.

    Notes
    -----
    Eq. 23 with p over all outputs and q over all inputs. It takes two columns and one row of the receptance, no model.
    """
    plain = FrequencyResponse(
        frf.data, frf.freq, frf.positions, frf.outputs, frf.inputs, frf.quantities, frf.input_unit, frf.decay_rate
    )
    to_r, from_r = plain.sel(output=output).to_form("receptance").data, plain.sel(input=input).data
    driving = plain.sel(output=output, input=input).to_form("receptance").data
    z = dynamic_stiffness(absorber, plain.freq, plain.decay_rate)
    # Each output keeps its own form: only what the element feels, its displacement, must be a receptance.
    return replace(plain, data=plain.data - z / (1.0 + z * driving) * from_r * to_r)


def attach_absorber(machine: ModelT, absorber: AbsorberParameters, port: str = "tool_x") -> ModelT:
    """
    A model with the absorber as a subsystem at a port.

    Parameters
    ----------
    machine : Machine or Structure
        The model.
    absorber : AbsorberParameters
        The absorber.
    port : str
        Where it sits, and in which direction it works.

    Returns
    -------
    Machine or Structure
        A new model, whose ``plant`` has two states more.

    Examples
    --------
    >>> from cutvib_ss.machine import published_machine
    >>> from cutvib_ss.parameters import table_7
    >>> attach_absorber(published_machine(), table_7()).plant(0.5).nstates
    14
    """
    element = SprungMass(absorber.mass, absorber.frequency, absorber.damping_ratio)
    attachments = (*machine.attachments, Attachment(port, element))  # type: ignore[attr-defined]
    return replace(machine, attachments=attachments)  # type: ignore[type-var]


def check_absorber(
    machine: Machine,
    absorber: AbsorberParameters,
    positions: ArrayLike = (1 / 3, 1 / 2),
    working_frequency: float = WORKING_FREQUENCY,
    freq: ArrayLike | None = None,
) -> AbsorberCheck:
    """
    What an absorber on the tool in X does over the workspace (Fig. 20).

    Parameters
    ----------
    machine : Machine
        The machine without it.
    absorber : AbsorberParameters
        The absorber.
    positions : array_like, shape (position,)
        y_b / L; by default the two of Fig. 20.
    working_frequency : float
        Frequency of the tool's force [Hz].
    freq : array_like, shape (frequency,), optional
        Frequencies of the responses and their peaks [Hz]; 150 to 300 Hz by default.

    Returns
    -------
    AbsorberCheck
        Accelerance XX at the working frequency before and after, the responses around it, and their peaks.
    """
    lines = np.arange(150.0, 300.0 + 0.125, 0.25) if freq is None else freq
    with_it = attach_absorber(machine, absorber)
    near = [frequency_response(m, positions, lines, outputs=("tool_x",)) for m in (machine, with_it)]
    there = [
        np.abs(frequency_response(m, positions, [working_frequency], outputs=("tool_x",)).data[:, 0, 0, 0])
        for m in (machine, with_it)
    ]
    return AbsorberCheck(
        absorber, working_frequency, near[0].positions, there[0], there[1], near[0], near[1], *map(_peaks, near)
    )


def parametric_study(
    machine: Machine,
    positions: ArrayLike = (1 / 3, 1 / 2),
    mass: float = 0.08,
    tuning: Sequence[float] | FloatArray | None = None,
    damping_ratio: Sequence[float] | FloatArray | None = None,
    working_frequency: float = WORKING_FREQUENCY,
) -> AbsorberStudy:
    """
    Absorbers of one mass over tunings and dampings, each judged by its worst position (the study behind Table 7).

    Parameters
    ----------
    machine : Machine
        The machine without absorber.
    positions : array_like, shape (position,)
        y_b / L over which the worst is taken; by default the two of Fig. 20.
    mass : float
        m_a [kg].
    tuning : sequence of float, optional
        Tuning frequencies [Hz]; 210 to 250 Hz in steps of 1 Hz by default.
    damping_ratio : sequence of float, optional
        Damping ratios; 0.01 to 0.05 in steps of 0.005 by default.
    working_frequency : float
        Frequency of the tool's force [Hz].

    Returns
    -------
    AbsorberStudy
        What is left at the worst position for each absorber, and the best of them.

    Notes
    -----
    At the driving point Eq. 23 is a' = a / (1 + z a), so the whole grid costs one frequency response a position.
    """
    tunings = np.arange(210.0, 250.5) if tuning is None else np.asarray(tuning, dtype=float)
    dampings = np.arange(10, 51, 5) / 1000 if damping_ratio is None else np.asarray(damping_ratio, dtype=float)
    frf = frequency_response(machine, positions, [working_frequency], form="receptance", outputs=("tool_x",))
    driving = frf.data[:, 0, 0, 0]
    grid = [[AbsorberParameters(float(f), float(zeta), mass) for zeta in dampings] for f in tunings]
    z = np.array([[dynamic_stiffness(a, [working_frequency])[0] for a in row] for row in grid])
    to_acceleration = (2 * pi * working_frequency) ** 2
    left = to_acceleration * np.abs(driving / (1.0 + z[..., None] * driving))
    worst = left.max(axis=-1)
    i, j = np.unravel_index(int(np.argmin(worst)), worst.shape)
    best = replace(grid[i][j], source="parametric study")
    before = to_acceleration * np.abs(driving)
    return AbsorberStudy(working_frequency, frf.positions, tunings, dampings, before, worst, best)


def _peaks(frf: FrequencyResponse) -> tuple[tuple[float, ...], ...]:
    out = []
    for modulus in np.abs(frf.data[:, 0, 0]):
        index, _ = signal.find_peaks(modulus, prominence=_PEAK_PROMINENCE * modulus.max())
        out.append(tuple(float(f) for f in frf.freq[index]))
    return tuple(out)
