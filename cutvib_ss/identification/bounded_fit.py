"""
Bounded fit of the head's ten parameters to measured responses XX and ZX (Section 5, Eqs. 21 and 22, corrected).

Eq. 21 as printed, C_X (k_X² α_XX² - H_XX²) + C_Z (k_Z² α_ZX² - H_ZX²), is a signed difference of squares: nothing
bounds it from below, and its least value is not where model and measurement agree. What is minimised here is

    J = Σ_ω  C_X k_X² |α_XX - H_XX|² + C_Z k_Z² |α_ZX - H_ZX|²,

over complex values, so that phases count too. The scale factors stand before both responses: before the model's alone,
as printed, they would say that the measured ZX is a tenth of the model's, and responses computed with Table 3 would
not be best fitted by Table 3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians
from typing import TypeAlias

import numpy as np
from scipy import optimize

from cutvib_ss.errors import IdentificationError
from cutvib_ss.identification.fitted_data import FitData
from cutvib_ss.identification.held_head import HeldHead
from cutvib_ss.model.head import HEAD_PARAMETERS
from cutvib_ss.model.machine import Machine
from cutvib_ss.parameters import HeadParameters
from cutvib_ss.response.frequency import ChainedResponse
from cutvib_ss.results import ComplexArray, FloatArray, read_only
from cutvib_ss.units import DERIVATIVE_ORDER

Bounds: TypeAlias = tuple[HeadParameters, HeadParameters]

_ON_BOUND = 1e-4
"""A parameter this close to a bound, as a part of the range between its bounds, lies on it."""
_DOUBTFUL = 1e-3
"""A fit that leaves more than this of the data's power may have ended in a local minimum."""


class HeadModel:
    """The model that is fitted: the head with its base held, or the machine at a position."""

    def __init__(self, data: FitData, machine: Machine | None) -> None:
        self.data, self.machine = data, machine
        self._s = np.asarray(data.frf.decay_rate + 1j * data.frf.omega, dtype=np.complex128)
        if machine is not None and np.isnan(data.frf.positions[0]):
            raise IdentificationError("a fit of the machine on its rail needs the position of the record, y_b / L")

    def evaluate(self, head: HeadParameters) -> tuple[ComplexArray, ComplexArray]:
        """Responses and their derivatives to the ten parameters."""
        frf = self.data.frf
        if self.machine is not None:
            machine = replace(self.machine, head=head)
            response = ChainedResponse(machine, frf.positions, self._s, frf.quantities, frf.outputs, frf.inputs)
            slopes = [response.derivative(("head", name))[0, :, 0] for name in HEAD_PARAMETERS]
            return response.data()[0, :, 0], np.stack(slopes, axis=-1)
        held = HeldHead(head, self._s)
        factor = np.array([self._s ** DERIVATIVE_ORDER[q] for q in frf.quantities])
        values = np.array([held.receptance(o) for o in frf.outputs])
        rows = [[held.derivative(name, o) for name in HEAD_PARAMETERS] for o in frf.outputs]
        return factor * values, factor[..., None] * np.array(rows).transpose(0, 2, 1)


def vector(head: HeadParameters) -> FloatArray:
    """The ten parameters in the tables' order."""
    return np.array([getattr(head, name) for name in HEAD_PARAMETERS])


def head_of(values: FloatArray, source: str = "") -> HeadParameters:
    """A head from its ten parameters."""
    m1, m2, l1, l2, theta01, theta02, k1, k2, c1, c2 = map(float, values)
    return HeadParameters(m1, m2, l1, l2, theta01, theta02, k1, k2, c1, c2, source=source)


def bounds_around(head: HeadParameters) -> Bounds:
    """
    Bounds for a machine that Table 2 was not made for.

    Parameters
    ----------
    head : HeadParameters
        What is believed of the head.

    Returns
    -------
    lower, upper : HeadParameters
        At least as wide as Table 2: masses and stiffnesses ±20 %, lengths ±10 %, angles ±10°, and dampings from a fifth
        to three times, since Eq. 20 only guesses them.
    """
    share = {"m1": 0.2, "m2": 0.2, "l1": 0.1, "l2": 0.1, "k1": 0.2, "k2": 0.2}
    low, high = {}, {}
    for name in HEAD_PARAMETERS:
        value = getattr(head, name)
        if name in share:
            low[name], high[name] = value * (1 - share[name]), value * (1 + share[name])
        elif name.startswith("theta"):
            low[name], high[name] = value - radians(10.0), value + radians(10.0)
        else:
            low[name], high[name] = value / 5, max(3 * value, 1e-9)
    return HeadParameters(**low, source="around the start"), HeadParameters(**high, source="around the start")


