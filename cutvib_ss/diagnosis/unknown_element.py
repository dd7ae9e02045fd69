"""
What is not known: a dynamic stiffness at a port or along the rail, an error of a channel. Hypotheses like any cause.

Each is a complex Gaussian process over log frequency (`model.elements.SmoothElement`), with coefficients N(0, 1). The dynamic
stiffness acts in parallel at the port, the error multiplies the channel's responses by 1 + e(ω). What is smooth holds no resonance:
a dynamic stiffness at a port may have poles beside it. Those of a port or a channel may depend on the level (`ByLevel`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, make_dataclass, replace
from typing import Any, ClassVar

import numpy as np

from cutvib_ss.diagnosis.hypotheses import Candidate
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Carried, Effect, Model, applied, attached_to, channel_choices, channels_of, parameter
from cutvib_ss.effects.prior import Range, Severity
from cutvib_ss.effects.scales import TOLERATED, port_scale, rail_stiffness, resonances_at
from cutvib_ss.model.elements import Guide, SmoothElement, SprungMass
from cutvib_ss.model.paths import Path
from cutvib_ss.model.rail import EndSupports, RailAttachment
from cutvib_ss.parameters import Tolerances

PORTS: Mapping[str, str] = {
    "joint1": "joint1",
    "joint2": "joint2",
    "tool_x": "tool",
    "tool_z": "tool",
    "head_x": "head",
}
"""Ports of the cutting machine at which an unknown element may sit, and the places that they belong to."""

_NAMES = tuple(f"c{k}" for k in range(2 * SETTINGS.unknown_knots))
_NORMAL = Range("1", 0.0, 1.0, "normal", None)
_ALONG = Range("1", 0.02, 0.98, "linear")
_RIGID = 1e8
"""Stiffness of a guide or support that does not give, over that of the rail's first mode."""
_WEAK = 10.0
"""Stiffness of one that would be weak by an engineer's measure, over the same."""


class _Unknown(Effect):
    """What `UnknownElement` does; its coefficients are fields of the dataclass below."""

    effect: ClassVar[str] = "unknown"
    severity = Severity("whole", _NAMES[:1])

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return tuple(dict.fromkeys(ports_of(model).values()))

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        return dict.fromkeys(_NAMES, _NORMAL)

    @property
    def site(self) -> str:
        """Where it sits, more closely than the place."""
        return str(self.port)  # type: ignore[attr-defined]

    @property
    def element(self) -> SmoothElement:
        """The smooth function with its coefficients."""
        own: Any = self
        return SmoothElement(own.scale, (own.low, own.high), tuple(getattr(self, name) for name in _NAMES))

    def apply(self, model: Any) -> Any:
        return applied(model, attached_to(model, self.port, self.element), self)  # type: ignore[attr-defined]

    def paths(self, applied: Any) -> tuple[Path, ...]:
        """Where a model that it was applied to holds it; several times where it is the error of all channels."""
        return (("attachments", len(applied.attachments) - 1, "element"),)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        at = self.paths(applied)
        return {name: tuple(((*path, "coefficients", k), 1.0) for path in at) for k, name in enumerate(_NAMES)}

    def by_size(self) -> dict[str, float]:
        # It has no form that could err.
        return {}


class ByLevel(_Unknown):
    """What `UnknownForce` and `UnknownSensor` do: the same with a value of each coefficient for every level."""

    linear: ClassVar[bool] = False

    def tolerated(self, model: Any) -> bool:
        # A tolerance of calibration is of a sensor that is the same at every level.
        return False


class _AlongRail(_Unknown):
    """What `UnknownAlongRail` does: the same at a point of the rail that is not known either."""

    @property
    def site(self) -> str:
        return "rail"

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("rail",) if model.rail is not None else ()

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        return {**super().ranges(model, place, motion), "position": _ALONG}

    def apply(self, model: Any) -> Any:
        point = RailAttachment(self.element, self.position)  # type: ignore[attr-defined]
        rail = replace(model.rail, attachments=(*model.rail.attachments, point))
        return applied(model, replace(model, rail=rail), self)

    def paths(self, applied: Any) -> tuple[Path, ...]:
        return (("rail", "attachments", len(applied.rail.attachments) - 1, "element"),)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        [at] = self.paths(applied)
        return {**super().moves(applied), "position": (((*at[:-1], "position"), 1.0),)}


class _Give(_Unknown):
    """What `UnknownGive` does: a smooth compliance in series, in the guide or under both ends of the rail alike."""

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("head_base", "rail_ends") if model.rail is not None else ()

    def apply(self, model: Any) -> Any:
        own: Any = self
        if self.place == "head_base":
            guide = model.guide or Guide(own.stiff)
            return applied(model, replace(model, guide=replace(guide, give=self.element)), self)
        ends = model.rail.supports or EndSupports(own.stiff, own.stiff)
        return applied(model, replace(model, rail=replace(model.rail, supports=replace(ends, give=self.element))), self)

    def paths(self, applied: Any) -> tuple[Path, ...]:
        return (("guide", "give") if self.place == "head_base" else ("rail", "supports", "give"),)


