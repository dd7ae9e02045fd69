"""Finite elements of the rig: beams, slender or that shear, and plates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LOBATTO = np.array([0.0, 0.5 - 0.5 / np.sqrt(5.0), 0.5 + 0.5 / np.sqrt(5.0), 1.0])
"""Nodes of a beam that shears, as parts of its length."""


def beam_element(h: float, ei: float, mu: float) -> tuple[Array, Array]:
    """Mass and stiffness of a slender beam over deflection and slope at both ends: Hermite's shapes."""
    k = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h]]
    k += [[-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]
    m = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h]]
    m += [[54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]
    return mu * h / 420 * np.array(m), ei / h**3 * np.array(k)


def shearing_beam_element(h: float, ei: float, mu: float, kga: float, rotary: float) -> tuple[Array, Array]:
    """Mass and stiffness over (w, s) at four nodes (`LOBATTO`): deflection and turn of the section are cubics of their own."""
    x, weight = np.polynomial.legendre.leggauss(6)
    x, weight = (x + 1) / 2, h * weight / 2
    powers = np.linalg.inv(np.vander(LOBATTO, increasing=True))  # coefficients of the four shapes, by column
    value = np.vander(x, 4, increasing=True) @ powers
    slope = np.column_stack([np.zeros_like(x), np.ones_like(x), 2 * x, 3 * x**2]) @ powers / h
    w, s = np.zeros((x.size, 8)), np.zeros((x.size, 8))
    dw, ds = np.zeros((x.size, 8)), np.zeros((x.size, 8))
    w[:, 0::2], s[:, 1::2], dw[:, 0::2], ds[:, 1::2] = value, value, slope, slope

    def integral(shape: Array) -> Array:
        return np.asarray((shape.T * weight) @ shape)

    return mu * integral(w) + rotary * integral(s), ei * integral(ds) + kga * integral(dw - s)


def plate_element(a: float, b: float, density: float, poisson: float) -> tuple[Array, Array]:
    """Mass and stiffness of a plate a by b, flexural rigidity 1, over (w, w_y, -w_x) at corners (0, 0), (a, 0), (a, b), (0, b)."""
    powers = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3), (3, 1), (1, 3)]

    def terms(x: float, y: float, dx: int, dy: int) -> Array:
        def one(p: int, t: float, d: int) -> float:
            return 0.0 if p < d else float(np.prod(np.arange(p, p - d, -1)) * t ** (p - d))

        return np.array([one(p, x, dx) * one(q, y, dy) for p, q in powers])

    rows = []
    for x, y in ((0.0, 0.0), (a, 0.0), (a, b), (0.0, b)):
        rows += [terms(x, y, 0, 0), terms(x, y, 0, 1), -terms(x, y, 1, 0)]
    shapes = np.linalg.inv(np.array(rows))
    rigidity = np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    mass, stiffness = np.zeros((12, 12)), np.zeros((12, 12))
    points, weights = np.polynomial.legendre.leggauss(5)
    for px, wx in zip(points, weights, strict=True):
        for py, wy in zip(points, weights, strict=True):
            x, y, w = (px + 1) * a / 2, (py + 1) * b / 2, wx * wy * a * b / 4
            n = terms(x, y, 0, 0) @ shapes
            bend = np.array([terms(x, y, 2, 0), terms(x, y, 0, 2), 2 * terms(x, y, 1, 1)]) @ shapes
            mass += w * density * np.outer(n, n)
            stiffness += w * bend.T @ rigidity @ bend
    return mass, stiffness
