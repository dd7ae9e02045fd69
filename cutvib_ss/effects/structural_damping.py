"""Hysteretic damping in a joint in place of the viscous damper."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from cutvib_ss.effects.base import (
    Carried,
    Effect,
    Measured,
    Model,
    Severity,
    applied,
    attached_to,
    check_place,
    parameter,
    ports_of,
)
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.base import Spring
from cutvib_ss.model.elements import CausalHysteresis, Element, SpringDamperMass
from cutvib_ss.model.paths import Path, with_value
from cutvib_ss.parameters import check_number

FORMS = ("constant", "causal")
"""Ways in which stiffness and loss may depend on frequency."""


@dataclass(frozen=True)
class StructuralDamping(Effect):
    """
    A spring with a loss factor in place of spring and viscous damper in one joint.

    Of another structure it is the spring between the degrees of freedom of a port, and what damping joins them.

    Exact in the frequency response; a plant takes the spring and damper that are the same at one frequency.
    """

    effect: ClassVar[str] = "structural_damping"
    severity = Severity("whole", ("loss_factor",))
    sentence = "{place} has hysteretic damping, not viscous"
    inspection = "look at the material and the contact at {place}: rubber, plastic, glued or bolted faces"

    loss_factor: float = parameter("1", 0.001, 2.0)  # η; rubber in its transition reaches 1 to 2
    # ``"constant"``: k (1 + iη), which no causal material has. ``"causal"``: k √(1 + η²) (iω/ω_0)^α with tan(πα/2) =
    # η, the same loss at all frequencies with the storage stiffness that causality then asks for
    # (`cutvib_ss.model.elements.CausalHysteresis`)
    form: str = "constant"
    # Frequency at which the storage stiffness of the causal form is k [Hz]; the search takes the middle of the band
    reference_frequency: float = field(default=232.5, metadata={"unit": "Hz"})

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("structural_damping: reference_frequency", self.reference_frequency, 0.0, strict=True)
        if self.form not in FORMS:
            raise ParameterError(f"structural_damping: form = {self.form!r} is not one of {', '.join(FORMS)}")

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return tuple(place for place in ports_of(model, ("joint1", "joint2")) if model.spring_at(place, 1) is not None)

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        low, high = measured.band
        # Nobody knows at which frequency the nominal stiffness was found: the middle of the band in either scale.
        middles = ((low + high) / 2, np.sqrt(low * high))
        for place in cls.places(model):
            spring, damper = model.spring_at(place), model.spring_at(place, 1)
            assert spring is not None
            assert damper is not None
            # It takes the viscous damper's place, which is no small step: a small loss says little of a large one.
            middle = 2 * np.pi * (220.0 if model.head is not None else middles[1])
            losses = (float(np.clip(middle * damper[0] / spring[0], 0.005, 1.0)), 0.03, 0.1, 0.3)
            for f in middles:
                yield f"{place} causal {f:.3g} Hz", tuple(cls(place, x, "causal", float(f)) for x in losses)
            yield f"{place} constant", tuple(cls(place, x, "constant") for x in losses)

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        for form in FORMS:
            yield form, lambda severity, form=form: cls(place, 0.08 * severity, form)  # type: ignore[misc]

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        stiffness = model.spring_at(self.place)[0]
        loss: Element = SpringDamperMass(loss_stiffness=self.loss_factor * stiffness)
        if self.form == "causal":
            loss = CausalHysteresis(stiffness, self.loss_factor, self.reference_frequency)
        if model.head is not None:
            model, bare = with_value(model, ("head", "c" + self.place[-1]), 0.0), model
            return applied(bare, attached_to(model, self.place, loss), self)
        damping = self._damper(model, model.effects)[0]
        without = attached_to(model, self.place, SpringDamperMass(damping=-damping))
        return applied(model, attached_to(without, self.place, loss), self)

    def _damper(self, model: Any, before: Sequence[object]) -> Spring:
        """The viscous damper of a port that is still there, after other effects, and the paths that move it."""
        gone = any(isinstance(e, StructuralDamping) and e.place == self.place for e in before)
        return (0.0, ()) if gone else model.spring_at(self.place, 1)

    def _at(self, applied: Any) -> Path:
        return ("attachments", len(applied.attachments) - 1, "element")

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        if self.form == "causal":
            return {"loss_factor": (((*self._at(applied), "loss_factor"), 1.0),)}
        return {"loss_factor": (((*self._at(applied), "loss_stiffness"), applied.spring_at(self.place)[0]),)}

    def carries(self, path: Path, applied: Any) -> Carried:
        # The loss moves with the stiffness; the viscous damper is gone.
        of_loss = ("stiffness", 1.0) if self.form == "causal" else ("loss_stiffness", self.loss_factor)
        found = [
            ((*self._at(applied), of_loss[0]), of_loss[1] * w) for p, w in applied.spring_at(self.place)[1] if p == path
        ]
        if applied.head is not None:
            return () if path == ("head", "c" + self.place[-1]) else ((path, 1.0), *found)
        gone = ("attachments", len(applied.attachments) - 2, "element", "damping")
        found += [(gone, -w) for p, w in self._damper(applied, applied.effects[:-1])[1] if p == path]
        return ((path, 1.0), *found)
