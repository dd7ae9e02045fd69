"""
Linear elements that attach in parallel at a port, and the parts of the machine that are absent by default.

An element knows its dynamic stiffness z(s), that is force over displacement at its port, the derivatives of z to its
parameters and to s, and - where it has one - its finite second-order form. Zero severity is z = 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import atan, pi, sqrt
from typing import Literal, Protocol

import numpy as np

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.second_order import SecondOrder
from cutvib_ss.parameters import check_number
from cutvib_ss.results import ComplexArray, FloatArray

SMOOTH_LENGTH = 0.6
"""Correlation length of an unknown dynamic stiffness over the natural logarithm of frequency."""


class Element(Protocol):
    """A linear element in parallel at a port."""

    def dynamic_stiffness(self, s: ComplexArray) -> ComplexArray:
        """Force over displacement at the port."""
        ...

    def derivative(self, name: str, s: ComplexArray) -> ComplexArray:
        """Derivative of z(s) to a parameter, or to s itself."""
        ...

    def second_order(self) -> SecondOrder:
        """The element as a system with port ``"end"``."""
        ...


@dataclass(frozen=True)
class SpringDamperMass:
    """Spring, damper and mass from a port to ground: z = k (1 + iη) + s c + s² m."""

    stiffness: float = 0.0  # k [N/m or N m/rad]
    damping: float = 0.0  # c [N s/m or N m s/rad]
    mass: float = 0.0  # m [kg or kg m²]
    # k η of a hysteretic spring [N/m or N m/rad]: a force in quadrature with the displacement at every frequency, as
    # exact in the frequency response as it is non-causal in time
    loss_stiffness: float = 0.0

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping", "mass", "loss_stiffness"):
            check_number(name, getattr(self, name))

    def dynamic_stiffness(self, s: ComplexArray) -> ComplexArray:
        """Force over displacement at the port."""
        z: ComplexArray = self.stiffness + 1j * self.loss_stiffness + s * self.damping + s**2 * self.mass
        return z

    def derivative(self, name: str, s: ComplexArray) -> ComplexArray:
        """Derivative of z(s) to a parameter, or to s itself."""
        if name == "s":
            return self.damping + 2 * s * self.mass
        power = {"stiffness": 1.0 + 0j * s, "loss_stiffness": 1j + 0 * s, "damping": s, "mass": s**2}
        return power[name]

    def second_order(self) -> SecondOrder:
        """One degree of freedom, with port ``"end"``."""
        if self.loss_stiffness != 0.0:
            raise CouplingError(
                "structural (hysteretic) damping has no finite second-order form; ask for equivalent viscous damping"
            )
        one = np.ones((1, 1))
        return SecondOrder(self.mass * one, self.damping * one, self.stiffness * one, ("end",), {"end": np.ones(1)})


@dataclass(frozen=True)
class SprungMass:
    """A mass on a spring and damper: absorber, panel or hose (Eq. 24)."""

    mass: float  # m [kg]
    frequency: float  # Natural frequency of the mass on its spring [Hz]
    damping_ratio: float  # ζ

    def __post_init__(self) -> None:
        check_number("mass", self.mass, 0.0)
        check_number("frequency", self.frequency, 0.0, strict=True)
        check_number("damping_ratio", self.damping_ratio, 0.0)

    def _parts(self, s: ComplexArray) -> tuple[float, ComplexArray, ComplexArray]:
        w = 2 * pi * self.frequency
        spring: ComplexArray = w * w + 2 * self.damping_ratio * w * s
        below: ComplexArray = spring + s * s
        return w, spring, below

    def dynamic_stiffness(self, s: ComplexArray) -> ComplexArray:
        """Force over displacement at the port: m s² (ω² + 2ζωs) / (s² + 2ζωs + ω²), Eq. 24 at s = jω."""
        _, spring, below = self._parts(s)
        z: ComplexArray = self.mass * s * s * spring / below
        return z

    def derivative(self, name: str, s: ComplexArray) -> ComplexArray:
        """Derivative of z(s) to a parameter, or to s itself."""
        w, spring, below = self._parts(s)
        ratio = spring / below
        zeta = self.damping_ratio
        out: ComplexArray
        if name == "mass":
            out = s * s * ratio
        elif name == "s":
            d_ratio = (2 * zeta * w * below - spring * (2 * zeta * w + 2 * s)) / below**2
            out = self.mass * (2 * s * ratio + s * s * d_ratio)
        else:
            # d(spring/below) = s² d(spring) / below², for any parameter that only enters the spring.
            d_spring = {"frequency": 2 * pi * (2 * w + 2 * zeta * s), "damping_ratio": 2 * w * s}[name]
            out = self.mass * s**4 * d_spring / below**2
        return out

    def second_order(self) -> SecondOrder:
        """Two degrees of freedom, port ``"end"`` on the massless foot."""
        if self.mass == 0.0:
            return SpringDamperMass().second_order()
        w = 2 * pi * self.frequency
        k, c = self.mass * w * w, 2 * self.damping_ratio * w * self.mass
        pattern = np.array([[1.0, -1.0], [-1.0, 1.0]])
        return SecondOrder(
            np.diag([0.0, self.mass]), c * pattern, k * pattern, ("end", "mass"),
            {"end": np.array([1.0, 0.0]), "mass": np.array([0.0, 1.0])},
        )  # fmt: skip


@dataclass(frozen=True)
class CausalHysteresis:
    """
    What hysteresis adds to a spring k, so that both together are a fractional spring: causal, and damped alike at all frequencies.

    The spring with it is k √(1 + η²) (s/ω_0)^α, with α = (2/π) atan η: at s = iω its phase is πα/2 throughout, so that the loss
    is tan(πα/2) = η, and its modulus at ω_0 is k √(1 + η²), so that the storage there is k. A power of s is analytic in the right
    half plane: storage and loss are what Kramers and Kronig ask of each other, storage rises by (ω/ω_0)^α, 2η/π per unit of
    ln ω. A constant k (1 + iη) is its limit for small η near ω_0, and is not causal.
    """

    stiffness: float  # k, the spring's storage stiffness at the reference frequency [N/m or N m/rad]
    loss_factor: float  # η, the same at all frequencies
    reference_frequency: float  # f_0 [Hz]

    def __post_init__(self) -> None:
        check_number("stiffness", self.stiffness)
        check_number("loss_factor", self.loss_factor, 0.0)
        check_number("reference_frequency", self.reference_frequency, 0.0, strict=True)

    @property
    def exponent(self) -> float:
        """α, between 0 and 1."""
        return 2 / pi * atan(self.loss_factor)

    def _whole(self, s: ComplexArray) -> ComplexArray:
        """√(1 + η²) (s/ω_0)^α."""
        whole: ComplexArray = sqrt(1 + self.loss_factor**2) * (s / (2 * pi * self.reference_frequency)) ** self.exponent
        return whole

    def dynamic_stiffness(self, s: ComplexArray) -> ComplexArray:
        """k (√(1 + η²) (s/ω_0)^α - 1)."""
        return np.asarray(self.stiffness * (self._whole(s) - 1.0))

    def derivative(self, name: str, s: ComplexArray) -> ComplexArray:
        """Derivative of z(s) to ``"stiffness"``, ``"loss_factor"``, ``"reference_frequency"`` or ``"s"``."""
        whole = self._whole(s)
        if name == "stiffness":
            return np.asarray(whole - 1.0)
        if name == "loss_factor":
            turned = self.loss_factor + 2 / pi * np.log(s / (2 * pi * self.reference_frequency))
            return np.asarray(self.stiffness * whole * turned / (1 + self.loss_factor**2))
        slope = self.stiffness * self.exponent * whole
        return np.asarray({"s": slope / s, "reference_frequency": -slope / self.reference_frequency}[name])

    def second_order(self) -> SecondOrder:
        """CouplingError: there is none of finite size."""
        raise CouplingError(
            "structural (hysteretic) damping has no finite second-order form; ask for equivalent viscous damping"
        )


@dataclass(frozen=True)
class SmoothElement:
    """
    A dynamic stiffness of unknown form that varies smoothly with frequency, as a reduced-rank Gaussian process.

    z(s) = scale Σ_k (a_k + i b_k) g_k(ln(s / 2πi)), with g = Λ^(-1/2) Vᵀ κ(u, u_k), κ the squared exponential and V Λ Vᵀ its
    matrix at the knots (Rasmussen and Williams 2006, section 8.1). The shapes are analytic in s.
    """

    scale: float  # Standard deviation of z(iω), real and imaginary part [N/m or N m/rad]
    band: tuple[float, float]  # Band over which its knots lie [Hz]
    # Of the real, then of the imaginary shapes; independent N(0, 1) for a process of that standard deviation. Each may be a value a
    # line, for responses at those lines alone
    coefficients: tuple[float | tuple[float, ...], ...]

    def shapes(self, s: ComplexArray) -> ComplexArray:
        """What a unit of each coefficient adds to z(s), shape (coefficient, …)."""
        real = self.scale * self._shapes(s)
        return np.concatenate([real, 1j * real])

    def _shapes(self, s: ComplexArray) -> ComplexArray:
        at = np.asarray(s, dtype=np.complex128)
        shapes = _shapes_over(at.tobytes(), self.band, len(self.coefficients) // 2)
        return shapes.reshape(-1, *at.shape)

    def dynamic_stiffness(self, s: ComplexArray) -> ComplexArray:
        """z(s), of the shape of ``s``."""
        if not any(isinstance(v, tuple) for v in self.coefficients):
            count = len(self.coefficients) // 2
            values = np.array(self.coefficients, dtype=float)
            return np.asarray(self.scale * np.tensordot(values[:count] + 1j * values[count:], self._shapes(s), 1))
        c = np.array([np.broadcast_to(np.asarray(v, dtype=float), np.shape(s)) for v in self.coefficients])
        return np.asarray(np.sum(c * self.shapes(s), axis=0))

    def derivative(self, name: str, s: ComplexArray) -> ComplexArray:
        """
        Derivative of z(s) to a coefficient, by its index, to ``"s"`` or ``"scale"``, or to a ``"stiffness"`` beside it.

        ``"unit"`` is that to z itself: what a coefficient moves is that times its own derivative of z.
        """
        if name == "scale":
            return self.dynamic_stiffness(s) / self.scale
        if name in ("stiffness", "unit"):
            return np.ones(np.shape(s), dtype=np.complex128)
        if name == "s":
            step = 1e-6
            ahead, behind = self.dynamic_stiffness(s * (1 + step)), self.dynamic_stiffness(s * (1 - step))
            return np.asarray((ahead - behind) / (2 * step * s))
        count = len(self.coefficients) // 2
        k = int(name)
        return np.asarray(self.scale * (1.0 if k < count else 1j) * self._shapes(s)[k % count])

    def second_order(self) -> SecondOrder:
        """CouplingError: there is none."""
        raise CouplingError(
            "an unknown dynamic stiffness has no finite second-order form; ask for its viscous equivalent"
        )


@dataclass(frozen=True)
class YieldingElement:
    """
    A spring and damper with a compliance of unknown form in series: z(s) = 1 / (1/(k + sc) + c(s)).

    What gives adds its compliance, as what stands beside adds its stiffness.
    """

    spring: SpringDamperMass  # k and c
    give: SmoothElement  # c(s), whose "dynamic stiffness" is a compliance [m/N]

    def dynamic_stiffness(self, s: ComplexArray) -> ComplexArray:
        """Force over displacement at the port."""
        return np.asarray(1.0 / (1.0 / self.spring.dynamic_stiffness(s) + self.give.dynamic_stiffness(s)))

    def derivative(self, name: str, s: ComplexArray) -> ComplexArray:
        """Derivative of z(s) to ``"stiffness"`` or ``"damping"``, to a coefficient of the compliance, or to ``"s"``."""
        z, spring = self.dynamic_stiffness(s), self.spring.dynamic_stiffness(s)
        by_spring = z**2 / spring**2
        if name in ("stiffness", "damping"):
            return np.asarray(by_spring * self.spring.derivative(name, s))
        out = -(z**2) * self.give.derivative(name, s)
        return np.asarray(out + by_spring * self.spring.derivative(name, s) if name == "s" else out)

    def second_order(self) -> SecondOrder:
        """CouplingError: there is none."""
        return self.give.second_order()


@lru_cache(maxsize=64)
def _shapes_over(s: bytes, band: tuple[float, float], count: int) -> ComplexArray:
    """Shapes over a band at some s, which every coefficient asks for."""
    u = np.log(np.frombuffer(s, dtype=np.complex128) / (2j * pi))
    return smooth_process(u, (float(np.log(band[0])), float(np.log(band[1]))), count)


def smooth_process(u: ComplexArray | FloatArray, ends: tuple[float, float], count: int) -> ComplexArray:
    """Shapes of a squared-exponential process over u with independent N(0, 1) coefficients, shape (count, …)."""
    knots = np.linspace(*ends, count)
    # Neighbouring knots stay correlated, however wide the band.
    width = max(SMOOTH_LENGTH, 1.2 * (knots[1] - knots[0])) if count > 1 else SMOOTH_LENGTH
    variance, vectors = np.linalg.eigh(np.exp(-0.5 * ((knots[:, None] - knots) / width) ** 2))
    weight = np.where(variance > 1e-6 * variance[-1], 1.0 / np.sqrt(np.maximum(variance, 1e-300)), 0.0)
    across = np.exp(-0.5 * ((np.asarray(u)[None] - knots.reshape(-1, *[1] * np.ndim(u))) / width) ** 2)
    return np.asarray(np.tensordot((vectors * weight).T, across, 1))


def viscous_equivalent(element: Element, s: complex) -> Element:
    """The element, or where it has no finite second-order form the spring and damper k + sc that equal it at one s [rad/s]."""
    if isinstance(element, SpringDamperMass):
        damping = element.loss_stiffness / s.imag
        stiffness = element.stiffness - s.real * damping
        return replace(element, stiffness=stiffness, damping=element.damping + damping, loss_stiffness=0.0)
    try:
        element.second_order()
    except CouplingError:
        z = complex(element.dynamic_stiffness(np.array([s]))[0])
        return SpringDamperMass(z.real - s.real * z.imag / s.imag, z.imag / s.imag)
    return element


@dataclass(frozen=True)
class Attachment:
    """An element at a port, or along a direction between two of them."""

    port: str  # Name of the port
    element: Element  # What is attached there
    toward: str = ""  # Port toward which its direction is turned; none by default
    angle: float = 0.0  # By how much [rad]

    def row(self, rows: Mapping[str, FloatArray]) -> FloatArray:
        """Its row among those of the ports."""
        row = rows[self.port]
        return np.cos(self.angle) * row + np.sin(self.angle) * rows[self.toward] if self.toward else row

    def turned(self, rows: Mapping[str, FloatArray]) -> FloatArray:
        """Derivative of its row to the angle."""
        return replace(self, angle=self.angle + np.pi / 2).row(rows) if self.toward else 0.0 * rows[self.port]

    def moved(self, d_rows: Mapping[str, FloatArray]) -> FloatArray | None:
        """Derivative of its row by those of the ports, of which some may be left out; None where it does not move."""
        own = [d_rows[p] for p in (self.port, self.toward) if p in d_rows]
        return self.row({p: d_rows.get(p, np.zeros_like(own[0])) for p in (self.port, self.toward)}) if own else None


@dataclass(frozen=True)
class Guide:
    """Give of the guide's ball bearings, in series between rail and head."""

    stiffness: float  # k [N/m]
    damping: float = 0.0  # c [N s/m]
    sensor_side: Literal["head", "rail"] = "head"  # On which side of the guide ``base_x`` sits
    give: SmoothElement | None = None  # A compliance of unknown form in series with the spring [m/N]

    def __post_init__(self) -> None:
        check_number("guide stiffness", self.stiffness, 0.0, strict=True)
        check_number("guide damping", self.damping, 0.0)
        if self.sensor_side not in ("head", "rail"):
            raise ParameterError(f'guide sensor_side = {self.sensor_side!r} must be "head" or "rail"')

    @property
    def element(self) -> Element:
        """The spring and damper between the head's base and the rail, with what else gives there."""
        spring = SpringDamperMass(self.stiffness, self.damping)
        return spring if self.give is None else YieldingElement(spring, self.give)


def of_known_poles(element: Element, s: complex) -> Element:
    """The element, or where a model with it has no finite set of poles what equals it at one s: a constant loss stays."""
    return element if isinstance(element, SpringDamperMass) else viscous_equivalent(element, s)


class EquivalentGuide(Guide):
    """A spring and damper that equal a guide at one frequency, and may be of either sign."""

    def __post_init__(self) -> None:
        pass


def equivalent_guide(guide: Guide, s: complex) -> Guide:
    """The guide, or where it gives in a form that is not known what equals it at one s [rad/s]."""
    if guide.give is None:
        return guide
    spring = viscous_equivalent(guide.element, s)
    assert isinstance(spring, SpringDamperMass)
    return EquivalentGuide(spring.stiffness, spring.damping, guide.sensor_side)


def viscous_attachments(attachments: Iterable[Attachment], viscous_at: float | None) -> tuple[Attachment, ...]:
    """The attachments, those without a finite form replaced by the spring and damper that equal them at one frequency [Hz]."""
    if viscous_at is None:
        return tuple(attachments)
    s = 2j * pi * check_number("viscous_at", viscous_at, 0.0, strict=True)
    return tuple(replace(a, element=viscous_equivalent(a.element, s)) for a in attachments)
