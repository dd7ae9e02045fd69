"""
Compiled loops of the harmonic balance, second half: the balance itself, Newton's method, and continuation along a sweep.

Unknowns are real: of each port the mean, where it has one, then a cosine and a sine of each harmonic. The residual is
R = x - H(ω) f0 + A(kω) F(x), harmonic by harmonic, with F the laws' forces (`cutvib_ss.response.compiled_forces`) and H and A the
model's receptances as sums over its modes.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from cutvib_ss.model.restoring_forces.packed import Packed
from cutvib_ss.response.compiled_forces import forces
from cutvib_ss.response.port_motion import System, Tables
from cutvib_ss.results import ComplexArray, FloatArray

_TURN = 1e-7
"""Relative step of the derivative to frequency."""
_NEWTON = 12
"""Steps of Newton's method at most."""
_SAME = 1e-9
"""Residual, relative to the motion, at which it ends."""
_CLOSE = 1e-4
"""The same on the way between lines; the step there is to be less than a hundred times this part of an arc of one."""
_LONGEST = 1.0
"""Longest arc: a fifth of the motion's size, or as much as `sweep` allows in frequency."""
_SHORTEST = 1e-5
"""Shortest arc, at which a curve is given up."""
_CORNER = 1e-3
"""Arc below which the curve may turn sharply."""
_STRAIGHT = 0.01
"""Square of how far a curve turned aside over its arc, up to which the next arc is longer."""
_ALONG = 0.01
"""Square of a step in frequency over one of the motion, both in arcs, from which it tells of the derivative to frequency."""
_ARC_OF_MOTION = 0.2
"""Change of the motion over its size that counts as an arc of one."""


@numba.njit(cache=True)
def _receptance(system: System, s: complex) -> tuple[ComplexArray, ComplexArray]:
    """Displacement of the ports per unit force at the input (port,), and at the ports (port, port)."""
    poles, drives, shapes = system
    ports = shapes.shape[0]
    by_force = np.zeros(ports, dtype=np.complex128)
    own = np.zeros((ports, ports), dtype=np.complex128)
    for m in range(poles.size):
        up, down = 0.5 / (s - poles[m]), 0.5 / (s - poles[m].conjugate())
        for j in range(ports):
            r = shapes[j, m] * drives[m, 0]
            by_force[j] += r * up + r.conjugate() * down
            for i in range(ports):
                r = shapes[j, m] * drives[m, 1 + i]
                own[j, i] += r * up + r.conjugate() * down
    return by_force, own


@numba.njit(cache=True)
def balance(
    x: FloatArray,
    omega: float,
    force: float,
    system: System,
    elements: Packed,
    tables: Tables,
    residual: FloatArray,
    jacobian: FloatArray,
    harmonics: FloatArray,
    slopes: FloatArray,
) -> None:
    """Residual of the harmonic balance at a motion x of the ports, its derivatives, and the forces' harmonics and slopes."""
    laws, values, sliders = elements
    numbers, n = tables[0], tables[1].shape[0]
    ports = laws.size
    for j in range(ports):
        at_port = slice(j * n, (j + 1) * n)
        forces(x[at_port], omega, laws, j, values, sliders, tables, harmonics[at_port], slopes[j])
    for row in range(x.size):
        residual[row] = x[row]
        for w in range(x.size):
            jacobian[row, w] = 1.0 if row == w else 0.0
    at = 0
    for k in numbers:
        # On the real axis the mean's receptance is real; so close to zero it is the static one.
        s = complex(1e-5 * omega, 0.0) if k == 0 else complex(0.0, k * omega)
        by_force, own = _receptance(system, s)
        for j in range(ports):
            row = j * n + at
            if k == 1:
                residual[row] -= by_force[j].real * force
                residual[row + 1] += by_force[j].imag * force
            for i in range(ports):
                a, b, c = own[j, i].real, own[j, i].imag, i * n + at
                if k == 0:
                    residual[row] += a * harmonics[c]
                    for w in range(n):
                        jacobian[row, i * n + w] += a * slopes[i, at, w]
                    continue
                # (a + ib)(F_c - iF_s)
                residual[row] += a * harmonics[c] + b * harmonics[c + 1]
                residual[row + 1] += a * harmonics[c + 1] - b * harmonics[c]
                for w in range(n):
                    real, imag = slopes[i, at, w], slopes[i, at + 1, w]
                    jacobian[row, i * n + w] += a * real + b * imag
                    jacobian[row + 1, i * n + w] += a * imag - b * real
        at += 1 if k == 0 else 2


@numba.njit(cache=True)
def _size(x: FloatArray) -> float:
    total = 0.0
    for value in x:
        total += value * value
    return math.sqrt(total)


