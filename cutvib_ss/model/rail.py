"""
The moving rail as a uniform beam by mode superposition (Section 3.2, Eqs. 4-9), and what may be added to it.

Pinned, w(y, t) = Σ sin(rπy/L) a_r(t), each mode of modal mass μL/2 and frequency r² ω_1 (Eq. 8). With the paper's
mass-normalised shapes φ_r = √(2/μL) sin(rπy/L) and coordinates η_r = √(μL/2) a_r (Eqs. 7 and 9).

Ends that give are *released*: w gains the two rigid motions h(y)ᵀu = (1 - y/L) u_left + (y/L) u_right, inertially
coupled to the modes, with the end springs on u. Sines and rigid motions together are complete, and the pinned rail is
the limit of rigid springs. Of a mode's damping a stated share resists what the rigid motions have of its shape,
2 ∫ sin(rπy/L) h dy/L · u, as well as the elastic part. Ends that resist turning are springs on the end slopes
Σ (rπ/L) a_r (and the alternating sum at y = L). A rail that also shears has two modes for each sine, and cross-sections
that turn by less than the slope (`cutvib_ss.model.pinned_modes`). Twist is a field of its own, held at the ends
(`cutvib_ss.model.twist`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.elements import Element, SmoothElement, SpringDamperMass, YieldingElement, viscous_equivalent
from cutvib_ss.model.pinned_modes import PinnedModes, euler_bernoulli, timoshenko
from cutvib_ss.model.second_order import SecondOrder
from cutvib_ss.model.twist import TWIST_MODES, twist_modes
from cutvib_ss.parameters import RailParameters, check_number, check_position
from cutvib_ss.results import FloatArray


@dataclass(frozen=True)
class EndSupports:
    """Springs and dampers under the rail's ends, in place of rigid pins."""

    k_left: float  # Stiffness at y = 0 and y = L [N/m]
    k_right: float
    c_left: float = 0.0  # Damping [N s/m]
    c_right: float = 0.0
    give: SmoothElement | None = None  # A compliance of unknown form in series with each of them [m/N]

    def __post_init__(self) -> None:
        for name in ("k_left", "k_right"):
            check_number(name, getattr(self, name), 0.0, strict=True)
        for name in ("c_left", "c_right"):
            check_number(name, getattr(self, name), 0.0)

    @property
    def elements(self) -> tuple[Element, Element]:
        """What stands under the left and the right end."""
        left, right = SpringDamperMass(self.k_left, self.c_left), SpringDamperMass(self.k_right, self.c_right)
        if self.give is None:
            return left, right
        return YieldingElement(left, self.give), YieldingElement(right, self.give)


class _EquivalentSupports(EndSupports):
    """Springs and dampers that equal what gives at one frequency, and may be of either sign."""

    def __post_init__(self) -> None:
        pass


LOSSY_MODES = 4
"""
Modes of the rail whose dampings may differ one by one, the lowest: those of a band of some hundred hertz. The highest of a model
has the rail's damping ratio, as have those that it leaves out.
"""


@dataclass(frozen=True)
class Shear:
    """Shear deformation and rotary inertia (Timoshenko), in place of bending alone."""

    # κGA L²/(π² EI): stiffness of the first mode against shear over that against bending. The first frequency of the
    # rail's parameters goes on standing for EI, so that shear lowers every frequency, the first about 0.67/ratio
    ratio: float

    def __post_init__(self) -> None:
        check_number("shear ratio", self.ratio, 0.0, strict=True)


@dataclass(frozen=True)
class Torsion:
    """Twist of the rail about its shear centre."""

    eccentricity: float  # Distance e in Z from the shear centre to the head's first joint [m]
    inertia: float  # Polar moment of inertia J of the whole rail [kg m²]
    torsion_frequency: float  # First natural frequency of torsion, without the head [Hz]
    # Damping ratio of the first torsion mode; damping goes with the rate of strain, so that of mode s is s times as
    # large
    damping_ratio: float
    # Stiffness with which each end is held against twist over that of the whole shaft; infinite: held
    fixing: float = np.inf

    def __post_init__(self) -> None:
        if self.fixing != np.inf:
            check_number("fixing", self.fixing, 0.0, strict=True)
        check_number("eccentricity", self.eccentricity)
        check_number("inertia", self.inertia, 0.0, strict=True)
        check_number("torsion_frequency", self.torsion_frequency, 0.0, strict=True)
        check_number("damping_ratio", self.damping_ratio, 0.0)


