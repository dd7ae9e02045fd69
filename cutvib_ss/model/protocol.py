"""
The slots that every kind of model has: attachments, measurement chain, nonlinear elements; all empty by default.

A model is frozen data with named slots; what is absent is an empty slot, never a branch elsewhere. Effects return a new model
with a slot filled. A value in a slot is named by its path, so that fits can move it and responses differentiate by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from types import MappingProxyType
from typing import Literal, Protocol, Self, runtime_checkable

from numpy.typing import ArrayLike

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.coupling import Assembly, Changes
from cutvib_ss.model.elements import Attachment, Element
from cutvib_ss.model.measurement_chain import MeasurementChain
from cutvib_ss.model.parts import Part
from cutvib_ss.model.paths import Path
from cutvib_ss.model.rail import Rail
from cutvib_ss.model.restoring_forces import RestoringForce, law
from cutvib_ss.model.second_order import Channel, MatrixStack, SecondOrder
from cutvib_ss.parameters import HeadParameters
from cutvib_ss.results import FloatArray, Quantity


@dataclass(frozen=True)
class NonlinearElement:
    """A nonlinear law between a port's motion and the force there, which linear analyses ignore."""

    port: str  # Name of the port
    law: str  # Name of the law, one of `cutvib_ss.model.restoring_forces`
    parameters: Mapping[str, float]  # The law's parameters [SI]

    def __post_init__(self) -> None:
        kind = law(self.law)
        needed = {f.name for f in fields(kind) if f.default is MISSING}
        if not needed <= set(self.parameters) <= set(kind.units()):
            raise ParameterError(
                f"{self.law} has the parameters {', '.join(kind.units())}; {', '.join(self.parameters)} given"
            )
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))
        object.__setattr__(self, "restoring_force", kind(**self.parameters))

    restoring_force: RestoringForce = field(init=False, repr=False, compare=False)
    """The law with its parameters."""


@runtime_checkable
class Model(Protocol):
    """What the response code, the measurement and the diagnosis need of a model, whichever its kind."""

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Response channels of a campaign on this model."""
        ...

    @property
    def input_port(self) -> str:
        """Port at which a campaign's force acts."""
        ...

    @property
    def input_quantity(self) -> Literal["force", "acceleration"]:
        """What a campaign's ``force`` channel holds."""
        ...

    @property
    def has_position(self) -> bool:
        """Whether the model depends on a position."""
        ...

    @property
    def head(self) -> HeadParameters | None:
        """The cutting head; None where there is none."""
        ...

    @property
    def rail(self) -> Rail | None:
        """The rail; None where there is none."""
        ...

    @property
    def places(self) -> tuple[str, ...]:
        """Places at which an element may be attached."""
        ...

    @property
    def force_ports(self) -> tuple[str, ...]:
        """Ports at which a force may act."""
        ...

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Elements in parallel at ports."""
        ...

    @property
    def elements(self) -> tuple[Element, ...]:
        """All linear elements that are attached anywhere."""
        ...

    def equivalent(self, s: complex) -> Self:
        """The model with a spring and damper for each element that leaves no finite set of poles, equal to it at one s [rad/s]."""
        ...

    @property
    def chain(self) -> MeasurementChain:
        """The measurement chain."""
        ...

    @property
    def nonlinear(self) -> tuple[NonlinearElement, ...]:
        """Nonlinear elements."""
        ...

    @property
    def default_quantity(self) -> Quantity:
        """Motion that is read of ports that are no channels."""
        ...

    @property
    def assembly(self) -> Assembly:
        """What stands on the rail, or the structure: core, elements, and the coordinates that follow the rail."""
        ...

    @property
    def in_modes(self) -> Self:
        """The same model over coordinates that couple little: a structure over its undamped modes, a machine as it is."""
        ...

    @property
    def influence(self) -> FloatArray | None:
        """How the core moves with the base of a shaker, r; None where the input is a force."""
        ...

    def port_at(self, place: str) -> str:
        """The port through which an element at a place acts."""
        ...

    def place_of(self, port: str) -> str:
        """The place that a port belongs to."""
        ...

    def spring_at(self, place: str, power: int = 0) -> tuple[float, tuple[tuple[Path, float], ...]] | None:
        """The spring that a place spans, or the damper beside it (power of s), and the paths that move it; None without."""
        ...

    def carried_at(self, place: str) -> tuple[float, float, float]:
        """Mass, stiffness and damping that a place carries."""
        ...

    def port_of(self, signal: str) -> str:
        """The port behind a signal or channel; any other name is its own port."""
        ...

    def base_share(self, signal: str) -> float:
        """How a signal moves with a shaker's base, where it reads absolute motion; 0 elsewhere."""
        ...

    def rotates(self, signal: str) -> bool:
        """Whether a signal is a rotation."""
        ...

    @property
    def matrix_parts(self) -> tuple[Part, ...]:
        """Parts of its matrices that may err one by one; none where its values are tuned one by one."""
        ...

    @property
    def highest_mode(self) -> tuple[float, float] | None:
        """Natural frequency [Hz] and damping ratio of its highest mode, where those above are left out; None where it has all."""
        ...

    def accelerance_above(self, signal: str) -> float:
        """Driving-point accelerance at a signal's port far above the highest mode [1/kg]."""
        ...

    def core_changes(self, path: Path) -> Changes | None:
        """How the core moves with one of the model's values; None where it does not."""
        ...

    def drive(self, system: SecondOrder) -> FloatArray:
        """How a unit of the ``force`` channel pushes each degree of freedom of `second_order`."""
        ...

    def second_order(
        self, position: float | None = None, viscous_at: float | None = None, points: Mapping[str, float] | None = None
    ) -> SecondOrder:
        """The exact second-order form at a position."""
        ...

    def matrices(self, positions: ArrayLike, viscous_at: float | None = None) -> MatrixStack:
        """Mass, damping and stiffness at several positions."""
        ...