@numba.njit(cache=True)
def _solve(a: FloatArray, b: FloatArray) -> None:
    """The solution of a small system, in place of its right side, by elimination with pivots; quicker to compile than LAPACK's."""
    n = b.size
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            for w in range(k, n):
                a[k, w], a[best, w] = a[best, w], a[k, w]
            b[k], b[best] = b[best], b[k]
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            for w in range(k + 1, n):
                a[i, w] -= factor * a[k, w]
            b[i] -= factor * b[k]
    for k in range(n - 1, -1, -1):
        for w in range(k + 1, n):
            b[k] -= a[k, w] * b[w]
        b[k] /= a[k, k]


@numba.njit(cache=True)
def newton(x: FloatArray, omega: float, force: float, system: System, elements: Packed, tables: Tables) -> bool:
    """The solution at a frequency, in place of a motion x close by; whether there is one."""
    n = x.size
    r, j, f = np.zeros(n), np.zeros((n, n)), np.zeros(n)
    slopes = np.zeros((elements.laws.size, tables[1].shape[0], tables[1].shape[0]))
    for _ in range(_NEWTON):
        balance(x, omega, force, system, elements, tables, r, j, f, slopes)
        left = _size(r)
        if not math.isfinite(left):
            return False
        small = left <= _SAME * _size(x)
        _solve(j, r)
        for k in range(n):
            x[k] -= r[k]
        if small:
            return True
    return False


@numba.njit(cache=True)
def _between(omega: float, omegas: FloatArray, force: FloatArray) -> float:
    """The force at a frequency between lines, linear; beyond the lines that of the last."""
    low, high = 0, omegas.size - 1
    if high == 0:
        return float(force[0])
    sign = 1.0 if omegas[high] > omegas[0] else -1.0
    while high - low > 1:
        middle = (low + high) // 2
        if sign * (omega - omegas[middle]) >= 0.0:
            low = middle
        else:
            high = middle
    part = min(max((omega - omegas[low]) / (omegas[high] - omegas[low]), 0.0), 1.0)
    return float(force[low] + part * (force[high] - force[low]))


@numba.njit(cache=True)
def _at_line(
    out: FloatArray,
    guess: FloatArray,
    omega: float,
    force: float,
    path: float,
    near: float,
    system: System,
    elements: Packed,
    tables: Tables,
) -> bool:
    """The motion at a line, within a distance of what is expected of it under the path's force; whether there is one."""
    # The line's own force is close to that. Where there is no motion under it close by, beside a fold, it is in proportion.
    trial, ratio, far = guess.copy(), force / path, 0.0
    if not newton(trial, omega, path, system, elements, tables):
        return False
    for k in range(guess.size):
        far += (trial[k] - guess[k]) ** 2
        out[k] = trial[k] = ratio * trial[k]
    if abs(ratio - 1.0) > 1e-12 and newton(trial, omega, force, system, elements, tables):
        aside = 0.0
        for k in range(guess.size):
            aside += (trial[k] - out[k]) ** 2
        if aside <= (_ARC_OF_MOTION * _size(out)) ** 2:
            for k in range(guess.size):
                out[k] = trial[k]
    return far <= near * near


