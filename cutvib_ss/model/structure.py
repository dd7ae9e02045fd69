"""Any other structure: M, C, K with ports and channels, taken through the same code as the cutting machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.coupling import Assembly, Changes
from cutvib_ss.model.elements import Attachment
from cutvib_ss.model.measurement_chain import MeasurementChain
from cutvib_ss.model.paths import Path, replaced
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.parameters import StructureTolerances, check_choice, names_of
from cutvib_ss.results import FloatArray, Quantity
from cutvib_ss.results.display import Displayed, Table
from cutvib_ss.units import DERIVATIVE_ORDER

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class Structure(Displayed):
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
    attachments: tuple[Attachment, ...] = ()
    chain: MeasurementChain = field(default_factory=MeasurementChain)
    nonlinear: tuple[NonlinearElement, ...] = ()
    effects: tuple[object, ...] = ()
    bare: Structure | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", MappingProxyType(dict(self.channels)))
        if np.linalg.eigvalsh(self.system.mass).min() <= 0.0:
            raise ParameterError("the mass matrix is not positive definite; check the masses and their signs")
        self.system.port(self.input_port)
        for name, channel in self.channels.items():
            if channel.port not in self.system.ports:
                raise ParameterError(f"channel {name!r} reads port {channel.port!r}, which is not under [ports]")

    def _table(self) -> Table:
        rows = [(name, c.port, c.quantity) for name, c in self.channels.items()]
        title = f"Structure of {len(self.system.dofs)} degrees of freedom; {self.input_quantity} at {self.input_port}"
        return Table(title, ("channel", "port", "quantity"), rows)

    @property
    def has_position(self) -> bool:
        """A structure has no position."""
        return False

    @property
    def default_quantity(self) -> Quantity:
        """Ports are read in displacement."""
        return "displacement"

    @property
    def scaled(self) -> SecondOrder:
        """The matrices with their factors applied."""
        m, c, k = self.scales
        s = self.system
        return replace(s, mass=m * s.mass, damping=c * s.damping, stiffness=k * s.stiffness)

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
        """
        The port behind a signal; any other name is its own port.

        Parameters
        ----------
        signal : str
            Signal, channel or port.

        Returns
        -------
        str
            The input port of ``force``, a channel's port.
        """
        if signal == "force":
            return self.input_port
        return self.channels[signal].port if signal in self.channels else signal

    def base_share(self, signal: str) -> float:
        """
        How a signal that reads absolute motion moves with a shaker's base.

        Parameters
        ----------
        signal : str
            Signal, channel or port.

        Returns
        -------
        float
            Its port's row times the influence vector; 0 where it reads relative motion.
        """
        channel, r = self.channels.get(signal), self.influence
        return (
            0.0 if r is None or channel is None or not channel.absolute else float(self.system.port(channel.port) @ r)
        )

    def rotates(self, signal: str) -> bool:
        """
        Whether a signal is a rotation.

        Parameters
        ----------
        signal : str
            Signal, channel or port.

        Returns
        -------
        bool
            False: that is not known of a structure.
        """
        return False

    def core_changes(self, path: Path) -> Changes | None:
        """
        How the core of the assembly moves with one of the model's values.

        Parameters
        ----------
        path : tuple of str and int
            The value's path.

        Returns
        -------
        Changes or None
            None where it does not.
        """
        if path[0] != "scales":
            return None
        k = int(path[1])
        return Changes({}, [(2 - k, (self.system.mass, self.system.damping, self.system.stiffness)[k])])

    def second_order(
        self, position: float | None = None, viscous_at: float | None = None, points: Mapping[str, float] | None = None
    ) -> SecondOrder:
        """
        The exact second-order form.

        Parameters
        ----------
        position : None
            A structure has no position.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.
        points : None
            It has no rail either.

        Returns
        -------
        SecondOrder
            The structure with what is attached to it.
        """
        if position is not None and not np.isnan(position):
            raise ParameterError(f"position = {position}: a second_order model has no position")
        if points:
            raise ParameterError(f"{', '.join(points)}: a second_order model has no rail")
        return self.assembly.system(viscous_at)

    def plant(
        self,
        position: float | None = None,
        *,
        inputs: str | Sequence[str] = ("force",),
        outputs: str | Sequence[str] | None = None,
        quantity: Quantity | None = None,
        pade_order: int | None = None,
        viscous_at: float | None = None,
    ) -> control.StateSpace:
        """
        The structure as a python-control object.

        Parameters
        ----------
        position : None
            A structure has no position.
        inputs : str or sequence of str
            ``force`` (the input port, or a shaker's acceleration), or names of ports.
        outputs : str or sequence of str, optional
            Channels or ports; the channels by default.
        quantity : {"displacement", "velocity", "acceleration"}, optional
            Motion of the outputs; by default each channel's own, and displacement of ports.
        pade_order : int, optional
            Order of the Padé approximation of channel delays.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        control.StateSpace
            2n states, signals named; their scaling is that of `SecondOrder.state_space`.

        Raises
        ------
        ParameterError
            If a signal or the quantity is unknown; the message lists those that are.
        CouplingError
            If no finite plant exists: of a delay or hysteretic damping without an approximation, or of absolute displacement or
            velocity on a shaker, which integrate the base's acceleration.
        """
        system = self.second_order(position, viscous_at)
        system = replace(system, ports={**system.ports, "force": self.drive(system)})
        drives = names_of(inputs)
        if quantity is not None:
            check_choice("quantity", quantity, DERIVATIVE_ORDER)

        def build(signals: Sequence[str]) -> control.StateSpace:
            reads: dict[str, tuple[str, Quantity]] = {}
            for name in signals:
                own = self.channels[name].quantity if name in self.channels else self.default_quantity
                reads[name] = (self.port_of(name), quantity or own)
            out = system.state_space({name: name for name in drives}, reads, name="structure")
            for k, name in enumerate(signals):
                share = self.base_share(name)
                if share and "force" in drives and reads[name][1] != "acceleration":
                    raise CouplingError(
                        f"{name} reads absolute {reads[name][1]} on a shaker, which integrates the base's acceleration: "
                        "there is no such plant; ask for acceleration"
                    )
                if share and "force" in drives:
                    out.D[k, drives.index("force")] += share
            return out

        return self.chain.plant(build, tuple(self.channels) if outputs is None else names_of(outputs), pade_order)

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
        """
        How a unit of the ``force`` channel pushes each degree of freedom.

        Parameters
        ----------
        system : SecondOrder
            From `second_order`.

        Returns
        -------
        ndarray, shape (n,)
            Row of the input port; on a shaker -M r, a sprung mass being carried along by its foot.
        """
        carried = self.influence
        if carried is None:
            return system.port(self.input_port)
        r = np.zeros(len(system.dofs))
        r[: carried.size] = carried
        for i, dof in enumerate(system.dofs[carried.size :], start=carried.size):
            k = int(dof.removeprefix("attached").split("_")[0]) - 1
            r[i] = self.system.port(self.attachments[k].port) @ carried
        forces: FloatArray = -(system.mass @ r)
        return forces
