"""What column headings say: name and unit, and which column is the time, the frequency or the number of the blow."""

from __future__ import annotations

import re

from cutvib_ss.units import UNITS

TIME_NAMES = (
    "time",
    "t",
    "zeit",
    "temps",
    "tiempo",
    "tempo",
    "x_value",
    "relative time",
    "time relative",
    "elapsed time",
)
FREQ_NAMES = (
    "freq",
    "frequency",
    "f",
    "frequenz",
    "fréquence",
    "frecuencia",
    "frequenza",
    "hz",
    "freqs",
    "frequencies",
)
BLOW_NAMES = ("blow", "hit", "impact", "schlag", "blow number", "hit number")
_SCALES = {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6}
_SCALES |= {"min": 60.0, "hz": 1.0, "khz": 1e3, "1/s": 1.0}

FORCE_NAME = re.compile(r"hammer|force|kraft|impact|impuls|load ?cell|\bforza\b|^f(_?[xyz0-9]*)$", re.IGNORECASE)
"""Names that a column of forces goes by."""
_BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]$")
_PARENTHESES = re.compile(r"^(?P<name>.*?)\s*\((?P<unit>[^()]*(?:\([^()]*\))?[^()]*)\)$")
_SLASH = re.compile(r"^(?P<name>.*?\S)\s+(?:/|in)\s+(?P<unit>\S+)$")
_UNIT_WORDS = {u.lower() for u in UNITS} | set(_SCALES) | {
    "n", "kn", "lbf", "v", "mv", "m/s²", "m/s2", "m/s**2", "m/s^2", "g", "mm/s", "µm", "um", "pa", "-", "deg", "°", "rad",
    "v/v", "mm", "newton", "newtons", "%", "mm/s^2", "mm/s²", "db", "units", "eu",
}  # fmt: skip


def split_heading(cell: str) -> tuple[str, str | None]:
    """Name and unit of a heading: ``Acc 1 [g]``, ``Acc 1 (g)``, ``Zeit / s``; a bracket that is no unit belongs to the name."""
    text = " ".join(cell.replace("\ufeff", "").strip().strip('"').split())
    for pattern in (_BRACKETS, _PARENTHESES, _SLASH):
        match = pattern.match(text)
        if match is None:
            continue
        unit = match["unit"].strip()
        if pattern is _BRACKETS or looks_like_unit(unit):
            return match["name"].strip(), unit or None
    return text, None


def looks_like_unit(text: str) -> bool:
    """Whether a word is a unit, or a ratio of two."""
    word = text.strip().strip("[]()").lower()
    if word in _UNIT_WORDS:
        return True
    top, slash, bottom = word.rpartition("/")
    return bool(slash) and top.strip("()") in _UNIT_WORDS and bottom.strip("()") in _UNIT_WORDS


def scale_of(unit: str | None, default: float = 1.0) -> float | None:
    """Factor of a time or frequency unit to s or Hz; None where it is another."""
    return default if unit is None else _SCALES.get(unit.strip().lower())


def is_named(name: str, names: tuple[str, ...]) -> bool:
    """Whether a heading is one of some names, whatever its case."""
    return name.strip().casefold() in names
