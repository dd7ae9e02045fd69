"""
The cutting machine: head and rail joined by the base-force constraint (Eqs. 5, 6, 10), at any position of the head on the rail.

The response code reads the slots; the second-order form and the python-control plant are built here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.model.base import BaseModel, Spring
from cutvib_ss.model.coupling import Assembly, Changes, Coupling, coupling, head_assembly, head_core_changes
from cutvib_ss.model.elements import Attachment, Element, Guide, equivalent_guide
from cutvib_ss.model.head import HEAD_PARAMETERS, HEAD_UNITS
from cutvib_ss.model.measurement_chain import MeasurementChain
from cutvib_ss.model.paths import Path, replaced, value_at
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.rail import Rail, equivalent_rail, rail, rail_points
from cutvib_ss.model.second_order import Channel, MatrixStack, SecondOrder
from cutvib_ss.parameters import (
    HeadParameters,
    RailParameters,
    Tolerances,
    check_position,
    recovered_rail,
    table_3,
)
from cutvib_ss.results import FloatArray, Quantity
from cutvib_ss.results.display import Table

if TYPE_CHECKING:
    import control

CUTTING_CHANNELS: Mapping[str, Channel] = MappingProxyType(
    {
        "tool_x": Channel("tool_x", "acceleration"),
        "tool_z": Channel("tool_z", "acceleration"),
        "base_x": Channel("base", "acceleration"),
    }
)
"""Accelerometers of a campaign on the cutting machine."""

CUTTING_SIGNALS: Mapping[str, str] = MappingProxyType({"force": "tool_x", "base_x": "base"})
"""Signal names of the cutting machine that are not the names of their ports."""

PLACE_PORTS: Mapping[str, str] = MappingProxyType({"tool": "tool_x", "head": "head_x"})
"""Port at which an element at a place of the cutting machine acts, in X."""

PLANT_OUTPUTS = ("tool_x", "tool_z", "base_x", "head_x", "head_z")
"""Outputs of its plant by default."""


@dataclass(frozen=True)
class Machine(BaseModel):
    """
    The cutting machine: equivalent robot on a flexible rail.

    Parameters
    ----------
    head : HeadParameters
        The cutting head.
    rail : Rail
        The moving rail.
    tolerance : Tolerances
        How well each value is known.
    attachments : tuple of Attachment
        Elements in parallel at the head's ports; none by default.
    guide : Guide, optional
        Give between rail and head; rigid by default.
    chain : MeasurementChain
        The measurement chain; ideal by default.
    nonlinear : tuple of NonlinearElement
        Nonlinear elements; none by default.
    effects : tuple of object
        The effects behind the filled slots, for the record and for writing machine.toml.
    bare : Machine, optional
        The model before the first effect.

    Examples
    --------
    >>> published_machine().plant(0.5).nstates
    12
    """

    head: HeadParameters
    rail: Rail
    tolerance: Tolerances = field(default_factory=Tolerances)
    attachments: tuple[Attachment, ...] = ()
    guide: Guide | None = None
    chain: MeasurementChain = field(default_factory=MeasurementChain)
    nonlinear: tuple[NonlinearElement, ...] = ()
    effects: tuple[object, ...] = ()
    bare: Machine | None = field(default=None, compare=False, repr=False)

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Accelerometers ``tool_x``, ``tool_z`` and ``base_x``."""
        return CUTTING_CHANNELS

    @property
    def input_port(self) -> str:
        """The cutting force, and the hammer, act on the tool in X."""
        return "tool_x"

    @property
    def input_quantity(self) -> Literal["force", "acceleration"]:
        """A force."""
        return "force"

    @property
    def has_position(self) -> bool:
        """The head travels along the rail."""
        return True

    @property
    def as_written(self) -> Machine:
        """The factors on the damping of single modes are written into the rail's parameters."""
        return replace(self, rail=self.rail.as_written)

    def _table(self) -> Table:
        h, r = self.head, self.rail.parameters
        rows = [(n, f"{getattr(h, n):.6g}", u) for n, u in zip(HEAD_PARAMETERS, HEAD_UNITS, strict=True)]
        head_rows = [(f"{a[0]}, {b[0]}", f"{a[1]}, {b[1]}", a[2]) for a, b in zip(rows[::2], rows[1::2], strict=True)]
        rail_rows = [
            ("rail length, mass", f"{r.length:g} m, {r.mass:g} kg", ""),
            ("rail first frequency", f"{r.first_frequency:g}", "Hz"),
            ("rail damping ratio, modes", f"{r.damping_ratio}, {r.n_modes}", ""),
        ]
        return Table(
            "Cutting machine: head on a flexible rail",
            ("value", "", "unit"),
            head_rows + rail_rows + self._effect_rows(),
        )

    @property
    def default_quantity(self) -> Quantity:
        """Ports are read like accelerometers."""
        return "acceleration"

    @property
    def in_modes(self) -> Machine:
        """The machine as it is: its rail is over its modes already."""
        return self

    @property
    def assembly(self) -> Assembly:
        """The head over its own coordinates and those of the rail under it, with its attachments and guide."""
        return head_assembly(self.head, self.rail, self.attachments, self.guide)

    @property
    def influence(self) -> None:
        """No shaker."""
        return None

    @property
    def places(self) -> tuple[str, ...]:
        """Joints, head and tool."""
        return ("joint1", "joint2", "head", "tool")

    @property
    def force_ports(self) -> tuple[str, ...]:
        """The tool and the head in X and Z, and the base; a point of the rail beside them."""
        return ("tool_x", "tool_z", "head_x", "head_z", "base")

    @property
    def elements(self) -> tuple[Element, ...]:
        along = (
            *(a.element for a in self.rail.attachments),
            *(self.rail.supports.elements if self.rail.supports else ()),
        )
        return (*super().elements, *along, *((self.guide.element,) if self.guide else ()))

    def equivalent(self, s: complex) -> Self:
        guide = None if self.guide is None else equivalent_guide(self.guide, s)
        return replace(super().equivalent(s), rail=equivalent_rail(self.rail, s), guide=guide)

    def port_at(self, place: str) -> str:
        return PLACE_PORTS.get(place, place)

    def port_of(self, signal: str) -> str:
        return CUTTING_SIGNALS.get(signal, signal)

    def rotates(self, signal: str) -> bool:
        return signal.startswith(("joint", "theta")) or "twist" in signal

    def core_changes(self, path: Path) -> Changes | None:
        if path[0] == "head" or path == ("rail", "torsion", "eccentricity"):
            return head_core_changes(self.head, self.rail, self.guide, str(path[-1]))
        return None

    def drive(self, system: SecondOrder) -> FloatArray:
        return system.port(self.input_port)

    def spring_at(self, place: str, power: int = 0) -> Spring | None:
        if place not in ("joint1", "joint2"):
            return None
        path: Path = ("head", "kc"[power] + place[-1])
        return value_at(self, path), ((path, 1.0),)

    def carried_at(self, place: str) -> tuple[float, float, float]:
        h = self.head
        return {
            "head": (h.m1, h.k1 / h.l1**2, h.c1 / h.l1**2),
            "tool": (h.m2, h.k2 / h.l2**2, h.c2 / h.l2**2),
            "joint1": (h.m1 * h.l1**2, h.k1, h.c1),
            "joint2": (h.m2 * h.l2**2, h.k2, h.c2),
        }[place]

    def head_system(self, viscous_at: float | None = None) -> SecondOrder:
        """
        The head alone with its attachments, its base free.

        Parameters
        ----------
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        SecondOrder
            Over θ1, θ2, the base's motion, its twist where the rail twists, and the attachments' own coordinates.
        """
        return replace(self, guide=None).assembly.system(viscous_at)

    def rail_system(self, position: float, points: Mapping[str, float] | None = None) -> SecondOrder:
        """
        The rail alone in modal coordinates.

        Parameters
        ----------
        position : float
            y / L of the port ``at_head`` (and ``at_head_twist``).
        points : mapping of str to float, optional
            More ports along the rail: name to y / L.

        Returns
        -------
        SecondOrder
            Its coordinates and ports are those of `cutvib_ss.model.rail.rail`.
        """
        return rail(self.rail, {"at_head": check_position(position), **(points or {})})

    def coupling(self, viscous_at: float | None = None, points: Mapping[str, float] | None = None) -> Coupling:
        """
        The base-force constraint (Eqs. 5, 6 and 10).

        Parameters
        ----------
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.
        points : mapping of str to float, optional
            More ports along the rail: name to y / L.

        Returns
        -------
        Coupling
            Constant matrices of head and rail, and the rows φ(y).
        """
        return coupling(self.assembly, viscous_at, points)

    def second_order(
        self, position: float | None = None, viscous_at: float | None = None, points: Mapping[str, float] | None = None
    ) -> SecondOrder:
        return self.coupling(viscous_at, points).second_order(check_position(position))

    def matrices(self, positions: ArrayLike, viscous_at: float | None = None) -> MatrixStack:
        places = [check_position(y) for y in np.asarray(positions, dtype=object).ravel()]
        return self.coupling(viscous_at).stack(places)

    def _plant_outputs(self) -> tuple[str, ...]:
        return PLANT_OUTPUTS

    def _plant(
        self,
        position: float | None,
        drives: Sequence[str],
        reads: Sequence[str],
        quantity: Quantity | None,
        viscous_at: float | None,
    ) -> Callable[[Sequence[str]], control.StateSpace]:
        joined = self.coupling(viscous_at, rail_points([*drives, *reads]))
        pushed = {name: self.port_of(name) for name in drives}
        motion: Quantity = quantity or "displacement"
        at = check_position(position)
        return lambda signals: joined.plant(at, pushed, {name: (self.port_of(name), motion) for name in signals})

    def plants(
        self,
        positions: Iterable[float],
        *,
        inputs: str | Sequence[str] = ("force",),
        outputs: str | Sequence[str] = PLANT_OUTPUTS,
        quantity: Quantity = "displacement",
        pade_order: int | None = None,
        viscous_at: float | None = None,
    ) -> tuple[control.StateSpace, ...]:
        """
        The family of plants over positions, in common signals.

        Parameters
        ----------
        positions : iterable of float
            y_b / L of the head, each strictly inside (0, 1).
        inputs, outputs : str or sequence of str
            Signals, as `plant` takes them.
        quantity : {"displacement", "velocity", "acceleration"}
            Which motion the outputs give.
        pade_order : int, optional
            Order of the Padé approximation of channel delays.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        tuple of control.StateSpace
            One a position, in the order given.

        Examples
        --------
        >>> [plant.nstates for plant in published_machine().plants([0.25, 0.5])]
        [12, 12]
        """
        return tuple(
            self.plant(
                y, inputs=inputs, outputs=outputs, quantity=quantity, pade_order=pade_order, viscous_at=viscous_at
            )
            for y in positions
        )

    def replace(self, **values: Any) -> Machine:
        """
        A machine with values of its head, rail or tolerances changed.

        Parameters
        ----------
        **values : float or object
            Values of the head and the rail by their names: ``k2=9000.0``, ``mass=80.0``, ``n_modes=6`` …, ``theta01`` in rad;
            tolerances as ``tolerance_k2``. ``guide``, ``chain`` and the machine's other fields replace those.

        Returns
        -------
        Machine
            A new machine. Of a corrected one the nominal values change, and its effects are applied anew.

        Raises
        ------
        ParameterError
            If there is no such value, with the choices; or one is impossible.

        Examples
        --------
        >>> published_machine().replace(k2=9000.0).head.k2
        9000.0
        """
        return replaced(self, values, {"head": ("head",), "rail": ("rail", "parameters")})


def published_machine() -> Machine:
    """
    The paper's machine: Table 3 and the rail of Tables 5 and 6.

    Returns
    -------
    Machine
        Four rail modes, as Table 6 was computed with.
    """
    return Machine(head=table_3(), rail=Rail(recovered_rail()))


def cutting_machine(head: HeadParameters, rail: RailParameters, tolerance: Tolerances | None = None) -> Machine:
    """
    A bare cutting machine from parameter sets.

    Parameters
    ----------
    head : HeadParameters
        The cutting head.
    rail : RailParameters
        The pinned rail.
    tolerance : Tolerances, optional
        How well each value is known.

    Returns
    -------
    Machine
        With every other slot empty.
    """
    return Machine(head=head, rail=Rail(rail), tolerance=tolerance or Tolerances())
