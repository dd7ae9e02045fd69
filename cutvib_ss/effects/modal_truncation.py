"""Too few modes of the rail in the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Measured, Model, Severity
from cutvib_ss.effects.machine_effect import MachineEffect, Starts
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine

FAR = 10.0
"""A rail mode this many times above the band is no cause."""


@dataclass(frozen=True)
class ModalTruncation(MachineEffect):
    """The rail has more modes than the model; nothing to fit but their number."""

    effect: ClassVar[str] = "modal_truncation"
    severity = Severity("whole", ("n_modes",))
    sentence = "the model has too few rail modes"
    inspection = "nothing on the machine: raise n_modes of the model"

    n_modes: int  # Number of modes that the response needs

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.n_modes, bool) or not isinstance(self.n_modes, int) or self.n_modes < 1:
            raise ParameterError(f"modal_truncation: n_modes = {self.n_modes!r} must be a whole number, at least 1")

    @classmethod
    def starts_on(cls, machine: Machine, measured: Measured) -> Starts:
        p = machine.rail.parameters
        # Modes far above the band add a stiffness that nothing could tell from the tuning.
        omitted = p.first_frequency * (p.n_modes + 1) ** 2
        counts = {p.n_modes + 1, p.n_modes + 2, 2 * p.n_modes, 5 * p.n_modes}
        for n in sorted(counts) if omitted < FAR * measured.band[1] else ():
            yield str(n), (cls("rail", n),)

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        own = model.rail.parameters.n_modes if model.rail is not None else 1
        yield "", lambda severity: cls(place, own + round(3 * severity))

    def changed_machine(self, machine: Machine) -> Machine:
        parameters = replace(machine.rail.parameters, n_modes=self.n_modes)
        return replace(machine, rail=replace(machine.rail, parameters=parameters))

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {}
