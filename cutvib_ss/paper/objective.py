"""Eq. 21 as it is printed, and where it is least on Table 2's box."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy import optimize

from cutvib_ss.identification.bounded_fit import head_of, vector
from cutvib_ss.identification.held_head import held_response
from cutvib_ss.parameters import HeadParameters, table_2, table_3
from cutvib_ss.results import FloatArray

_FREQ = np.arange(150.0, 300.5, 0.5)
_WEIGHTS = (1.0, 0.25)
"""C_X and C_Z, as stated beside Table 3."""
_SCALES = (1.0, 0.1)
"""k_X and k_Z."""


class LeastEq21(NamedTuple):
    """Least value on Table 2's box, the head there, and the value at Table 3 [(m/s^2/N)^2]."""

    least: float
    head: HeadParameters
    at_table_3: float


def eq_21(head: HeadParameters, measured: FloatArray) -> float:
    """Σ_ω C_X (k_X² α_XX² - H_XX²) + C_Z (k_Z² α_ZX² - H_ZX²), squares of moduli of accelerance; measured (2, frequency)."""
    model = np.abs(held_response(head, _FREQ).data[0, :, 0])
    terms = [c * np.sum(k**2 * a**2 - h**2) for c, k, a, h in zip(_WEIGHTS, _SCALES, model, measured, strict=True)]
    return float(sum(terms))


@cache
def least_of_eq_21(starts: int = 6, seed: int = 0) -> LeastEq21:
    """Bounded descents from random starts on Table 2's box; the measurement is what Table 3 itself answers."""
    low, high = map(vector, table_2())
    measured = np.abs(held_response(table_3(), _FREQ).data[0, :, 0])
    rng = np.random.default_rng(seed)

    def value(u: FloatArray) -> float:
        return eq_21(head_of(low + u * (high - low)), measured)

    descend: Any = optimize.minimize  # its annotations know fewer signatures than it has
    box = [(0.0, 1.0)] * low.size
    found = [descend(value, rng.uniform(size=low.size), bounds=box, method="L-BFGS-B") for _ in range(starts)]
    best = min(found, key=lambda r: float(r.fun))
    return LeastEq21(float(best.fun), head_of(low + best.x * (high - low)), eq_21(table_3(), measured))
