"""Any other structure: M, C, K with ports and channels, taken through the same code as the cutting machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal

import control
import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.mechanical import Channel, SecondOrder
from cutvib_ss.parameters import StructureTolerances
from cutvib_ss.results import Displayed, FloatArray, Quantity, Table, as_names
from cutvib_ss.slots import MeasurementChain, NonlinearElement, attach_all, through_chain, viscous_attachments
from cutvib_ss.subsystems.elements import Attachment


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
    def scaled(self) -> SecondOrder:
        """The matrices with their factors applied."""
        m, c, k = self.scales
        s = self.system
        return replace(s, mass=m * s.mass, damping=c * s.damping, stiffness=k * s.stiffness)

    def second_order(self, position: float | None = None, viscous_at: float | None = None) -> SecondOrder:
        """
        The exact second-order form.

        Parameters
        ----------
        position : None
            A structure has no position.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        SecondOrder
            The structure with what is attached to it.
        """
        if position is not None and not np.isnan(position):
            raise ParameterError(f"position = {position}: a second_order model has no position")
        return attach_all(self.scaled, viscous_attachments(self.attachments, viscous_at))

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
            ``force`` (the input port), or names of ports.
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
            2n states, signals named.
        """
        system = self.second_order(position, viscous_at)
        system = replace(system, ports={**system.ports, "force": self.drive(system)})
        ports_in = {name: name for name in as_names(inputs)}
        reads: dict[str, tuple[str, Quantity]] = {}
        for name in tuple(self.channels) if outputs is None else as_names(outputs):
            channel = self.channels.get(name, Channel(name, "displacement"))
            reads[name] = (channel.port, quantity or channel.quantity)
        return through_chain(self.chain, system.state_space(ports_in, reads, name="structure"), pade_order)

    def drive(self, system: SecondOrder) -> FloatArray:
        """
        How a unit of the ``force`` channel pushes each degree of freedom.

        Parameters
        ----------
        system : SecondOrder
            The structure with what is attached to it, from `second_order`.

        Returns
        -------
        ndarray, shape (n,)
            Row of the input port; for a structure on a shaker the inertia forces of a unit base acceleration.
        """
        if self.input_quantity == "force":
            return system.port(self.input_port)
        forces: FloatArray = -(system.mass @ self._influence(system))
        return forces

    def _influence(self, system: SecondOrder) -> FloatArray:
        """How every degree of freedom moves with the base; a sprung mass is carried along by its foot."""
        carried = self.system.port(self.input_port)
        out = np.zeros(len(system.dofs))
        out[: carried.size] = carried
        for i, dof in enumerate(system.dofs[carried.size :], start=carried.size):
            k = int(dof.removeprefix("attached").split("_")[0]) - 1
            out[i] = self.system.port(self.attachments[k].port) @ carried
        return out
