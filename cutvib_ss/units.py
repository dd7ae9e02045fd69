"""Conversions at the border: everything inside the package is SI."""

from collections.abc import Mapping
from types import MappingProxyType

from cutvib_ss.errors import DataFormatError

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of gravity [m/s^2] (ISO 80000-3), the `g` of accelerometers."""

UNITS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "N": ("force", 1.0),
        "m/s^2": ("acceleration", 1.0),
        "g": ("acceleration", STANDARD_GRAVITY),
        "m/s": ("velocity", 1.0),
        "m": ("displacement", 1.0),
        "mm": ("displacement", 1e-3),
    }
)
"""Every unit that is read: its quantity, and its value in SI units."""

SI_UNIT: Mapping[str, str] = MappingProxyType(
    {"force": "N", "acceleration": "m/s^2", "velocity": "m/s", "displacement": "m"}
)
"""The SI unit of each quantity."""

DERIVATIVE_ORDER: Mapping[str, int] = MappingProxyType({"displacement": 0, "velocity": 1, "acceleration": 2})
"""Time derivatives of displacement behind each motion quantity."""

DISPLACEMENT_UNITS = ("m", "rad", "kg^0.5 m")
"""Units of what moves: a point, a joint or twist, a mass-normalised modal coordinate."""

FORCE_OF: Mapping[str, str] = MappingProxyType({"m": "N", "rad": "N m", "kg^0.5 m": "kg^-0.5 N"})
"""Unit of the force that does work on each displacement: force, torque, modal force."""

_PER_TIME = {"displacement": "", "velocity": "/s", "acceleration": "/s^2"}


def percent(part: float) -> str:
    """A part of something in percent, to two digits."""
    return f"{100 * part:.2g} %" if abs(part) < 0.995 else f"{100 * part:.0f} %"


def rate_unit(displacement: str, quantity: str) -> str:
    """Unit of a displacement's time derivative: ``rate_unit("rad", "velocity")`` is ``"rad/s"``."""
    return displacement + _PER_TIME[quantity]


def ratio_unit(numerator: str, denominator: str) -> str:
    """Unit of one over the other, in brackets where the denominator is a product or a quotient."""
    return f"{numerator}/({denominator})" if {" ", "/"} & set(denominator) else f"{numerator}/{denominator}"


_SPELLINGS = {
    "m/s²": "m/s^2", "m/s2": "m/s^2", "m/s**2": "m/s^2", "m/sec^2": "m/s^2", "m/s/s": "m/s^2", "m/sec²": "m/s^2",
    "(m/s^2)": "m/s^2", "(m/s²)": "m/s^2", "newton": "N", "Newton": "N", "newtons": "N", "Newtons": "N",
    "gn": "g", "g_n": "g", "meter": "m", "metre": "m", "millimeter": "mm", "millimetre": "mm",
}  # fmt: skip


def to_si(unit: str, quantity: str, where: str) -> float:
    """
    Factor that brings values in a unit to SI, after checking what the unit measures.

    >>> to_si("g", "acceleration", "blow.csv: tool_x")
    9.80665
    """
    spelled = unit.strip()
    spelled = _SPELLINGS.get(spelled, spelled)
    if spelled not in UNITS:
        raise DataFormatError(f"{where}: unit {unit!r} is not read; convert to one of {', '.join(UNITS)}")
    measures, factor = UNITS[spelled]
    if measures != quantity:
        raise DataFormatError(
            f"{where}: unit {unit!r} is one of {measures} where {quantity} is expected; give it in {SI_UNIT[quantity]}"
        )
    return factor