class _OfChannel(_Unknown):
    """What `UnknownChannelError` does: a smooth error of a channel, or of all (the force)."""

    measurement: ClassVar[bool] = True

    @property
    def site(self) -> str:
        return f"channel {self.port}"  # type: ignore[attr-defined]

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("measurement",)

    def apply(self, model: Any) -> Any:
        chain = model.chain
        for name in channels_of(self.effect, self.port, model):  # type: ignore[attr-defined]
            chain = chain.with_channel(name, replace(chain.channel(name), error=self.element))
        return applied(model, replace(model, chain=chain), self)

    def tolerated(self, model: Any) -> bool:
        own: Any = self
        over = np.geomspace(own.low, own.high, 10 * SETTINGS.unknown_knots)
        error = self.element.dynamic_stiffness(2j * np.pi * over)
        # Gain and phase each in its mean square over the band, as the tolerance of a sensor is stated.
        largest = max(np.mean(error.real**2), np.mean(error.imag**2))
        return bool(largest <= (TOLERATED * _calibration(model)) ** 2)

    def paths(self, applied: Any) -> tuple[Path, ...]:
        names = channels_of(self.effect, self.port, applied)  # type: ignore[attr-defined]
        return tuple(("chain", "channels", name, "error") for name in names)


def _coefficient() -> Any:
    return field(default=0.0, metadata={"range": _NORMAL})


def _made(name: str, base: type, doc: str, *more: Any) -> Any:
    fixed = [("port", str, ""), ("scale", float, 1.0), ("low", float, 1.0), ("high", float, 100.0)]
    fitted: list[Any] = [(each, float, _coefficient()) for each in _NAMES]
    about = {"__module__": __name__, "__doc__": doc}
    return make_dataclass(name, [*fixed, *fitted, *more], bases=(base,), frozen=True, namespace=about)


UnknownElement: Any = _made("UnknownElement", _Unknown, "A smooth dynamic stiffness of unknown form at a port.")
UnknownAlongRail: Any = _made(
    "UnknownAlongRail",
    _AlongRail,
    "A smooth dynamic stiffness of unknown form at a point of the rail.",
    ("position", float, field(default=0.5, metadata={"range": _ALONG})),
)
UnknownGive: Any = _made(
    "UnknownGive",
    _Give,
    "A smooth compliance of unknown form in series with the guide, or with the supports of the rail.",
    ("stiff", float, 1e12),
)
UnknownChannelError: Any = _made("UnknownChannelError", _OfChannel, "A smooth error of unknown form of a channel.")


def _by_level(name: str, base: type, doc: str) -> Any:
    about = {"__module__": __name__, "__doc__": doc}
    return make_dataclass(name, [], bases=(ByLevel, base), frozen=True, namespace=about)


UnknownForce: Any = _by_level("UnknownForce", UnknownElement, "A restoring force of unknown form at a port.")
UnknownSensor: Any = _by_level(
    "UnknownSensor", UnknownChannelError, "A channel whose error depends on the level, in a form that is not known."
)