@dataclass(frozen=True)
class RailAttachment:
    """An element at a point of the rail."""

    element: Element  # What is attached
    position: float  # y / L of the point; 0 or 1 for the slope at an end
    # Whether it acts on the slope there (of the cross-section, where the rail shears) instead of on the displacement
    slope: bool = False

    def __post_init__(self) -> None:
        if not self.slope:
            check_position(self.position)


@dataclass(frozen=True)
class Rail:
    """The rail's parameters and what is added to the pinned beam; nothing by default."""

    parameters: RailParameters  # The pinned beam
    supports: EndSupports | None = None  # Ends that give
    torsion: Torsion | None = None  # A rail that twists
    attachments: tuple[RailAttachment, ...] = field(default=())  # Elements along it
    shear: Shear | None = None  # A rail that shears
    losses: tuple[
        float, ...
    ] = ()  # Factors on the damping of each of the lowest modes, which tuning moves; ones by default
    frequencies: tuple[float, ...] = ()  # The same on their natural frequencies

    def __post_init__(self) -> None:
        for name in ("losses", "frequencies"):
            if all(f == 1.0 for f in getattr(self, name)):
                object.__setattr__(self, name, (1.0,) * min(self.parameters.n_modes - 1, LOSSY_MODES))

    @property
    def modes(self) -> PinnedModes:
        """Its modes between pins."""
        if self.shear is None:
            return self._tuned(euler_bernoulli(self.parameters.n_modes))
        return self._tuned(timoshenko(self.parameters.n_modes, self.shear.ratio)[0])

    def _tuned(self, modes: PinnedModes) -> PinnedModes:
        """Modes, or their derivatives, with the factors on the frequencies of the lowest of them."""
        own = self._frequency_profile
        return modes if not own else replace(modes, frequency=scaled(modes.frequency, own))

    @property
    def _frequency_profile(self) -> tuple[float, ...]:
        """Natural frequencies of the lowest modes over those of the uniform beam; nothing where all are."""
        p = self.parameters
        if all(f == 1.0 for f in self.frequencies):
            return p.frequency_profile
        count = max(len(p.frequency_profile), len(self.frequencies))
        return tuple(scaled(scaled(np.ones(count), p.frequency_profile), self.frequencies).tolist())

    @property
    def damping_weight(self) -> FloatArray:
        """ζ over the rail's ``damping_ratio`` of each of `modes`; of a uniform rotation that of the first."""
        profile, mode = np.array(self.parameters.damping_profile or (1.0,)), self.modes.number.astype(int) - 1
        own = np.append(self.losses, 1.0)[np.clip(mode, 0, len(self.losses))]
        return np.asarray(profile[np.clip(mode, 0, profile.size - 1)] * own)

    @property
    def as_written(self) -> Rail:
        """The factors on the damping and the frequency of single modes are written into its parameters."""
        if self._frequency_profile != self.parameters.frequency_profile:
            stated = replace(self.parameters, frequency_profile=self._frequency_profile)
            return replace(self, parameters=stated, frequencies=()).as_written
        p = self.parameters
        if all(f == 1.0 for f in self.losses) and not p.damping_profile:
            return self
        own = tuple(r * f for r, f in zip(p.damping_ratios, (*self.losses, *[1.0] * p.n_modes), strict=False))
        mean = sum(own) / len(own)
        damped = replace(p, damping_ratio=mean, damping_profile=tuple(r / mean for r in own))
        return replace(self, parameters=damped, losses=())

    @property
    def modes_by_shear(self) -> PinnedModes:
        """Derivatives of their values to the shear ratio; only where the rail shears."""
        assert self.shear is not None
        return self._tuned(timoshenko(self.parameters.n_modes, self.shear.ratio)[1])


