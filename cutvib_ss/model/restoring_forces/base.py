"""What a restoring force is: parameters, force, tangent, describing function and kernels, all in one class."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import ParameterError
from cutvib_ss.parameters import check_number
from cutvib_ss.results import ComplexArray, FloatArray

Values = tuple[float, ...]
Course = tuple[float, float, float]


def value(unit: str, minimum: float | None = 0.0, maximum: float | None = None, **more: Any) -> Any:
    """A dataclass field that is a parameter; a ``default`` makes it optional, a ``maximum`` of infinity is allowed itself."""
    return field(default=more.get("default", MISSING), metadata={"unit": unit, "minimum": minimum, "maximum": maximum})


@dataclass(frozen=True)
class RestoringForce(ABC):
    """
    A nonlinear force f against the motion of a port, beside the linear spring and damper there.

    Parameters are the dataclass fields, each from `value`. A law that belongs to a spring (freeplay, bilinear) is what has to be
    added to the linear spring k to give the real one, so that k is one of its parameters. A class with a ``name`` is registered
    when it is defined. Derive from `Memoryless` or `Hysteretic`.

    Raises
    ------
    ParameterError
        If a parameter is not a number, or too small.
    """

    name: ClassVar[str] = ""
    """Id of the law, and of the effect that uses it."""
    moved_by: ClassVar[Literal["displacement", "velocity"]] = "displacement"
    """Motion that the force follows."""
    scale_free: ClassVar[bool] = False
    """Whether f(a q, a v) = a f(q, v) for a > 0: then the excitation level does not matter."""
    strength: ClassVar[tuple[str, ...]] = ()
    """Parameters to which, taken together, the force is proportional."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if cls.name:
            _REGISTERED[cls.name] = cls

    def __post_init__(self) -> None:
        for f in fields(self):
            self.check(f.name, getattr(self, f.name))

    @classmethod
    def check(cls, name: str, given: float | None) -> None:
        """Refuse a value that a parameter cannot have."""
        [f] = [f for f in fields(cls) if f.name == name]
        highest = cls.highest(name)
        if (given is None and f.default is None) or given == math.inf == f.metadata["maximum"]:
            return
        if check_number(f"{cls.name}: {name}", given, f.metadata["minimum"]) > highest:
            raise ParameterError(f"{cls.name}: {name} = {given} must be at most {highest:g}")

    @classmethod
    def highest(cls, name: str) -> float:
        """Largest value of a parameter."""
        [given] = [f.metadata["maximum"] for f in fields(cls) if f.name == name]
        return math.inf if given is None else float(given)

    @classmethod
    def units(cls) -> dict[str, str]:
        """Parameters and their units at a joint (N and m in place of N m and rad at a port that is a displacement)."""
        return {f.name: f.metadata["unit"] for f in fields(cls)}

    @classmethod
    def dissipates(cls) -> bool:
        """Whether it takes energy out of a harmonic motion, or else stores it."""
        return cls.moved_by == "velocity"

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters that are given and finite."""
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: v for name, v in given.items() if v is not None and math.isfinite(v)}

    @property
    def odd(self) -> bool:
        """Whether f(-q, -v) = -f(q, v): if not, the force has a mean and even harmonics."""
        return True

    @property
    def degree(self) -> int | None:
        """Degree of the polynomial in q and v that the force is; None where it is none."""
        return None

    @property
    def jumps(self) -> bool:
        """Whether the force jumps as the velocity changes its sign."""
        return False

    def scaled(self, factor: float) -> Self:
        """The law with ``factor`` times its force."""
        return replace(self, **{n: factor * v for n in self.strength if (v := getattr(self, n)) is not None})

    def regularised(self, stiffness: float, motion: float) -> Self:
        """The law without jumps, at a port of that dynamic stiffness and largest motion; for the harmonic balance."""
        return self

    def at_step(self, compliance: float) -> RestoringForce:
        """The law as time steps resolve it, over which a constant unit force moves the port by ``compliance``."""
        return self

    def holds_below(self, compliance: float) -> float:
        """Displacement beyond which a port of this static compliance finds no equilibrium."""
        return math.inf

    @abstractmethod
    def force(self, q: ArrayLike, v: ArrayLike) -> FloatArray:
        """Force along histories of displacement and velocity, shape (..., sample); unloaded at the first sample."""

    @abstractmethod
    def tangent(self, q: ArrayLike, v: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Tangent stiffness ∂f/∂q and damping ∂f/∂v along histories; of the force's own branch where it has corners."""

    @abstractmethod
    def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """
        Fundamental of the force over that of the displacement, f = Re(N A e^(iωt)) under q = A cos ωt.

        See Gelb and Vander Velde, Multiple-Input Describing Functions, 1968.
        """

    def equivalent(self, amplitude: ArrayLike, omega: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Equivalent stiffness k and damping c at an amplitude: the describing function is k + iωc."""
        omega = np.asarray(omega, dtype=np.float64)
        z = self.describing_function(np.asarray(amplitude, dtype=np.float64), omega)
        return z.real.copy(), z.imag / omega


_REGISTERED: dict[str, type[RestoringForce]] = {}


def registered() -> dict[str, type[RestoringForce]]:
    """All laws by their names, in the order of these."""
    return dict(sorted(_REGISTERED.items()))


def law(name: str) -> type[RestoringForce]:
    """The class of a law, or a refusal that lists those there are."""
    if name not in _REGISTERED:
        raise ParameterError(f"no law {name!r}; there are {', '.join(registered())}")
    return _REGISTERED[name]


_PHASES = (np.arange(256) + 0.5) * np.pi / 256
"""Of half a period, which the other half repeats in the opposite order."""


# --- without memory ---------------------------------------------------------------------------------------------------


class Memoryless(RestoringForce):
    """
    A force that follows from displacement and velocity at the instant.

    The static methods are kernels: plain Python of floats and `math`, compiled by `compiled`; p are the `values`. `resist` and
    `tangents` are enough; the others are closed forms in place of Newton's method and Simpson's rule.
    """

    @property
    def values(self) -> Values:
        """The numbers that the kernels take."""
        return tuple(getattr(self, f.name) for f in fields(self))

    @staticmethod
    @abstractmethod
    def resist(p: Values, q: float, v: float) -> float:
        """Force."""

    @staticmethod
    @abstractmethod
    def tangents(p: Values, q: float, v: float) -> tuple[float, float]:
        """∂f/∂q and ∂f/∂v."""

    implicit: ClassVar[Any] = None
    """``implicit(p, q, a, v, b)``: the f that solves f = resist(q - a f, v - b f), a and b positive; NaN where there is none."""
    mean: ClassVar[Any] = None
    """``mean(p, q, v, f0, f1)``: mean force over a step, from the motion at its start, half-way and at its end."""
    steepest: ClassVar[Any] = None
    """``steepest(p, q, v)``: largest absolute tangent about a motion."""

    def force(self, q: ArrayLike, v: ArrayLike) -> FloatArray:
        p = self.values
        return np.asarray(np.vectorize(lambda q, v: self.resist(p, q, v), otypes=[float])(q, v))

    def fundamental(self, amplitude: ArrayLike) -> FloatArray:
        """Fundamental of a force that follows the displacement alone over that of the displacement, by quadrature."""
        a = np.asarray(amplitude, dtype=np.float64)
        q = a[..., None] * np.cos(_PHASES)
        return np.asarray(2.0 * np.mean(self.force(q, np.zeros_like(q)) * np.cos(_PHASES), axis=-1) / a)

    def fundamental_of_rate(self, amplitude: ArrayLike) -> FloatArray:
        """Fundamental of a force c(q) v over that of the velocity, by quadrature."""
        a = np.asarray(amplitude, dtype=np.float64)
        _, damping = self.tangent(a[..., None] * np.cos(_PHASES), np.zeros((*a.shape, _PHASES.size)))
        return np.asarray(2.0 * np.mean(damping * np.sin(_PHASES) ** 2, axis=-1))

    def tangent(self, q: ArrayLike, v: ArrayLike) -> tuple[FloatArray, FloatArray]:
        p = self.values
        by_q, by_v = np.vectorize(lambda q, v: self.tangents(p, q, v), otypes=[float, float])(q, v)
        return np.asarray(by_q), np.asarray(by_v)


def mean_size(a: float, b: float) -> float:
    """Mean of abs(x) as x goes evenly from a to b."""
    if a * b >= 0.0:
        return 0.5 * abs(a + b)
    return 0.5 * (a * a + b * b) / (abs(a) + abs(b))


def around(x: float, middle: float) -> tuple[float, float]:
    """exp(-u²/2) with u = ln(x/middle), and u; nothing where x is negative, or too small for a number."""
    ratio = x / middle
    if ratio < 1e-12:
        return 0.0, 0.0
    u = math.log(ratio)
    return math.exp(-0.5 * u * u), u


def clipped(q: float, below: float, above: float, rounding: float) -> tuple[float, float]:
    """q clipped to -below and above, and its slope; corners may be rounded to hyperbolas."""
    low, high = q + below, q - above
    if rounding > 0.0:
        far, near = math.sqrt(low * low + rounding * rounding), math.sqrt(high * high + rounding * rounding)
        return 0.5 * (far - near + above - below), 0.5 * (low / far - high / near)
    return min(max(q, -below), above), (1.0 if low > 0.0 and high < 0.0 else 0.0)


def bent_cubic(k: float, x: float, bent: float, more: float) -> tuple[float, float]:
    """k x³ (1 + bent x²)^more and its derivative."""
    square = x * x
    wide = 1.0 + bent * square
    stiff = k * square * math.exp(more * math.log(wide))
    return stiff * x, stiff * (3.0 + 2.0 * more * bent * square / wide)


HELPERS = (mean_size, around, clipped, bent_cubic)
"""Functions that kernels may call."""


# --- with memory ------------------------------------------------------------------------------------------------------


class Hysteretic(RestoringForce):
    """
    A force with memory: Jenkins elements in parallel, each a spring that slides beyond its slip force.

    Every law of Masing's rules is such a sum (Iwan, J. Appl. Mech. 33, 1966). Its state are the forces of the elements, advanced
    by `compiled`. A single one of infinite stiffness is Coulomb friction.
    """

    @classmethod
    def dissipates(cls) -> bool:
        return True

    @abstractmethod
    def sliders(self) -> FloatArray:
        """Stiffness and slip force of each element, in the order of slip force over stiffness, shape (element, 2)."""

    @property
    def jumps(self) -> bool:
        return bool(np.isinf(self.sliders()[:, 0]).any())

    def force(self, q: ArrayLike, v: ArrayLike) -> FloatArray:
        (k, limit), at = self.sliders().T, np.asarray(q, dtype=np.float64)
        if self.jumps:
            return np.asarray(limit[0] * np.sign(v))
        return np.asarray(_marched(k, limit, at).sum(axis=-1))

    def tangent(self, q: ArrayLike, v: ArrayLike) -> tuple[FloatArray, FloatArray]:
        (k, limit), at = self.sliders().T, np.asarray(q, dtype=np.float64)
        if self.jumps:
            return np.zeros(at.shape), np.zeros(at.shape)
        return np.asarray((np.abs(_marched(k, limit, at)) < limit) @ k), np.zeros(at.shape)

    def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> ComplexArray:
        # The loop of an element sticks over the part of a half cycle in which the motion takes back 2 limit/k, then slides.
        a = np.asarray(amplitude, dtype=np.float64)[..., None]
        (k, limit) = self.sliders().T
        if self.jumps:
            return np.asarray(4j * limit[0] / (np.pi * a[..., 0]) + 0.0 * np.asarray(omega))
        reach = np.minimum(
            np.divide(limit, k * a, out=np.ones(np.broadcast_shapes(a.shape, k.shape)), where=k * a > 0), 1.0
        )
        angle = np.arccos(1.0 - 2.0 * reach)
        each = k / np.pi * (angle - 0.5 * np.sin(2.0 * angle)) + 4j * k / np.pi * reach * (1.0 - reach)
        return np.asarray(each.sum(axis=-1) + 0.0 * np.asarray(omega))


def _marched(k: FloatArray, limit: FloatArray, q: FloatArray) -> FloatArray:
    """Forces of Jenkins elements along a history, shape (..., sample, element)."""
    out = np.zeros((*q.shape, k.size))
    for i in range(1, q.shape[-1]):
        elastic = out[..., i - 1, :] + k * (q[..., i] - q[..., i - 1])[..., None]
        out[..., i, :] = np.clip(elastic, -limit, limit)
    return out
