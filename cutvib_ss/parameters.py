"""
Frozen parameter sets, each checked when it is made; the paper's tables, one function each, with source and caveat.

The paper is "Analysis and Control of Vibrations of a Cartesian Cutting Machine Using an Equivalent Robotic Model".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from math import isfinite, pi, radians, sqrt
from types import MappingProxyType
from typing import Any

from cutvib_ss.errors import ParameterError


def check_number(name: str, value: Any, minimum: float | None = None, strict: bool = False) -> float:
    """A finite number, at or above (``strict``: above) a minimum; else a `ParameterError` that names it."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(f"{name} = {value!r} is not a number")
    number = float(value)
    if not isfinite(number):
        raise ParameterError(f"{name} = {value} is not finite")
    if minimum is not None and (number <= minimum if strict else number < minimum):
        raise ParameterError(f"{name} = {value} must be {'greater than' if strict else 'at least'} {minimum:g}")
    return number


def check_position(position: Any) -> float:
    """A position y_b / L strictly inside (0, 1), given as a number or by a name of the paper; else a `ParameterError`."""
    if position is None:
        raise ParameterError("a position is needed: y_b / L of the head on the rail, strictly between 0 and 1")
    number = check_number("position", position_named(position) if isinstance(position, str) else position)
    if not 0.0 < number < 1.0:
        raise ParameterError(
            f"position = {position} must lie strictly between 0 and 1 (y_b / L of the head on the rail)"
        )
    return number


def check_choice(name: str, value: Any, choices: Iterable[str]) -> None:
    """Refuse a value that is none of the choices, and list them."""
    known = list(choices)
    if value not in known:
        raise ParameterError(f"{name} = {value!r} is not one of {', '.join(known)}")


def names_of(given: str | Iterable[str]) -> tuple[str, ...]:
    """Names as a tuple; a single string is one name."""
    return (given,) if isinstance(given, str) else tuple(given)


def control_name(signal: str) -> str:
    """A signal's name in python-control, which allows no point: ``rail@0.25`` is ``rail@0_25``."""
    return signal.replace(".", "_")


@dataclass(frozen=True)
class HeadParameters:
    """
    The equivalent two-link robot of the cutting head (Fig. 3, Eqs. 1-3).

    Parameters
    ----------
    m1, m2 : float
        Tip masses of link 1 (head) and link 2 (tool) [kg].
    l1, l2 : float
        Lengths of the links [m].
    theta01, theta02 : float
        Joint angles of the reference configuration [rad]; ``theta02`` is relative to link 1.
    k1, k2 : float
        Torsional stiffness of the joints [N m/rad].
    c1, c2 : float
        Torsional damping of the joints [N m s/rad].
    source, caveat : str
        Where the values come from, and what to know about them.

    Raises
    ------
    ParameterError
        If a mass, length or stiffness is not positive, or a damping negative.
    """

    m1: float
    m2: float
    l1: float
    l2: float
    theta01: float
    theta02: float
    k1: float
    k2: float
    c1: float
    c2: float
    source: str = field(default="", compare=False)
    caveat: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for name in ("m1", "m2", "l1", "l2", "k1", "k2"):
            check_number(f"head.{name}", getattr(self, name), 0.0, strict=True)
        for name in ("c1", "c2"):
            check_number(f"head.{name}", getattr(self, name), 0.0)
        for name in ("theta01", "theta02"):
            check_number(f"head.{name}", getattr(self, name))


