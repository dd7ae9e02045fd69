"""
The tuned vibration absorber (Section 7) on a structure: by Sherman-Morrison on frequency responses, and as a subsystem.

Sign of Eqs. 23 and 24. An element attached at coordinate r takes the force z x_r from the structure: z is the force
that moves the element's foot over the foot's displacement, both in one direction (a spring to ground has z = k, a mass
z = -ω² m). The structure then sees f - z x_r at r. With x_p = a_pq f - a_pr z x_r and x_r = a_rq f / (1 + z a_rr),

    a_pq' = a_pq - z a_pr a_rq / (1 + z a_rr),

which is Eq. 23 with its bracket multiplied out, and adds z to the dynamic stiffness at r. For a mass on spring and
damper z = -ω² m_a (k_a + jωc_a) / (k_a - ω² m_a + jωc_a), Eq. 24.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.elements import Attachment, SprungMass
from cutvib_ss.model.paths import ModelT
from cutvib_ss.parameters import TABLE_7_PRINTED, AbsorberParameters, check_number, table_7
from cutvib_ss.response.axes import as_laplace
from cutvib_ss.results import ComplexArray, FrequencyResponse


@dataclass(frozen=True)
class MountedAbsorber:
    """
    An absorber at a port.

    Parameters
    ----------
    absorber : AbsorberParameters
        The absorber.
    port : str
        Where it sits, and in which direction it works: ``tool_x``, ``tool_z``, ``head_x``, ``head_z``, or any other port.
    """

    absorber: AbsorberParameters
    port: str = "tool_x"


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
    The absorber of Table 7 by its printed frequency, damping ratio and mass: what `cutvib absorber check` takes by default.

    Returns
    -------
    AbsorberParameters
        Tuned to 212 Hz; its stiffness is that of Eq. 25, 141,945.44 N/m, not the misprinted one.
    """
    return table_7()


def misprinted_absorber() -> AbsorberParameters:
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
        A new model, whose ``plant`` has two states more. Of a corrected machine the absorber becomes part of what is
        known, below the effects.

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> from cutvib_ss.parameters import table_7
    >>> attach_absorber(published_machine(), table_7()).plant(0.5).nstates
    14
    """
    element = SprungMass(absorber.mass, absorber.frequency, absorber.damping_ratio)
    attached: ModelT = _with_attachment(machine, Attachment(port, element))
    return attached


def attach_absorbers(machine: ModelT, mounted: Iterable[MountedAbsorber]) -> ModelT:
    """
    A model with several absorbers as subsystems.

    Parameters
    ----------
    machine : Machine or Structure
        The model.
    mounted : iterable of MountedAbsorber
        The absorbers, and where they sit.

    Returns
    -------
    Machine or Structure
        A new model, whose ``plant`` has two states more for each absorber.
    """
    for m in mounted:
        machine = attach_absorber(machine, m.absorber, m.port)
    return machine


def _with_attachment(model: Any, attachment: Attachment) -> Any:
    """The model with one more attachment of its bare machine: known hardware comes before effects, as in machine.toml."""
    bare = model if model.bare is None else model.bare
    known = len(bare.attachments)
    attachments = (*model.attachments[:known], attachment, *model.attachments[known:])
    below = None if model.bare is None else _with_attachment(model.bare, attachment)
    return replace(model, attachments=attachments, bare=below)
