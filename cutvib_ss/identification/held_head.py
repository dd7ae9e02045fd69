"""The head with its base held: the paper's two-degree-of-freedom model (Section 5), with analytic derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from cutvib_ss.model.head import head, head_changes
from cutvib_ss.parameters import HeadParameters
from cutvib_ss.results import ComplexArray, FloatArray, FrequencyResponse

TOOL = ("tool_x", "tool_z")
"""The responses of the tool: XX and ZX."""

_ROTATIONS = slice(0, 2)


class HeldHead:
    """
    Receptances of the tool with the base held.

    Parameters
    ----------
    parameters : HeadParameters
        The head.
    s : ndarray of complex, shape (frequency,)
        Laplace variable [rad/s].

    Notes
    -----
    Eqs. 1-3 without the base's motion: H_q = t_qᵀ E⁻¹ t_x with E = K + sC + s²M over (θ1, θ2), and by symmetry
    dH_q = dt_qᵀ v_x + v_qᵀ dt_x - v_qᵀ dE v_x with v = E⁻¹ t.

    Examples
    --------
    >>> from cutvib_ss.parameters import table_3
    >>> HeldHead(table_3(), np.array([0j])).receptance("tool_x").real
    array([1.174e-07])
    """

    def __init__(self, parameters: HeadParameters, s: ComplexArray) -> None:
        self.parameters, self.s = parameters, s
        system = head(parameters)
        self._rows = {name: row[_ROTATIONS] for name, row in system.ports.items()}
        self._inverse = np.linalg.inv(system.dynamic_stiffness(s)[:, _ROTATIONS, _ROTATIONS])
        self._answers = {name: self._inverse @ self._rows[name] for name in TOOL}

    def receptance(self, output: str) -> ComplexArray:
        """Displacement of the tool per unit cutting force, shape (frequency,)."""
        value: ComplexArray = self._answers["tool_x"] @ self._rows[output]
        return value

    def derivative(self, name: str, output: str) -> ComplexArray:
        """Derivative of a receptance to one of the head's parameters, shape (frequency,)."""
        rows, parts = head_changes(self.parameters, name)
        moved, still = {p: row[_ROTATIONS] for p, row in rows.items()}, np.zeros(2)
        v_x, v_q = self._answers["tool_x"], self._answers[output]
        change = v_x @ moved.get(output, still) + v_q @ moved.get("tool_x", still)
        total: ComplexArray = np.asarray(change, dtype=np.complex128)
        for power, part in parts:
            matrix = (np.outer(part, part) if part.ndim == 1 else part)[_ROTATIONS, _ROTATIONS]
            total = total - self.s**power * np.einsum("fi,ij,fj->f", v_q, matrix, v_x)
        return total


def held_response(parameters: HeadParameters, freq: ArrayLike) -> FrequencyResponse:
    """
    Accelerances XX and ZX of the head with its base held.

    Parameters
    ----------
    parameters : HeadParameters
        The head.
    freq : array_like, shape (frequency,)
        Frequencies [Hz].

    Returns
    -------
    FrequencyResponse
        Outputs ``tool_x`` and ``tool_z``; without a position.
    """
    lines = np.atleast_1d(np.asarray(freq, dtype=float))
    s = 2j * np.pi * lines
    model = HeldHead(parameters, s)
    data = np.array([s**2 * model.receptance(output) for output in TOOL])
    nowhere = np.array([np.nan])
    return FrequencyResponse(data[None, :, None, :], lines, nowhere, TOOL, ("force",), ("acceleration", "acceleration"))


def held_natural_frequencies(parameters: HeadParameters) -> FloatArray:
    """
    Undamped natural frequencies of the head with its base held.

    Parameters
    ----------
    parameters : HeadParameters
        The head.

    Returns
    -------
    ndarray, shape (2,)
        Natural frequencies [Hz], ascending.

    Examples
    --------
    >>> from cutvib_ss.parameters import table_3
    >>> held_natural_frequencies(table_3()).round(1)
    array([213.6, 240.9])
    """
    system = head(parameters)
    squares = linalg.eigh(
        system.stiffness[_ROTATIONS, _ROTATIONS], system.mass[_ROTATIONS, _ROTATIONS], eigvals_only=True
    )
    frequencies: FloatArray = np.sqrt(squares) / (2 * np.pi)
    return frequencies