@dataclass(frozen=True)
class RailParameters:
    """
    The moving rail as a pinned uniform beam with modal damping (Eqs. 4-9).

    Parameters
    ----------
    length : float
        L [m].
    mass : float
        Mass of the whole rail, μL [kg].
    first_frequency : float
        First natural frequency with pinned ends and without the head [Hz]; mode r has r² times this (Eq. 8).
    damping_ratio : float or sequence of float
        Modal damping ratio ζ_r, one for every mode, or one for each of ``n_modes``. Of several the attribute holds the mean.
    n_modes : int
        Number of modes m kept in the superposition (Eq. 10).
    damping_profile : tuple of float
        ζ_r of each mode over ``damping_ratio``; ones by default, and the last value for modes beyond. From ``damping_ratio`` where
        that is a sequence.
    strain_damping : float
        c_s / E of Eq. 4 [s]: damping c_s I by the rate of strain, beside that of the damping ratios (0 by default).
    frequency_profile : tuple of float
        Natural frequency of each of the lowest modes over r² ``first_frequency``, as measured; ones by default and beyond.
    source, caveat : str
        Where the values come from, and what to know about them.

    Raises
    ------
    ParameterError
        If a value is impossible.
    """

    length: float
    mass: float
    first_frequency: float
    damping_ratio: float
    n_modes: int
    damping_profile: tuple[float, ...] = ()
    strain_damping: float = 0.0
    frequency_profile: tuple[float, ...] = ()
    source: str = field(default="", compare=False)
    caveat: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for name in ("length", "mass", "first_frequency"):
            check_number(f"rail.{name}", getattr(self, name), 0.0, strict=True)
        if isinstance(self.n_modes, bool) or not isinstance(self.n_modes, int) or not 1 <= self.n_modes <= 1000:
            raise ParameterError(f"rail.n_modes = {self.n_modes!r} must be a whole number from 1 to 1000")
        if not isinstance(self.damping_ratio, int | float):
            self._take_profile(tuple(self.damping_ratio))
        check_number("rail.damping_ratio", self.damping_ratio, 0.0)
        for ratio in self.damping_ratios:
            if check_number("rail.damping_ratio", ratio, 0.0) >= 1.0:
                raise ParameterError(f"rail.damping_ratio = {ratio} must be below 1")
        check_number("rail.strain_damping", self.strain_damping, 0.0)
        profile = tuple(check_number("rail.frequency_profile", f, 0.0, strict=True) for f in self.frequency_profile)
        if len(profile) > self.n_modes:
            raise ParameterError(f"rail.frequency_profile has {len(profile)} values for n_modes = {self.n_modes}")
        object.__setattr__(self, "frequency_profile", profile)

    def _take_profile(self, ratios: tuple[Any, ...]) -> None:
        """The mean of a damping ratio a mode, and what each is of it."""
        if len(ratios) != self.n_modes:
            raise ParameterError(f"rail.damping_ratio has {len(ratios)} values; give one, or n_modes = {self.n_modes}")
        mean = sum(check_number("rail.damping_ratio", r, 0.0) for r in ratios) / len(ratios)
        profile = () if all(r == ratios[0] for r in ratios) else tuple(float(r) / mean for r in ratios)
        object.__setattr__(self, "damping_ratio", float(ratios[0]) if not profile else mean)
        object.__setattr__(self, "damping_profile", profile)

    @property
    def damping_ratios(self) -> tuple[float, ...]:
        """ζ_r of the modes 1 … m."""
        profile = self.damping_profile or (1.0,)
        return tuple(self.damping_ratio * profile[min(r, len(profile) - 1)] for r in range(self.n_modes))

    @property
    def bending_stiffness(self) -> float:
        """E I [N m^2], from Eq. 8 for r = 1."""
        return self.mass * (2 * pi * self.first_frequency) ** 2 * self.length**3 / pi**4


def _check_tolerances(table: Tolerances | StructureTolerances) -> None:
    """Every tolerance that is stated is a fraction."""
    for f in fields(table):
        value = getattr(table, f.name)
        if value is not None and check_number(f"tolerance.{f.name}", value, 0.0) >= 1.0:
            raise ParameterError(f"tolerance.{f.name} = {value} is a fraction: it must be below 1")


