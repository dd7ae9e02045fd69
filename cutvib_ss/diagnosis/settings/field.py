"""A number of judgement with its description: unit, meaning, effect of a larger value, source."""

from __future__ import annotations

from dataclasses import field
from typing import Any

Weighted = tuple[tuple[float, float], ...]
JUDGEMENT = "judgement"
TIME = "computing time"
NUMERICAL = "numerical accuracy"
SIMULATED = "simulated campaigns of known cause"
STATISTICS = "statistics"


def of(value: Any, unit: str, meaning: str, effect: str, source: str) -> Any:
    """A field with its description."""
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "effect": effect, "source": source})