def viscous_rail(model: Rail, viscous_at: float | None) -> Rail:
    """The rail with its elements as springs and dampers that equal them at one frequency [Hz], where they have no finite form."""
    if viscous_at is None:
        return model
    return equivalent_rail(model, 2j * np.pi * check_number("viscous_at", viscous_at, 0.0, strict=True))


def equivalent_rail(model: Rail, s: complex) -> Rail:
    """The same at one s [rad/s]."""
    attachments = tuple(replace(a, element=viscous_equivalent(a.element, s)) for a in model.attachments)
    supports = model.supports
    if supports is not None and supports.give is not None:
        left, right = (viscous_equivalent(e, s) for e in supports.elements)
        assert isinstance(left, SpringDamperMass)
        assert isinstance(right, SpringDamperMass)
        supports = _EquivalentSupports(left.stiffness, right.stiffness, left.damping, right.damping)
    return replace(model, attachments=attachments, supports=supports)


def mode_shapes(p: RailParameters, position: ArrayLike) -> FloatArray:
    """Mass-normalised mode shapes φ_r anywhere on the rail (Eq. 7), shape (position, mode)."""
    shapes: FloatArray = np.sqrt(2.0 / p.mass) * euler_bernoulli(p.n_modes).deflections(position)
    return shapes


def scaled(values: FloatArray, factors: Sequence[float]) -> FloatArray:
    """Values, the first of them times factors."""
    out = values.copy()
    out[: len(factors)] *= factors
    return out


def natural_frequencies(p: RailParameters) -> FloatArray:
    """Natural frequencies of the pinned rail without the head (Eq. 8, Table 5), shape (mode,)."""
    frequencies: FloatArray = p.first_frequency * scaled(euler_bernoulli(p.n_modes).frequency, p.frequency_profile)
    return frequencies