@dataclass(frozen=True)
class Tolerances:
    """
    One standard deviation of what is known of each value, as a fraction of it; the angles are exact.

    Parameters
    ----------
    m1, m2, l1, l2, k1, k2, c1, c2 : float
        Of the head's parameters.
    mass, first_frequency, damping_ratio : float
        Of the rail's parameters.
    calibration : float
        Of each response channel's sensitivity, smooth over frequency.
    drift : float, optional
        How far stiffnesses and gains move between sessions, as a fraction; dampings move by as many tolerances. Left out: by the
        evidence of the records.
    """

    m1: float = 0.005
    m2: float = 0.01
    l1: float = 0.003
    l2: float = 0.003
    k1: float = 0.01
    k2: float = 0.01
    c1: float = 0.1
    c2: float = 0.1
    mass: float = 0.005
    first_frequency: float = 0.005
    damping_ratio: float = 0.15
    calibration: float = 0.01
    drift: float | None = None

    def __post_init__(self) -> None:
        _check_tolerances(self)


TOLERANCED_HEAD = ("m1", "m2", "l1", "l2", "k1", "k2", "c1", "c2")
TOLERANCED_RAIL = ("mass", "first_frequency", "damping_ratio")
"""Values of head and rail that have a tolerance."""

MATRICES = ("mass", "damping", "stiffness")
"""Matrices of a second-order structure; each has one."""


@dataclass(frozen=True)
class StructureTolerances:
    """Tolerances of a second-order structure: one common scale factor on each matrix."""

    mass: float = 0.02  # One standard deviation of the factor on each matrix
    damping: float = 0.2
    stiffness: float = 0.02
    calibration: float = 0.01  # Of each response channel's sensitivity, smooth over frequency
    # How far stiffnesses and gains move between sessions, as a fraction. Left out: by the evidence of the records
    drift: float | None = None

    def __post_init__(self) -> None:
        _check_tolerances(self)


@dataclass(frozen=True)
class AbsorberParameters:
    """
    A tuned vibration absorber: one sprung mass (Section 7, Eqs. 24-26).

    Parameters
    ----------
    frequency : float
        Tuning frequency f_N [Hz].
    damping_ratio : float
        ζ_a.
    mass : float
        m_a [kg].
    source, caveat : str
        Where the values come from, and what to know about them.
    """

    frequency: float
    damping_ratio: float
    mass: float
    source: str = field(default="", compare=False)
    caveat: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        check_number("absorber.frequency", self.frequency, 0.0, strict=True)
        check_number("absorber.mass", self.mass, 0.0, strict=True)
        check_number("absorber.damping_ratio", self.damping_ratio, 0.0)

    @property
    def stiffness(self) -> float:
        """k_a = m_a (2π f_N)² [N/m] (Eq. 25)."""
        return self.mass * (2 * pi * self.frequency) ** 2

    @property
    def damping(self) -> float:
        """c_a = 2 ζ_a √(k_a m_a) [N s/m] (Eq. 26)."""
        return 2 * self.damping_ratio * sqrt(self.stiffness * self.mass)


PAPER_POSITIONS: Mapping[str, float] = MappingProxyType(
    {"FC": 1 / 2, "CC": 1 / 3, "BC": 1 / 2, "FR": 0.98, "CR": 0.98, "BR": 0.98}
)
"""
Positions of Fig. 11 as y_b / L: F, C, B (front, centre, back) along the machine, then C, R (centre, right) along the rail.

FC, BC and CC are stated in Section 6. Those to the right are nearly over a pillar (Section 4); how near is not printed, and
0.98 is an assumption. The model does not depend on where the rail stands along the machine.
"""


def position_named(text: str) -> float:
    """A position from text: a name of the paper (`PAPER_POSITIONS`), or a number."""
    try:
        return PAPER_POSITIONS.get(text.strip().upper()) or float(text)
    except ValueError:
        names = ", ".join(PAPER_POSITIONS)
        raise ParameterError(f"position {text!r} is neither a number y_b / L nor one of {names}") from None


_UNITS_CAVEAT = "The paper heads k in N/m and c in N s/m; they are N m/rad and N m s/rad."


