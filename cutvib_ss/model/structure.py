"""Any other structure: M, C, K with ports and channels, taken through the same code as the cutting machine."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.base import BaseModel, Spring
from cutvib_ss.model.coupling import Assembly, Changes, Matrices
from cutvib_ss.model.elements import Attachment
from cutvib_ss.model.measurement_chain import MeasurementChain
from cutvib_ss.model.parts import Part
from cutvib_ss.model.paths import Path, replaced
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.second_order import Channel, MatrixStack, SecondOrder
from cutvib_ss.parameters import StructureTolerances
from cutvib_ss.results import FloatArray, Quantity
from cutvib_ss.results.display import Table

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class Structure(BaseModel):
    """
    Any other structure: M, C, K with ports and channels (machine.toml, ``kind = "second_order"``).

    Parameters
    ----------
    system : SecondOrder
        The matrices and ports.
    channels : mapping of str to Channel
        What each response channel reads.
    input_port : str
        Port at which the measured force acts, or which moves with the base.
    input_quantity : {"force", "acceleration"}
        ``"acceleration"``: the structure stands on a shaker, the input is the base's acceleration, motion is relative to it.
    tolerance : StructureTolerances
        How well the matrices are known.
    scales : tuple of float
        Factors on mass, damping and stiffness, which tuning moves.
    parts : tuple of float
        Factors on the parts of the matrices (`cutvib_ss.model.parts`), which tuning moves beside them; ones by default.
    attachments : tuple of Attachment
        Elements in parallel at ports; none by default.
    chain : MeasurementChain
        The measurement chain; ideal by default.
    nonlinear : tuple of NonlinearElement
        Nonlinear elements; none by default.
    effects : tuple of object
        The effects behind the filled slots.
    bare : Structure, optional
        The model before the first effect.
    """

    system: SecondOrder
    channels: Mapping[str, Channel]
    input_port: str
    input_quantity: Literal["force", "acceleration"] = "force"
    tolerance: StructureTolerances = field(default_factory=StructureTolerances)
    scales: tuple[float, float, float] = (1.0, 1.0, 1.0)
    parts: tuple[float, ...] = ()
    attachments: tuple[Attachment, ...] = ()
    chain: MeasurementChain = field(default_factory=MeasurementChain)
    nonlinear: tuple[NonlinearElement, ...] = ()
    effects: tuple[object, ...] = ()
    bare: Structure | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", MappingProxyType(dict(self.channels)))
        if self.system.least_mass <= 0.0:
            raise ParameterError("the mass matrix is not positive definite; check the masses and their signs")
        if all(f == 1.0 for f in self.parts):
            object.__setattr__(self, "parts", (1.0,) * len(self.system.parts))
        elif len(self.parts) != len(self.system.parts):
            raise ParameterError(f"{len(self.parts)} factors on {len(self.system.parts)} parts of the matrices")
        self.system.port(self.input_port)
        for name, channel in self.channels.items():
            if channel.port not in self.system.ports:
                raise ParameterError(f"channel {name!r} reads port {channel.port!r}, which is not under [ports]")

    def _table(self) -> Table:
        rows = [(name, c.port, c.quantity) for name, c in self.channels.items()]
        title = f"Structure of {len(self.system.dofs)} degrees of freedom; {self.input_quantity} at {self.input_port}"
        return Table(title, ("channel", "port", "quantity"), rows)

    @property
    def matrix_parts(self) -> tuple[Part, ...]:
        return self.system.parts

    @property
    def head(self) -> None:
        """No cutting head."""
        return None

    @property
    def rail(self) -> None:
        """No rail."""
        return None

    @property
    def places(self) -> tuple[str, ...]:
        """Its ports; ports whose rows are multiples of each other move together and are one place, named after the first."""
        return tuple(dict.fromkeys(self.place_of(port) for port in self.system.ports))

    @property
    def force_ports(self) -> tuple[str, ...]:
        """All ports."""
        return tuple(self.system.ports)

    def place_of(self, port: str) -> str:
        if port not in self.system.ports:
            return port
        row = self.system.ports[port]
        size = np.linalg.norm(row)
        rows = ((name, other) for name, other in self.system.ports.items())
        return next(n for n, other in rows if abs(row @ other) > (1 - 1e-9) * size * np.linalg.norm(other))

    @property
    def has_position(self) -> bool:
        """A structure has no position."""
        return False

    @property
    def default_quantity(self) -> Quantity:
        """Ports are read in displacement."""
        return "displacement"

    @cached_property
    def _with_parts(self) -> Matrices:
        """Mass, damping and stiffness with the factors of their parts applied."""
        matrices = [self.system.mass, self.system.damping, self.system.stiffness]
        for factor, part in zip(self.parts, self.system.parts, strict=True):
            if factor != 1.0:
                matrices[2 - part.power] = matrices[2 - part.power] + (factor - 1.0) * part.change
        return matrices[0], matrices[1], matrices[2]

    @property
    def scaled(self) -> SecondOrder:
        """The matrices with their factors applied."""
        m, c, k = (factor * matrix for factor, matrix in zip(self.scales, self._with_parts, strict=True))
        return replace(self.system, mass=m, damping=c, stiffness=k)

    @property
    def as_written(self) -> Structure:
        """The factors of a tuned structure are written into its matrices."""
        return replace(self, system=self.scaled, scales=(1.0, 1.0, 1.0), parts=())

    @cached_property
    def in_modes(self) -> Structure:
        """The structure over its undamped modes; on a shaker as it is."""
        # How a base carries the degrees of freedom is no row, and is left as it is.
        return self if self.influence is not None else replace(self, system=self.system.in_modes)

    @property
    def assembly(self) -> Assembly:
        """The matrices with their factors, and what is attached."""
        paths = tuple(("attachments", k, "element") for k in range(len(self.attachments)))
        return Assembly(self.scaled, self.attachments, paths)

    @property
    def influence(self) -> FloatArray | None:
        """On a shaker the row of the input port, r: M q̈ + C q̇ + K q = -M r a."""
        return None if self.input_quantity == "force" else self.system.port(self.input_port)

    def port_of(self, signal: str) -> str:
        if signal == "force":
            return self.input_port
        return self.channels[signal].port if signal in self.channels else signal

    def base_share(self, signal: str) -> float:
        channel, r = self.channels.get(signal), self.influence
        return (
            0.0 if r is None or channel is None or not channel.absolute else float(self.system.port(channel.port) @ r)
        )

    @property
    def highest_mode(self) -> tuple[float, float] | None:
        return self.system.highest_mode

    def accelerance_above(self, signal: str) -> float:
        # A shaker pushes with M r, and Rᵀ M⁻¹ R is then all mass that it carries.
        carried = self.influence if signal == "force" else None
        row = self.system.port(self.port_of(signal)) if carried is None else self.system.mass @ carried
        return float(row @ np.linalg.solve(self.system.mass, row))

    def core_changes(self, path: Path) -> Changes | None:
        if path[0] == "parts":
            part = self.system.parts[int(path[1])]
            return Changes({}, [(part.power, self.scales[2 - part.power] * part.change)])
        if path[0] != "scales":
            return None
        k = int(path[1])
        return Changes({}, [(2 - k, self._with_parts[k])])

    def second_order(
        self, position: float | None = None, viscous_at: float | None = None, points: Mapping[str, float] | None = None
    ) -> SecondOrder:
        if position is not None and not np.isnan(position):
            raise ParameterError(f"position = {position}: a second_order model has no position")
        if points:
            raise ParameterError(f"{', '.join(points)}: a second_order model has no rail")
        return self.assembly.system(viscous_at)

    def matrices(self, positions: ArrayLike, viscous_at: float | None = None) -> MatrixStack:
        system, count = self.second_order(viscous_at=viscous_at), np.size(positions)
        m, c, k = (np.repeat(x[None], count, axis=0) for x in (system.mass, system.damping, system.stiffness))
        return MatrixStack(m, c, k, system.dofs)

    def spring_at(self, place: str, power: int = 0) -> Spring | None:
        # A port between two degrees of freedom, e_i - e_j, spans -K_ij; one that is a degree of freedom, its spring to ground,
        # the sum of that row of K.
        row = self.system.port(place)
        # What errors of parts put between degrees of freedom that no spring joins is none.
        if _spanned(row, self.system.stiffness)[0] <= 0.0:
            return None
        if power == 0:
            value, slope = _spanned(row, self._with_parts[2])
        elif (between := _between(row, self.system.damping)) is None:
            return None
        else:
            # Damping of modes, written over degrees of freedom, is no damper between two of them.
            slope = between
            value = max(float(np.sum(slope * self._with_parts[1])), 0.0)
            slope = slope * np.sign(value)
        moved = [
            (("parts", k), self.scales[2 - power] * float(np.sum(slope * part.change)))
            for k, part in enumerate(self.system.parts)
            if part.power == power
        ]
        paths = ((("scales", 2 - power), value), *(move for move in moved if move[1] != 0.0))
        return self.scales[2 - power] * value, paths

    def carried_at(self, place: str) -> tuple[float, float, float]:
        # The diagonals of finite elements' matrices are those of one element, hundreds of times stiffer than what holds a point.
        system, spring = self.second_order(None, viscous_at=1.0), self.spring_at(place)
        row = system.port(self.port_at(place))
        own = max(float(row @ row), 1e-30)
        element, loss = (float(abs(row @ m @ row)) / own**2 for m in (system.stiffness, system.damping))
        mass, static = system.at_port(self.port_at(place))
        # Of a reduced model a row's sum is no spring, and may be far stiffer than what holds the point.
        stiffness = static if spring is None else min(float(spring[0]), static)
        return mass, stiffness, loss * (stiffness / element if element > 0.0 else 1.0)

    def _plant_outputs(self) -> tuple[str, ...]:
        return tuple(self.channels)

    def _plant(
        self,
        position: float | None,
        drives: Sequence[str],
        reads: Sequence[str],
        quantity: Quantity | None,
        viscous_at: float | None,
    ) -> Callable[[Sequence[str]], control.StateSpace]:
        system = self.second_order(position, viscous_at)
        system = replace(system, ports={**system.ports, "force": self.drive(system)})

        def build(signals: Sequence[str]) -> control.StateSpace:
            motions: dict[str, tuple[str, Quantity]] = {}
            for name in signals:
                own = self.channels[name].quantity if name in self.channels else self.default_quantity
                motions[name] = (self.port_of(name), quantity or own)
            out = system.state_space({name: name for name in drives}, motions, name="structure")
            for k, name in enumerate(signals):
                share = self.base_share(name)
                if share and "force" in drives and motions[name][1] != "acceleration":
                    raise CouplingError(
                        f"{name} reads absolute {motions[name][1]} on a shaker, which integrates the base's acceleration: "
                        "there is no such plant; ask for acceleration"
                    )
                if share and "force" in drives:
                    out.D[k, drives.index("force")] += share
            return out

        return build

    def replace(self, **values: Any) -> Structure:
        """
        A structure with some of its values changed.

        Parameters
        ----------
        **values : object
            ``mass``, ``damping``, ``stiffness`` (matrices), ``ports``, ``tolerance_mass`` …, or a field of the structure itself.

        Returns
        -------
        Structure
            A new structure. Of a corrected one the nominal values change, and its effects are applied anew.

        Raises
        ------
        ParameterError
            If there is no such value, with the choices; or one is impossible.
        """
        return replaced(self, values, {"system": ("system",)})

    def drive(self, system: SecondOrder) -> FloatArray:
        carried = self.influence
        if carried is None:
            return system.port(self.input_port)
        r = np.zeros(len(system.dofs))
        r[: carried.size] = carried
        for i, dof in enumerate(system.dofs[carried.size :], start=carried.size):
            k = int(dof.removeprefix("attached").split("_")[0]) - 1
            r[i] = self.attachments[k].row(self.system.ports) @ carried
        forces: FloatArray = -(system.mass @ r)
        return forces


_NO_SPRING = 1e-5  # Of the largest stiffness of a degree of freedom: what five digits of a matrix leave of a sum


def _spanned(row: FloatArray, stiffness: FloatArray) -> tuple[float, FloatArray]:
    """Stiffness of the spring between the degrees of freedom of a port, and its derivative to the stiffness matrix."""
    held, slope = np.flatnonzero(row), _between(row, stiffness)
    if slope is None:
        return _static(row, stiffness)
    found = float(np.sum(slope * stiffness))
    # Matrices are written to so many digits: the rounding error of a row that adds up to nothing is no spring.
    least = _NO_SPRING * float(np.abs(stiffness[held[0]]).max()) / row[held[0]] ** 2
    if held.size == 2 and found < -least:
        return _static(row, stiffness)
    return found if found > least else 0.0, slope


def _between(row: FloatArray, matrix: FloatArray) -> FloatArray | None:
    """Derivative to a matrix of the element between the degrees of freedom of a port, one or two; None of any other."""
    held, slope = np.flatnonzero(row), np.zeros_like(matrix)
    if held.size == 1:
        slope[held[0]] = 1.0 / row[held[0]] ** 2
    elif held.size == 2 and row[held[0]] == -row[held[1]]:
        slope[held[0], held[1]] = -1.0 / row[held[0]] ** 2
    else:
        return None
    return slope


def _static(row: FloatArray, stiffness: FloatArray) -> tuple[float, FloatArray]:
    """Stiffness of a port against slow forces, 0 if it floats, and its derivative to the stiffness matrix."""
    # In modal or reduced coordinates no element is a spring.
    values, shapes = np.linalg.eigh(stiffness)
    along, held = shapes.T @ row, values > 1e-9 * values[-1]
    if not held.any() or np.sum(along[~held] ** 2) > 1e-9 * np.sum(along**2):
        return 0.0, np.zeros_like(stiffness)
    bent = shapes[:, held] @ (along[held] / values[held])
    found = 1.0 / float(row @ bent)
    return found, found**2 * np.outer(bent, bent)
