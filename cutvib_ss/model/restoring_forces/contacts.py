"""
Jenkins elements in parallel, compiled for loops over time.

An element sticks about its centre, within its limit over its stiffness, and beyond drags the centre along (a play operator). Of
elements in the order of those widths the centres differ by no more than the widths do (Krejčí 1996): they begin to slide in that
order, and where the motion turns round all that slid stick. So it is enough to know how many slide, and sums over the others.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from cutvib_ss.model.restoring_forces.compiled import FAST
from cutvib_ss.results import FloatArray


class Contacts(NamedTuple):
    """Where the contacts of some elements stand; each row is an element, the sums are over contacts in their order."""

    own: np.ndarray  # Number of contacts
    springs: FloatArray  # Stiffness of each
    widths: FloatArray  # Displacement from the centre at which each slides
    limits: FloatArray  # Slip forces of those before each, one more than contacts
    stiffness: FloatArray  # Stiffness of those from each on, one more
    centres: FloatArray
    about: FloatArray  # Stiffness times centre of those from each on, one more
    sliding: np.ndarray  # How many slide
    sense: FloatArray  # The way they do, 1 or -1
    last: FloatArray  # Displacement of the port


@numba.njit(fastmath=FAST)
def contacts(sliders: FloatArray) -> Contacts:
    """The contacts of elements, given as stiffness and slip force (element, contact, 2), unloaded at zero."""
    elements, most, _ = sliders.shape
    made = Contacts(
        np.zeros(elements, np.int64),
        np.zeros((elements, most)),
        np.zeros((elements, most)),
        np.zeros((elements, most + 1)),
        np.zeros((elements, most + 1)),
        np.zeros((elements, most)),
        np.zeros((elements, most + 1)),
        np.zeros(elements, np.int64),
        np.ones(elements),
        np.zeros(elements),
    )
    for e in range(elements):
        n = 0
        while n < most and 0.0 < sliders[e, n, 0] < math.inf:
            made.springs[e, n] = sliders[e, n, 0]
            made.widths[e, n] = sliders[e, n, 1] / sliders[e, n, 0]
            made.limits[e, n + 1] = made.limits[e, n] + sliders[e, n, 1]
            n += 1
        made.own[e] = n
        for i in range(n - 1, -1, -1):
            made.stiffness[e, i] = made.stiffness[e, i + 1] + made.springs[e, i]
    return made


@numba.njit(fastmath=FAST)
def place(c: Contacts, e: int, forces: FloatArray, q: float) -> None:
    """Put an element's contacts where these are their forces at a displacement."""
    for i in range(c.own[e] - 1, -1, -1):
        centre = q - forces[i] / c.springs[e, i]
        if i + 1 < c.own[e]:
            apart, other = c.widths[e, i + 1] - c.widths[e, i], c.centres[e, i + 1]
            centre = min(max(centre, other - apart), other + apart)
        c.centres[e, i] = centre
        c.about[e, i] = c.about[e, i + 1] + c.springs[e, i] * centre
    c.sliding[e], c.sense[e], c.last[e] = 0, 1.0, q


@numba.njit(fastmath=FAST)
def read(c: Contacts, e: int, forces: FloatArray) -> None:
    """The contacts' forces."""
    for i in range(c.own[e]):
        if i < c.sliding[e]:
            forces[i] = c.sense[e] * c.springs[e, i] * c.widths[e, i]
        else:
            forces[i] = c.springs[e, i] * (c.last[e] - c.centres[e, i])


@numba.njit(fastmath=FAST, forceinline=True)
def slide(c: Contacts, e: int, q: float) -> float:
    """Force of an element's contacts once its port has moved on, or back, to a displacement; they stay where they stand."""
    m, sense, last = c.sliding[e], c.sense[e], c.last[e]
    if sense * (q - last) >= 0.0:
        while m < c.own[e] and sense * (q - c.centres[e, m]) > c.widths[e, m]:
            m += 1
        return float(sense * c.limits[e, m] + c.stiffness[e, m] * q - c.about[e, m])
    k = 0
    while k < c.own[e]:
        centre = c.centres[e, k] if k >= m else last - sense * c.widths[e, k]
        if sense * (centre - q) <= c.widths[e, k]:
            break
        k += 1
    f = -sense * c.limits[e, k]
    if k < m:
        # Of those that slid, and have not turned round so far as to slide again.
        f += (c.stiffness[e, k] - c.stiffness[e, m]) * (q - last) + sense * (c.limits[e, m] - c.limits[e, k])
        k = m
    return float(f + c.stiffness[e, k] * q - c.about[e, k])


@numba.njit(fastmath=FAST, forceinline=True)
def implicit_slide(c: Contacts, e: int, q: float, a: float) -> tuple[float, int]:
    """
    Force f of an element's contacts at the displacement q - a f, and how many slide there; `move` takes them on.

    q1 + a f(q1) rises with q1: on the way from where they stand ever more slide, and the first number with which none of the
    others has to is that of the root.
    """
    m, sense, last = c.sliding[e], c.sense[e], c.last[e]
    f = sense * c.limits[e, m] + c.stiffness[e, m] * last - c.about[e, m]
    if sense * (q - a * f - last) < 0.0:
        # Those that slid stick where they are, each at its limit.
        for i in range(m - 1, -1, -1):
            c.centres[e, i] = last - sense * c.widths[e, i]
            c.about[e, i] = c.about[e, i + 1] + c.springs[e, i] * c.centres[e, i]
        m, sense = 0, -sense
        c.sliding[e], c.sense[e] = m, sense
    while True:
        f = (sense * c.limits[e, m] + c.stiffness[e, m] * q - c.about[e, m]) / (1.0 + a * c.stiffness[e, m])
        if m == c.own[e] or sense * (q - a * f - c.centres[e, m]) <= c.widths[e, m]:
            return float(f), m
        m += 1


@numba.njit(fastmath=FAST, forceinline=True)
def move(c: Contacts, e: int, q: float, sliding: int) -> None:
    """Take the contacts on to a displacement, at which so many slide."""
    c.last[e], c.sliding[e] = q, sliding
