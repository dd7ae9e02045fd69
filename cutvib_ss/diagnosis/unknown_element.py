"""An unknown element at a port: a hypothesis like any cause, with a dynamic stiffness that is only known to be smooth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, make_dataclass
from typing import Any, ClassVar

import numpy as np

from cutvib_ss.diagnosis.hypotheses import Candidate
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Carried, Effect, Model, applied, attached_to
from cutvib_ss.effects.prior import Range, Severity
from cutvib_ss.effects.scales import port_scale
from cutvib_ss.model.elements import SmoothElement

PORTS: Mapping[str, str] = {
    "joint1": "joint1",
    "joint2": "joint2",
    "tool_x": "tool",
    "tool_z": "tool",
    "head_x": "head",
}
"""Ports of the cutting machine at which an unknown element may sit, and the places that they belong to."""

_NAMES = tuple(f"c{k}" for k in range(2 * SETTINGS.unknown_knots))


class _Unknown(Effect):
    """What `UnknownElement` does; its coefficients are fields of the dataclass below."""

    effect: ClassVar[str] = "unknown"
    severity = Severity("whole", _NAMES[:1])

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return tuple(dict.fromkeys(ports_of(model).values()))

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        return {name: Range("1", 0.0, 1.0, "normal", None) for name in _NAMES}

    def apply(self, model: Any) -> Any:
        own: Any = self
        element = SmoothElement(own.scale, (own.low, own.high), tuple(getattr(self, name) for name in _NAMES))
        return applied(model, attached_to(model, own.port, element), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        at = ("attachments", len(applied.attachments) - 1, "element", "coefficients")
        return {name: (((*at, k), 1.0),) for k, name in enumerate(_NAMES)}

    def by_size(self) -> dict[str, float]:
        # It has no form that could err.
        return {}


def _coefficient() -> Any:
    return field(default=0.0, metadata={"range": Range("1", 0.0, 1.0, "normal", None)})


UnknownElement: Any = make_dataclass(
    "UnknownElement",
    [("port", str, ""), ("scale", float, 1.0), ("low", float, 1.0), ("high", float, 100.0)]
    + [(name, float, _coefficient()) for name in _NAMES],
    bases=(_Unknown,),
    frozen=True,
    namespace={"__module__": __name__, "__doc__": "A smooth dynamic stiffness of unknown form at a port."},
)


class _Force(_Unknown):
    """What `UnknownForce` does: the same with a value of each coefficient for every level."""

    linear: ClassVar[bool] = False


UnknownForce: Any = make_dataclass(
    "UnknownForce",
    [],
    bases=(_Force, UnknownElement),
    frozen=True,
    namespace={"__module__": __name__, "__doc__": "A restoring force of unknown form at a port."},
)


def ports_of(model: Model) -> Mapping[str, str]:
    """Ports at which an unknown element may sit, with their places."""
    if model.has_position:
        return PORTS
    return {place: place for place in model.places}


def unknown_candidates(model: Model, band: tuple[float, float], kind: Any = UnknownElement) -> tuple[Candidate, ...]:
    """An unknown element, or restoring force, at each port, with each amplitude."""
    out = []
    middle = 2 * np.pi * np.sqrt(band[0] * band[1])
    for port, place in ports_of(model).items():
        scale = port_scale(model, place)
        own = max(scale.stiffness, scale.mass * middle**2)
        if port == "tool_z":
            own = port_scale(model, "tool").stiffness
        for amplitude in SETTINGS.unknown_amplitudes:
            element = kind(place, port, amplitude * own, *band)
            out.append(Candidate(f"unknown {port} {amplitude:g}", (element,)))
    return tuple(out)