def table_1() -> HeadParameters:
    """First guess of the head's parameters, as printed in Table 1."""
    return HeadParameters(
        m1=24.0, m2=0.5, l1=0.1, l2=0.1, theta01=0.0, theta02=radians(90.0),
        k1=522_100.0, k2=10_442.0, c1=36.84, c2=0.72, source="Table 1",
        caveat="Neither damping follows Eq. 20 with ζ = 0.1: c2 is half of Eq. 20's 1.445 (ζ = 0.05), c1 is ζ = 0.05 with "
        "m1 = 26 kg; m1 itself is not Eq. 15's 25 kg at 230 Hz. " + _UNITS_CAVEAT,
    )  # fmt: skip


def table_2() -> tuple[HeadParameters, HeadParameters]:
    """Lower and upper limits of the head's parameters in the fit, as printed in Table 2."""
    lower = HeadParameters(
        m1=23.0, m2=0.4, l1=0.09, l2=0.09, theta01=0.0, theta02=radians(90.0),
        k1=469_890.0, k2=9_397.8, c1=29.48, c2=0.58, source="Table 2, lower", caveat=_UNITS_CAVEAT,
    )  # fmt: skip
    upper = HeadParameters(
        m1=25.0, m2=0.6, l1=0.11, l2=0.11, theta01=radians(10.0), theta02=radians(110.0),
        k1=574_310.0, k2=11_486.2, c1=44.21, c2=0.87, source="Table 2, upper", caveat=_UNITS_CAVEAT,
    )  # fmt: skip
    return lower, upper


def table_3() -> HeadParameters:
    """Optimised parameters of the head, as printed in Table 3."""
    return HeadParameters(
        m1=24.88, m2=0.60, l1=0.097, l2=0.096, theta01=radians(0.65), theta02=radians(110.0),
        k1=522_100.0, k2=10_442.0, c1=44.20, c2=0.58, source="Table 3",
        caveat="m2, theta02, c1 and c2 lie on Table 2's limits: the paper's data do not determine the fit in those "
        "directions. " + _UNITS_CAVEAT,
    )  # fmt: skip


def recovered_rail() -> RailParameters:
    """The rail behind Tables 5 and 6: first frequency of Table 5, mass recovered from Table 6, four modes as Table 6 has."""
    return RailParameters(
        length=2.5, mass=76.5, first_frequency=31.7, damping_ratio=0.01, n_modes=4,
        source="Table 5 (first frequency), least squares over Table 6 (mass), the machine's name HI-2.5 (length)",
        caveat="Neither mass, length nor damping is printed: the mass reproduces Table 6 to 0.2 %, the length only scales "
        "E I and μ, the damping ratio 0.01 is an assumption.",
    )  # fmt: skip


def table_4() -> dict[str, float]:
    """Mean modulus of the model's error at 150-300 Hz [g/N] by position (`PAPER_POSITIONS`), as printed in Table 4."""
    return {"CC": 0.0176, "CR": 0.0207, "FC": 0.0267, "FR": 0.0292}


def table_5() -> tuple[float, ...]:
    """Natural frequencies of the rail without the head [Hz], as printed in Table 5."""
    return (31.7, 126.8, 285.3, 507.1)


def table_6() -> dict[float, tuple[float, ...]]:
    """Six natural frequencies [Hz] of the rail with the head by y_b / L (FC and BC: 1/2; CC: 1/3), as printed in Table 6."""
    return {
        1 / 2: (24.5, 126.8, 210.6, 220.8, 409.1, 507.1),
        1 / 3: (25.7, 107.9, 216.7, 285.3, 317.2, 549.9),
    }


def table_7() -> AbsorberParameters:
    """The tuned absorber of Table 7 by its frequency, damping ratio and mass; the rest follows from Eqs. 25 and 26."""
    return AbsorberParameters(
        frequency=212.0, damping_ratio=0.04, mass=0.08, source="Table 7",
        caveat="The printed k_a = 14,195 N/m is a misprint: Eq. 25 gives 141,945.44 N/m, and Eq. 26 gives the printed "
        "c_a = 8.52 N s/m only with that value.",
    )  # fmt: skip


TABLE_7_PRINTED = {"stiffness": 14_195.0, "damping": 8.52}
"""k_a [N/m] (a misprint) and c_a [N s/m] as Table 7 prints them."""