@dataclass(frozen=True)
class UnknownPole(Effect):
    """A pair of poles of an unknown dynamic stiffness at a port: passive, so that of a sprung mass."""

    effect: ClassVar[str] = "unknown"
    severity = Severity("whole", ("mass",))

    port: str
    mass: float = parameter("kg", 1e-3, 1.0)  # kg m² at a joint
    frequency: float = parameter("Hz", 10.0, 600.0)
    damping_ratio: float = parameter("1", 0.002, 0.2)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return tuple(dict.fromkeys(ports_of(model).values()))

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        given, scale = super().ranges(model, place, motion), port_scale(model, place)
        mass = replace(given["mass"], low=1e-3 * scale.mass, high=scale.mass)
        return {**given, "mass": mass, "frequency": resonances_at(model, place, given["frequency"])}

    @property
    def site(self) -> str:
        """Where it sits, more closely than the place."""
        return self.port

    def apply(self, model: Any) -> Any:
        element = SprungMass(self.mass, self.frequency, self.damping_ratio)
        return applied(model, attached_to(model, self.port, element), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        at = ("attachments", len(applied.attachments) - 1, "element")
        return {name: (((*at, name), 1.0),) for name in ("mass", "frequency", "damping_ratio")}

    def by_size(self) -> dict[str, float]:
        # Of unknown form as it is, it has none that could err.
        return {}


def ports_of(model: Model) -> Mapping[str, str]:
    """Ports at which an unknown element may sit, with their places."""
    if model.has_position:
        return PORTS
    return {place: place for place in model.places}


def unknown_places(model: Model, channels: Sequence[str], by_level: bool = False) -> tuple[str, ...]:
    """The place of each unknown element, or of each that depends on the level, that is tried: a place as often as it has sites."""
    of_rail = ("rail", "head_base", "rail_ends") if model.has_position and not by_level else ()
    return (*ports_of(model).values(), *of_rail, *("measurement",) * len(channel_choices(tuple(channels))))


def unknown_candidates(
    model: Model, band: tuple[float, float], channels: Sequence[str] = (), by_level: bool = False
) -> tuple[Candidate, ...]:
    """
    An unknown element at each site, or one that depends on the level, of the middle amplitude; along the rail from several starts.
    """
    sites = [(e,) for e in _at_ports(model, band, UnknownForce if by_level else UnknownElement)]
    if not by_level and model.has_position:
        sites += [_along_rail(model, band), *((e,) for e in _giving(model, band))]
    sites += [(e,) for e in _of_channels(model, band, channels, UnknownSensor if by_level else UnknownChannelError)]
    middle = SETTINGS.unknown_amplitudes[len(SETTINGS.unknown_amplitudes) // 2]
    return tuple(
        Candidate(f"unknown {starts[0].site}", tuple(replace(e, scale=middle * e.scale) for e in starts))
        for starts in sites
    )


def unknown_poles(model: Model, element: Any) -> tuple[UnknownPole, ...]:
    """Poles over the band beside an unknown element, small and large; none beside one that sits at no port."""
    if type(element) is not UnknownElement:
        return ()
    mass = port_scale(model, element.place).mass
    frequencies = np.geomspace(max(element.low, 1e-3), element.high, SETTINGS.unknown_pole_starts)
    return tuple(
        UnknownPole(element.place, element.port, part * mass, float(f), 0.03)
        for f in frequencies
        for part in (0.01, 0.06)
    )


def amplitude_ratios() -> tuple[float, ...]:
    """Amplitudes of the prior over the middle one."""
    amplitudes = SETTINGS.unknown_amplitudes
    return tuple(a / amplitudes[len(amplitudes) // 2] for a in amplitudes)


def of_other_amplitudes(element: Any) -> tuple[Any, ...]:
    """The same function under each other amplitude of the prior; of an element of the middle one."""
    return tuple(
        replace(element, scale=element.scale * r, **{name: getattr(element, name) / r for name in _NAMES})
        for r in amplitude_ratios()
        if r != 1.0
    )


def _at_ports(model: Model, band: tuple[float, float], kind: Any) -> tuple[Any, ...]:
    """An unknown element, or restoring force, at each port, of the size of what the port carries."""
    return tuple(
        kind(place, port, _carried(model, place, port, band), *band) for port, place in ports_of(model).items()
    )


def _carried(model: Model, place: str, port: str, band: tuple[float, float]) -> float:
    """Dynamic stiffness of what a port carries, at mid band."""
    scale = port_scale(model, place)
    return scale.stiffness if port == "tool_z" else max(scale.stiffness, scale.mass * _middle(band) ** 2)


def _middle(band: tuple[float, float]) -> float:
    return float(2 * np.pi * np.sqrt(band[0] * band[1]))


def _along_rail(model: Model, band: tuple[float, float]) -> tuple[Any, ...]:
    """An unknown element at points of the rail, from which it moves, of the size of what the first mode carries."""
    assert model.rail is not None
    p = model.rail.parameters
    size = max(rail_stiffness(model), p.mass / 2 * _middle(band) ** 2)
    return tuple(
        UnknownAlongRail("rail", f"rail({station:g})", size, *band, position=station)
        for station in SETTINGS.unknown_stations
    )


def _giving(model: Model, band: tuple[float, float]) -> Iterator[Any]:
    """An unknown compliance of the guide and of the supports, of the size of what the rail's first mode gives."""
    assert model.rail is not None
    stiffness = rail_stiffness(model)
    for place in ("head_base", "rail_ends"):
        yield UnknownGive(place, place, 1.0 / (_WEAK * stiffness), *band, stiff=_RIGID * stiffness)


def _of_channels(model: Model, band: tuple[float, float], channels: Sequence[str], kind: Any) -> Iterator[Any]:
    """An unknown error of each channel and of all, beyond the stated tolerance."""
    size = SETTINGS.unknown_channel * _calibration(model) / min(SETTINGS.unknown_amplitudes)
    for channel in channel_choices(tuple(channels)):
        yield kind("measurement", channel, size, *band)


def _calibration(model: Model) -> float:
    """Tolerance of a channel's calibration."""
    return model.tolerance.calibration or Tolerances().calibration
