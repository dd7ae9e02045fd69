"""How the severity of each cause runs from none, for asking how little of it a campaign would see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from cutvib_ss.effects.base import Effect, parameter_fields
from cutvib_ss.gap.hypotheses import Candidate

_ZERO, _ONE, _INFINITE, _WHOLE = "zero", "one", "infinity", "whole"

_HEADS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "rail_torsion": (_INFINITE, ("inertia",)),
    "support_compliance": (_INFINITE, ("k_left", "k_right", "c_left", "c_right")),
    "end_fixity": (_ZERO, ("k_left", "k_right")),
    "rail_added_mass": (_ZERO, ("mass", "damping")),
    "rail_shear": (_INFINITE, ("shear_ratio",)),
    "modal_truncation": (_WHOLE, ("n_modes",)),
    "guide_compliance": (_INFINITE, ("stiffness", "damping")),
    "local_resonator": (_ZERO, ("mass",)),
    "added_mass": (_ZERO, ("mass",)),
    "tool_contact": (_ZERO, ("stiffness", "damping")),
    "parameter_shift": (_ONE, ("factor",)),
    "structural_damping": (_WHOLE, ("loss_factor",)),
    "cubic_stiffness": (_ZERO, ("stiffness3",)),
    "freeplay": (_ZERO, ("gap",)),
    "dry_friction": (_ZERO, ("torque",)),
    "joint_slip": (_ZERO, ("stiffness", "slip_torque")),
    "bilinear_stiffness": (_ZERO, ("asymmetry",)),
    "quadratic_damping": (_ZERO, ("coefficient",)),
    "channel_delay": (_ZERO, ("delay",)),
    "calibration_error": (_ONE, ("gain",)),
    "cross_axis": (_ZERO, ("fraction",)),
    "window_damping": (_ZERO, ("decay_rate",)),
}
"""From where each effect's severity runs, and which of its parameters carry it; the first one is told."""

_REFERENCE = {"factor": 1.05, "gain": 1.05, "delay": 1e-4, "fraction": 0.05}
"""Values at severity one, where the start of a fit is no effect at all."""


@dataclass(frozen=True)
class Run:
    """
    A cause whose severity runs from none.

    Parameters
    ----------
    name : str
        Effect, place, and parameter or channel that it names.
    effect : Effect
        The cause at severity one.
    """

    name: str
    effect: Effect

    @property
    def head(self) -> str:
        """The parameter that tells the severity."""
        return _HEADS[self.effect.effect][1][0]

    @property
    def unit(self) -> str:
        """Its SI unit."""
        found = {f.name: f.metadata["range"].unit for f in parameter_fields(type(self.effect))}
        return str(found.get(self.head, ""))

    @property
    def weak_end(self) -> str:
        """Where its severity ends in nothing: ``"zero"``, ``"one"`` or ``"infinity"``; ``"whole"`` where it does not."""
        return _HEADS[self.effect.effect][0]

    @property
    def whole(self) -> bool:
        """Whether it is either there or not."""
        return _HEADS[self.effect.effect][0] == _WHOLE

    @property
    def parameters(self) -> int:
        """Number of its fitted parameters, at least one."""
        return max(len(parameter_fields(type(self.effect))), 1)

    def at(self, severity: float) -> Effect:
        """
        The cause at a severity.

        Parameters
        ----------
        severity : float
            0 is none, 1 the effect given.

        Returns
        -------
        Effect
            The effect.
        """
        start, names = _HEADS[self.effect.effect]
        if start == _WHOLE:
            return self.effect
        values = {name: float(getattr(self.effect, name)) for name in names}
        moved: dict[str, Any]
        if start == _ONE:
            moved = {name: 1.0 + (value - 1.0) * severity for name, value in values.items()}
        else:
            moved = {name: value * severity if start == _ZERO else value / severity for name, value in values.items()}
        return replace(self.effect, **moved)

    def size(self, severity: float) -> float:
        """
        How strong the cause is, comparable between its shapes.

        Parameters
        ----------
        severity : float
            The severity.

        Returns
        -------
        float
            The telling parameter's distance from where it is no effect; its reciprocal where that is infinity.
        """
        start, _ = _HEADS[self.effect.effect]
        value = float(getattr(self.at(severity), self.head))
        return 1.0 / abs(value) if start == _INFINITE else abs(value - 1.0 if start == _ONE else value)

    def believable(self, severity: float) -> bool:
        """
        Whether its parameters lie in the ranges that an engineer would believe.

        Parameters
        ----------
        severity : float
            The severity.

        Returns
        -------
        bool
            False where the strong end of a range is passed; weaker than any range is fine.
        """
        start, _ = _HEADS[self.effect.effect]
        own = {f.name: f.metadata["range"] for f in parameter_fields(type(self.effect))}
        if self.head not in own:
            return True
        value, bounds = float(getattr(self.at(severity), self.head)), own[self.head]
        if start == _INFINITE:
            return bool(value >= bounds.low)
        return bool(bounds.low <= value <= bounds.high) if start == _ONE else bool(abs(value) <= bounds.high)


def runs(candidates: Sequence[Candidate]) -> tuple[tuple[Run, ...], ...]:
    """
    The ways in which each cause can be weak, one a shape that severity does not change.

    Parameters
    ----------
    candidates : sequence of Candidate
        Causes with their starts.

    Returns
    -------
    tuple of tuple of Run
        For each effect, place, and parameter or channel that it names, its shapes: a resonance at each frequency, ends that give
        in each proportion.
    """
    causes: dict[tuple[str, ...], dict[tuple[Any, ...], Run]] = {}
    for candidate in candidates:
        for start in candidate.starts:
            if getattr(start, "contact_stiffness", None) is not None:
                continue  # without a gap it is another spring, not nothing
            effect = _told(start)
            named = tuple(str(getattr(effect, n)) for n in ("parameter", "channel") if hasattr(effect, n))
            key = (effect.effect, effect.place, *named)
            causes.setdefault(key, {}).setdefault(_shape(effect), Run(" ".join(key), effect))
    return tuple(tuple(shapes.values()) for shapes in causes.values())


def _told(start: Effect) -> Effect:
    """A start that is an effect at all."""
    _, names = _HEADS[start.effect]
    none = 1.0 if _HEADS[start.effect][0] == _ONE else 0.0
    changes: dict[str, Any] = {n: _REFERENCE[n] for n in names if n in _REFERENCE and getattr(start, n) == none}
    return replace(start, **changes)


def _shape(effect: Effect) -> tuple[Any, ...]:
    """What of an effect its severity does not change."""
    start, names = _HEADS[effect.effect]
    if start == _WHOLE:
        return (effect,)
    heads = np.array([float(getattr(effect, n)) for n in names])
    ratio = tuple(np.round(heads / heads[0], 2).tolist())
    return (ratio, *(getattr(effect, f.name) for f in fields(effect) if f.name not in names))
