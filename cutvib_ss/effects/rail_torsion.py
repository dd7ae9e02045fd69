"""The cutting force is eccentric to the shear centre of the rail and twists it, head and all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, applied, check_place, machine_only, parameter
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.rail import Torsion
from cutvib_ss.model.twist import FINE_ELEMENTS, TWIST_ELEMENTS


@dataclass(frozen=True)
class RailTorsion(Effect):
    """
    Twist of the rail under the head's eccentric load (the paper's own outlook, end of Section 3.3).

    Parameters
    ----------
    place : str
        ``"rail"``.
    eccentricity : float
        Distance in Z from the rail's shear centre to the head's first joint [m].
    inertia : float
        Polar moment of inertia of the whole rail [kg m²].
    torsion_frequency : float
        First natural frequency of torsion, without the head [Hz].
    damping_ratio : float
        Damping ratio of the first torsion mode; of the others in proportion to their frequencies.
    elements : int
        Elements of the mesh on which the rail twists, a convention (`cutvib_ss.model.twist`); not fitted.

    Notes
    -----
    The head's first joint moves with w + e ψ, and both links turn with ψ (`cutvib_ss.model.head`). The
    accelerometer ``base_x`` lies on the shear centre and shows w alone.
    """

    effect: ClassVar[str] = "rail_torsion"

    eccentricity: float = parameter("m", -0.2, 0.2, "linear", minimum=None)
    inertia: float = parameter("kg m^2", 0.02, 10.0)
    torsion_frequency: float = parameter("Hz", 30.0, 800.0)
    damping_ratio: float = parameter("1", 0.001, 0.1)
    elements: int = TWIST_ELEMENTS

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("rail",) if isinstance(model, Machine) else ()

    @property
    def conventions(self) -> tuple[RailTorsion, ...]:
        return (replace(self, elements=FINE_ELEMENTS),)

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        machine = machine_only(self.effect, model)
        torsion = Torsion(
            self.eccentricity, self.inertia, self.torsion_frequency, self.damping_ratio, int(self.elements)
        )
        return applied(machine, replace(machine, rail=replace(machine.rail, torsion=torsion)), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        names = ("eccentricity", "inertia", "torsion_frequency", "damping_ratio")
        return {name: ((("rail", "torsion", name), 1.0),) for name in names}
