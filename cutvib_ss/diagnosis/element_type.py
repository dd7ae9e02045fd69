"""
The law that the shape of an unknown dynamic stiffness suggests, before any cause is fitted.

A few laws are fitted to the function by weighted least squares: mass, spring and damper, hysteretic spring, sprung mass
(Eq. 24), a constant gain, a delay. The simplest that leaves little more than the best is named; none is where even the best
leaves much. Level by level, the power of the level with which the function grows tells cubic springs, dry friction, play and the
like apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cutvib_ss.diagnosis.findings import ElementType
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import ComplexArray, FloatArray


@dataclass(frozen=True)
class _Law:
    name: str
    law: str
    parameters: tuple[str, ...]
    columns: Callable[[ComplexArray], Sequence[ComplexArray]]


_LINEAR = (
    _Law("mass", "-ω²m", ("mass",), lambda s: [s**2]),
    _Law("spring", "k", ("stiffness",), lambda s: [1 + 0 * s]),
    _Law("damper", "iωc", ("damping",), lambda s: [s]),
    _Law("spring and damper", "k + iωc", ("stiffness", "damping"), lambda s: [1 + 0 * s, s]),
    _Law("hysteretic spring", "k(1 + iη)", ("stiffness", "loss stiffness"), lambda s: [1 + 0 * s, 1j + 0 * s]),
    _Law("mass, spring and damper", "k + iωc - ω²m", ("stiffness", "damping", "mass"), lambda s: [1 + 0 * s, s, s**2]),
)


def element_type_of(quantity: str, freq: FloatArray, value: ComplexArray, std: FloatArray) -> ElementType | None:
    """The simplest law that explains an unknown dynamic stiffness."""
    usable = np.isfinite(value) & np.isfinite(std) & (std > 0)
    if quantity == "compliance":
        # Where the function was left at nothing, no stiffness can be told.
        usable &= value != 0
    if np.count_nonzero(usable) < 8:
        return None
    s: ComplexArray = np.asarray(2j * np.pi * freq[usable], dtype=np.complex128)
    z, spread = value[usable], np.hypot(std[usable], SETTINGS.type_floor * np.abs(value[usable]))
    if quantity == "gain":
        tried = [*_gains(s, z, spread)]
    elif quantity == "dynamic stiffness":
        tried = [*(_fitted(law, s, z, spread) for law in _LINEAR), _sprung(s, z, spread)]
    elif quantity == "compliance":
        # In series the stiffness is the reciprocal, and so is its error.
        whole = [_fitted(law, s, 1 / z, spread / np.abs(z) ** 2) for law in _LINEAR]
        tried = [*whole, _mode(s, z, spread)]
    else:
        tried = [_fitted(_Law("constant", "constant", ("change",), lambda s: [1 + 0 * s]), s, z, spread)]
    best: ElementType | None = None
    for element_type in sorted(tried, key=lambda f: len(f.parameters)):
        left = 1.0 - element_type.share
        if best is None or left < (1.0 - best.share) * SETTINGS.type_simpler ** (
            len(element_type.parameters) - len(best.parameters)
        ):
            best = element_type
    return best if best is not None and best.share >= SETTINGS.type_explains else None


def element_type_value(element_type: ElementType, quantity: str, freq: FloatArray) -> ComplexArray:
    """A named law over frequency, as the function that it was found in."""
    s: ComplexArray = np.asarray(2j * np.pi * freq, dtype=np.complex128)
    values = list(element_type.parameters.values())
    if element_type.name == "delay":
        return np.asarray(np.exp(-s * values[0]) - 1.0, dtype=np.complex128)
    if element_type.name == "gain":
        return np.asarray(values[0] - 1.0 + 0 * s, dtype=np.complex128)
    if element_type.name == "sprung mass":
        return values[0] * _sprung_shape(s, 2 * np.pi * values[1], values[2])
    if element_type.name == "mode":
        return _mode_shape(s, 2 * np.pi * values[1], values[2]) / values[0]
    law = next((x for x in _LINEAR if x.name == element_type.name), None)
    columns = [1 + 0 * s] if law is None else law.columns(s)
    total: ComplexArray = sum((v * c for v, c in zip(values, columns, strict=True)), 0 * s)
    return 1.0 / total if quantity == "compliance" else total


def _sprung_shape(s: ComplexArray, w: float, zeta: float) -> ComplexArray:
    spring = w * w + 2 * zeta * w * s
    return s * s * spring / (spring + s * s)


def _mode_shape(s: ComplexArray, w: float, zeta: float) -> ComplexArray:
    return 1.0 / (s * s + 2 * zeta * w * s + w * w)


def _solved(columns: Sequence[ComplexArray], z: ComplexArray, spread: FloatArray) -> tuple[FloatArray, float]:
    """Real coefficients, and the part of the weighted squares that they explain."""
    a = np.array(columns).T / spread[:, None]
    b = z / spread
    both = np.concatenate([a.real, a.imag])
    size = np.linalg.norm(both, axis=0) + 1e-300
    flat = np.concatenate([b.real, b.imag])
    found, *_ = np.linalg.lstsq(both / size, flat, rcond=None)
    left = flat - (both / size) @ found
    return found / size, 1.0 - float(left @ left / max(float(flat @ flat), 1e-300))


def _fitted(law: _Law, s: ComplexArray, z: ComplexArray, spread: FloatArray) -> ElementType:
    found, share = _solved(law.columns(s), z, spread)
    return ElementType(law.name, law.law, dict(zip(law.parameters, found.tolist(), strict=True)), share)


def _over_resonances(
    shape: Callable[[ComplexArray, float, float], ComplexArray], s: ComplexArray, z: ComplexArray, spread: FloatArray
) -> tuple[float, float, float, float]:
    """Frequency [Hz], damping ratio and coefficient of a resonance that explain most, and the part explained."""
    low, high = float(s[0].imag) / (2 * np.pi), float(s[-1].imag) / (2 * np.pi)
    best = (low, SETTINGS.type_dampings[0], 0.0, -np.inf)
    b, grid = z / spread, np.geomspace(max(low, 1e-3), high, SETTINGS.type_resonances)
    power = float(np.real(np.vdot(b, b)))
    for _ in range(3):
        for f in grid:
            for zeta in SETTINGS.type_dampings:
                column = shape(s, 2 * np.pi * f, zeta) / spread
                along = float(np.real(np.vdot(column, b)))
                share = along**2 / max(float(np.real(np.vdot(column, column))) * power, 1e-300)
                if share > best[3]:
                    best = (float(f), zeta, along / float(np.real(np.vdot(column, column))), share)
        step = (grid[1] / grid[0]) ** 0.9
        grid = np.geomspace(best[0] / step, best[0] * step, 9)
    return best


def _sprung(s: ComplexArray, z: ComplexArray, spread: FloatArray) -> ElementType:
    f, zeta, mass, share = _over_resonances(_sprung_shape, s, z, spread)
    return ElementType(
        "sprung mass", "ms²(ω₀² + 2ζω₀s)/(s² + 2ζω₀s + ω₀²)",
        {"mass": mass, "frequency": f, "damping_ratio": zeta}, share,
    )  # fmt: skip


def _mode(s: ComplexArray, z: ComplexArray, spread: FloatArray) -> ElementType:
    f, zeta, factor, share = _over_resonances(_mode_shape, s, z, spread)
    parameters = {"inertia": 1 / factor if factor else np.inf, "frequency": f, "damping_ratio": zeta}
    return ElementType("mode", "1/(m(ω₀² + 2ζω₀s + s²))", parameters, share)


def _gains(s: ComplexArray, u: ComplexArray, spread: FloatArray) -> list[ElementType]:
    """A gain is 1 + u: constant, late, or both."""
    plain = _Law("gain", "g", ("gain",), lambda s: [1 + 0 * s])
    found = [_fitted(plain, s, u, spread)]
    found[0].parameters["gain"] += 1.0
    # e^(-sτ) is linear in τ for the phase alone.
    late = float(-np.sum(np.unwrap(np.angle(1 + u)) * s.imag / spread**2) / np.sum(s.imag**2 / spread**2))
    left = np.sum(np.abs(1 + u - np.exp(-s * late)) ** 2 / spread**2)
    share = 1.0 - float(left / np.sum(np.abs(u) ** 2 / spread**2))
    found.append(ElementType("delay", "e^(-iωτ)", {"delay": late}, share))
    return found


def with_level(freq: FloatArray, levels: FloatArray, value: ComplexArray, std: FloatArray) -> str:
    """How a function of frequency changes with the level."""
    known = np.isfinite(value) & np.isfinite(std) & (std > 0) & np.isfinite(levels)[:, None]
    weight = np.where(known, std, np.inf) ** -2.0
    # A level at which the records say nothing of the function says nothing of its change either.
    told = weight.sum(axis=1) > 0
    levels, value, weight = levels[told], value[told], weight[told]
    if levels.size < 2:
        return ""
    value, rate = np.nan_to_num(value), 2 * np.pi * freq
    stiffness = np.sum(weight * value.real, axis=1) / weight.sum(axis=1)
    damping = np.sum(weight * rate * value.imag, axis=1) / np.sum(weight * rate**2, axis=1)
    # Where the function is known best both are forces.
    working = float(np.sum(weight * rate) / weight.sum())
    part, name = stiffness, "stiffness"
    if np.ptp(damping) * working > np.ptp(stiffness):
        part, name = damping, "damping"
    if np.ptp(part) < SETTINGS.type_changes * np.abs(part).max():
        return ""
    if levels.size == 2 and part[0] * part[1] < 0:
        return f"{name} that {'grows' if part[1] > part[0] else 'falls'} with the level"
    power, grows = _power(levels, part)
    text = f"{name} that changes with the level to the power {power:.1f}"
    # Motion grows faster or slower than the level, so that powers are rough: their sign tells most.
    laws = {
        "stiffness": (
            (1.0, 3.0, "a cubic spring stiffens so" if grows > 0 else "a softening cubic spring does so"),
            (-3.0, -0.3, "play takes stiffness away so" if grows < 0 else "dry friction that sticks adds stiffness so"),
        ),
        "damping": ((0.4, 3.0, "damping that grows with speed does so"), (-3.0, -0.4, "dry friction does so")),
    }
    law = next((law for low, high, law in laws[name] if low <= power <= high), "")
    return f"{text}: {law}" if law else text


def _power(levels: FloatArray, part: FloatArray) -> tuple[float, float]:
    """Power p and coefficient b of a + b level^p; what tuning took over is in a, which two levels cannot tell."""
    ratio = levels / levels[-1]
    best = (0.0, 0.0, np.inf)
    for power in SETTINGS.type_powers:
        columns = [ratio**power, np.ones(levels.size)] if levels.size > 2 else [ratio**power]
        # Relative errors: the quiet levels count as much as the loud ones.
        size = np.hypot(part, 0.02 * np.abs(part).max())
        found, *_ = np.linalg.lstsq(np.array(columns).T / size[:, None], part / size, rcond=None)
        left = float(np.sum(((np.array(columns).T @ found - part) / size) ** 2))
        if left < best[2]:
            best = (float(power), float(found[0]), left)
    return best[:2]