def rail_point(name: str) -> float | None:
    """y / L of a signal ``rail(0.25)`` or ``rail@0.25``; None for another name."""
    found = re.fullmatch(r"rail(?:\((.*)\)|@(.*))", name)
    if found is None:
        return None
    try:
        return check_position(float(found[1] or found[2]))
    except (TypeError, ValueError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(f"signal {name!r}: write rail(0.25) for the rail at a quarter") from None


def rail_points(names: Iterable[str]) -> dict[str, float]:
    """Points of the rail among signals, to y / L."""
    return {name: y for name in names if (y := rail_point(name)) is not None}


def rail_rows(model: Rail, positions: ArrayLike, order: int = 0, twist: bool = False) -> FloatArray:
    """
    φ(y): how the rail moves at points, or a derivative of that to y / L, over all its coordinates; shape (position, n).

    dᵏ/dyᵏ sin(rπy) = (rπ)ᵏ sin(rπy + kπ/2); ends that give add 1 - y and y. One coordinate of the twist belongs to the place
    of the head.
    """
    y = np.atleast_1d(np.asarray(positions, dtype=float))
    rows = np.zeros((y.size, _size(model)))
    if twist:
        if order:
            raise CouplingError(
                "one coordinate of the rail's twist belongs to the place of the head and has no derivatives along the rail"
            )
        assert model.torsion is not None
        shapes = twist_modes(model.torsion.fixing).shapes(y) / np.sqrt(model.torsion.inertia / 2)
        rows[:, -shapes.shape[1] :] = shapes
        return rows
    modes, scale = model.modes, np.sqrt(2.0 / model.parameters.mass)
    turn = np.pi * modes.number
    m = turn.size
    rows[:, :m] = scale * modes.deflection * turn**order * np.sin(np.outer(y, turn) + order * np.pi / 2)
    if model.supports is not None and order < 2:
        rows[:, m], rows[:, m + 1] = (1.0 - y, y) if order == 0 else (-1.0, 1.0)
    return rows


def rail_rows_bound(model: Rail, order: int) -> FloatArray:
    """Largest moduli over the whole rail of the entries of `rail_rows`, for the deflection."""
    row, modes = np.zeros(_size(model)), model.modes
    m = modes.number.size
    row[:m] = np.sqrt(2.0 / model.parameters.mass) * np.abs(modes.deflection) * (np.pi * modes.number) ** order
    if model.supports is not None:
        row[m : m + 2] = float(order < 2)
    return row


def _size(model: Rail) -> int:
    twists = 0 if model.torsion is None else TWIST_MODES + 1
    return model.modes.number.size + (2 if model.supports else 0) + twists


def rail(model: Rail, points: Mapping[str, float]) -> SecondOrder:
    """
    The rail as a second-order system in modal coordinates, with ports at points along it.

    Eq. 9. Where the ends give, the rail's own damping, which goes with the rate of strain (Eq. 4), does not resist its rigid
    motions: they do not bend it.

    Eq. 4's c_s I ∂⁵w/∂y⁴∂t is its E I ∂⁴w/∂y⁴ with c_s/E ∂/∂t before it. It adds (c_s/E) ω_r² to the damping of each mode, as much
    as ζ_r = (c_s/E) ω_r / 2, and resists no rigid motion. With shear the strain of either kind is damped alike.
    """
    p = model.parameters
    modes = model.modes
    m = modes.number.size
    scale = np.sqrt(2.0 / p.mass)
    w = 2 * np.pi * p.first_frequency * modes.frequency
    dofs = [f"eta{r}" for r in range(1, p.n_modes + 1)] + [f"shear{r}" for r in range(m - p.n_modes)]
    ends = ["rail_left", "rail_right"] if model.supports else []
    twists = [f"twist{r}" for r in range(1, TWIST_MODES + 2)] if model.torsion else []
    n = m + len(ends) + len(twists)
    mass, damping, stiffness = np.eye(n), np.zeros((n, n)), np.zeros((n, n))
    elastic = np.arange(m)
    modal = 2 * p.damping_ratio * model.damping_weight * w
    damping[elastic, elastic] = modal + p.strain_damping * w**2
    stiffness[elastic, elastic] = w**2
    if model.supports:
        if model.supports.give is not None:
            raise CouplingError(
                "supports of unknown form have no finite second-order form; ask for their viscous equivalent"
            )
        u = slice(m, m + 2)
        mass[u, u] = p.mass * modes.rigid_inertia
        mass[:m, u] = scale * p.mass * modes.coupling
        mass[u, :m] = mass[:m, u].T
        damping[u, u] = np.diag([model.supports.c_left, model.supports.c_right])
        stiffness[u, u] = np.diag([model.supports.k_left, model.supports.k_right])
    if model.torsion:
        t = np.arange(n - len(twists), n)
        wt = 2 * np.pi * model.torsion.torsion_frequency
        squares = twist_modes(model.torsion.fixing).stiffness
        damping[t, t] = 2 * model.torsion.damping_ratio * wt * squares
        stiffness[t, t] = wt**2 * squares

    ports = {name: rail_rows(model, y)[0] for name, y in points.items()}
    if model.torsion:
        ports |= {f"{name}_twist": rail_rows(model, y, twist=True)[0] for name, y in points.items()}
    unit = np.eye(n)
    ports |= {dof: unit[i] for i, dof in enumerate(dofs)}
    for i, end in enumerate(("rail_left", "rail_right")):
        ports[end] = unit[m + i] if model.supports else np.zeros(n)
    for attachment in model.attachments:
        e, at = attachment.element, rail_rows(model, attachment.position)[0]
        if not isinstance(e, SpringDamperMass):
            raise CouplingError(
                "an element on the rail has no finite second-order form; ask for its viscous equivalent"
            )
        if attachment.slope:
            slope = np.concatenate([scale * modes.rotations(attachment.position), [-1.0, 1.0][: len(ends)]]) / p.length
            at = np.pad(slope, (0, n - slope.size))
        block = np.outer(at, at)
        mass, damping, stiffness = mass + e.mass * block, damping + e.damping * block, stiffness + e.stiffness * block
    return SecondOrder(mass, damping, stiffness, tuple(dofs + ends + twists), ports)