@numba.njit(cache=True)
def sweep(
    start: FloatArray,
    omegas: FloatArray,
    force: FloatArray,
    path: FloatArray,
    system: System,
    elements: Packed,
    tables: Tables,
    reach: float,
) -> tuple[int, FloatArray, bool]:
    """
    Steady motion along a sweep of frequency, the force given at its lines, from the motion at the first.

    Lines found, motions, and whether the curve folds.

    The curve is followed under a smooth force `path`, with which the motion starts, and left for each line's own.

    Pseudo-arclength continuation (Keller 1977) in the motion over its size and the frequency over ``reach``. Where the curve folds
    it runs back along the unstable branch to the next fold; a line counts when it is reached for the first time, so that the
    sweep jumps as a slow one does. Fewer lines than all where the curve was lost.
    """
    lines, n, ports = omegas.size, start.size, elements.laws.size
    sign = 1.0 if lines < 2 or omegas[-1] > omegas[0] else -1.0
    motions = np.zeros((lines, n))
    x, new, guess = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(n):
        x[k] = start[k]
    _at_line(motions[0], start, omegas[0], force[0], path[0], _ARC_OF_MOTION * _size(start), system, elements, tables)
    omega, done, arc, folds = omegas[0], 1, 0.1, False
    r, j, f, slopes = np.zeros(n), np.zeros((n, n)), np.zeros(n), np.zeros((ports, n // ports, n // ports))
    turned, turning, spare = np.zeros(n), np.zeros(n), np.zeros((n, n))
    bordered, right = np.zeros((n + 1, n + 1)), np.zeros(n + 1)
    tangent = np.zeros(n + 1)
    tangent[n] = sign
    for _ in range(200 * lines + 1000):
        if done == lines:
            break
        size = _ARC_OF_MOTION * _size(x)
        # The tangent: the kernel of (∂R/∂x, ∂R/∂ω), both scaled, on the side of the last one.
        balance(x, omega, _between(omega, omegas, path), system, elements, tables, r, j, f, slopes)
        ahead = omega * (1.0 + _TURN)
        balance(x, ahead, _between(ahead, omegas, path), system, elements, tables, turned, spare, f, slopes)
        for k in range(n):
            turned[k] = (turned[k] - r[k]) / (omega * _TURN) * (reach / size)
            right[k] = 0.0
        right[n] = 1.0
        _border(bordered, j, turned, tangent)
        _solve(bordered, right)
        length = _size(right)
        for k in range(n + 1):
            tangent[k] = right[k] / length
        while True:
            for k in range(n):
                guess[k] = new[k] = x[k] + arc * size * tangent[k]
                turning[k] = turned[k]
            ahead = there = omega + arc * reach * tangent[n]
            steps, found = 0, False
            while steps < _NEWTON and there > 0.0 and not found:
                steps += 1
                balance(new, there, _between(there, omegas, path), system, elements, tables, r, j, f, slopes)
                left = _size(r)
                if not math.isfinite(left):
                    break
                if steps > 1:
                    # What the last step has left tells how far ∂R/∂ω has changed since the arc's start.
                    squares = 0.0
                    for k in range(n):
                        squares += right[k] * right[k]
                    part = right[n] / (right[n] * right[n] + _ALONG * squares + 1e-300)
                    for k in range(n):
                        turning[k] += part * r[k] / size
                _border(bordered, j, turning, tangent)
                for k in range(n):
                    right[k] = -r[k] / size
                right[n] = 0.0
                _solve(bordered, right)
                for k in range(n):
                    new[k] += size * right[k]
                there += reach * right[n]
                found = left <= _CLOSE * arc * _size(new) and _size(right) < 100.0 * _CLOSE * arc
            # A corrector that goes far has found another part of the curve.
            aside = ((there - ahead) / reach) ** 2
            for k in range(n):
                aside += ((new[k] - guess[k]) / size) ** 2
            # Short of that the curve has a corner, where an element begins to slide, and turns at any length.
            allowed = arc * arc * (0.25 if arc > _CORNER else 9.0)
            good, reached = found and aside < allowed, done
            while good and reached < lines and sign * (there - omegas[reached]) >= 0.0:
                part = (omegas[reached] - omega) / (there - omega)
                for k in range(n):
                    guess[k] = x[k] + part * (new[k] - x[k])
                near = math.sqrt(max(4.0 * allowed, arc * arc)) * size
                good = _at_line(
                    motions[reached],
                    guess,
                    omegas[reached],
                    force[reached],
                    path[reached],
                    near,
                    system,
                    elements,
                    tables,
                )
                reached += 1
            if good:
                break
            arc *= 0.5
            if arc < _SHORTEST:
                return done, motions, folds
        folds = folds or sign * (there - omega) < 0.0
        done, omega = reached, there
        for k in range(n):
            x[k] = new[k]
        arc = min(arc * (1.5 if steps <= 4 and aside < _STRAIGHT * arc * arc else 0.8), _LONGEST)
    return done, motions, folds


@numba.njit(cache=True)
def balances(
    motions: FloatArray, omegas: FloatArray, system: System, elements: Packed, tables: Tables
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Residuals, Jacobians, harmonics and slopes of many lines, as `balance` gives them, without force."""
    lines, n = motions.shape
    ports, width = elements.laws.size, tables[1].shape[0]
    residuals, jacobians, harmonics = np.zeros((lines, n)), np.zeros((lines, n, n)), np.zeros((lines, n))
    slopes = np.zeros((lines, ports, width, width))
    for k in range(lines):
        balance(
            motions[k], omegas[k], 0.0, system, elements, tables, residuals[k], jacobians[k], harmonics[k], slopes[k]
        )
    return residuals, jacobians, harmonics, slopes


@numba.njit(cache=True)
def _border(bordered: FloatArray, jacobian: FloatArray, by_omega: FloatArray, tangent: FloatArray) -> None:
    n = by_omega.size
    for k in range(n):
        for w in range(n):
            bordered[k, w] = jacobian[k, w]
        bordered[k, n] = by_omega[k]
        bordered[n, k] = tangent[k]
    bordered[n, n] = tangent[n]