@dataclass(frozen=True)
class HeadFit:
    """
    A bounded fit of the head's parameters.

    Parameters
    ----------
    head : HeadParameters
        The fitted parameters.
    bounds : tuple of HeadParameters
        Lower and upper bounds (Eq. 22).
    on_bound : mapping of str to str
        Parameters that lie on a bound, with ``"lower"`` or ``"upper"``.
    objective : float
        J at the fit, over that of a model that answers nothing.
    jacobian : array_like, shape (residual, 10)
        Weighted residuals' derivatives to the parameters as parts of their ranges.
    residual : array_like, shape (residual,)
        Weighted residuals, real parts then imaginary parts.
    evaluations : int
        Number of evaluations of the model.
    """

    head: HeadParameters
    bounds: Bounds
    on_bound: dict[str, str]
    objective: float
    jacobian: FloatArray
    residual: FloatArray
    evaluations: int

    def __post_init__(self) -> None:
        for name in ("jacobian", "residual"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))


def bounded_fit(data: FitData, bounds: Bounds, start: HeadParameters, machine: Machine | None = None) -> HeadFit:
    """
    The ten parameters within bounds that bring the model closest to the data.

    Parameters
    ----------
    data : FitData
        What is fitted.
    bounds : tuple of HeadParameters
        Lower and upper bounds.
    start : HeadParameters
        First guess X_0; brought inside the bounds where it lies outside.
    machine : Machine, optional
        The machine whose head is fitted, at the data's position; by default the base is held, as in the paper.

    Returns
    -------
    HeadFit
        The fit.

    Raises
    ------
    IdentificationError
        If a lower bound is not below the upper one, or the fit does not converge.

    Notes
    -----
    Trust-region least squares on the parameters as parts of the ranges between their bounds, with analytic derivatives.
    The data leave directions open; along these the fit stays near its start. One random start in a hundred leads into a
    local minimum, so a fit that leaves more than a thousandth of the data's power is tried again from midway between
    the bounds.
    """
    low, high = vector(bounds[0]), vector(bounds[1])
    wrong = [n for n, a, b in zip(HEAD_PARAMETERS, low, high, strict=True) if not a < b]
    if wrong:
        raise IdentificationError(f"the lower bound of {', '.join(wrong)} must lie below the upper one")
    width = high - low
    model = HeadModel(data, machine)
    root = np.sqrt(data.weights)
    cache: dict[bytes, tuple[FloatArray, FloatArray]] = {}

    def both(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        key = u.tobytes()
        if key not in cache:
            cache.clear()
            values, by_parameter = model.evaluate(head_of(low + width * u))
            error = root * (values - data.measured)
            change = (root[..., None] * by_parameter * width).reshape(-1, width.size)
            cache[key] = (
                np.concatenate([error.real.ravel(), error.imag.ravel()]),
                np.vstack([change.real, change.imag]),
            )
        return cache[key]

    def residuals(u: FloatArray) -> FloatArray:
        return both(u)[0]

    def slopes(u: FloatArray) -> FloatArray:
        return both(u)[1]

    def descend(u: FloatArray) -> tuple[FloatArray, float, int]:
        fit = optimize.least_squares(
            residuals, u, slopes, bounds=(np.zeros(u.size), np.ones(u.size)),
            xtol=1e-10, ftol=1e-12, gtol=1e-12, max_nfev=500, tr_solver="exact",
        )  # fmt: skip
        return fit.x, float(2.0 * fit.cost) if fit.success else np.inf, int(fit.nfev)

    silent = float(np.sum(data.weights * np.abs(data.measured) ** 2))
    best, cost, evaluations = descend(np.clip((vector(start) - low) / width, 1e-3, 1.0 - 1e-3))
    if cost > _DOUBTFUL * silent:
        again, other, more = descend(np.full(low.size, 0.5))
        evaluations += more
        if other < cost:
            best, cost = again, other
    if not np.isfinite(cost):
        raise IdentificationError(f"the fit did not converge in {evaluations} evaluations; try another start or band")
    residual, jacobian = both(best)
    on_bound = {n: "lower" for n, u in zip(HEAD_PARAMETERS, best, strict=True) if u < _ON_BOUND}
    on_bound |= {n: "upper" for n, u in zip(HEAD_PARAMETERS, best, strict=True) if u > 1.0 - _ON_BOUND}
    fitted = head_of(low + width * best, "bounded fit")
    return HeadFit(fitted, bounds, on_bound, cost / silent, jacobian, residual, evaluations)
