"""What both kinds of model do alike: signals and ports, the plant behind the measurement chain, values changed by name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

from numpy.typing import ArrayLike

from cutvib_ss.model.coupling import Changes
from cutvib_ss.model.elements import Attachment, Element, of_known_poles
from cutvib_ss.model.measurement_chain import MeasurementChain
from cutvib_ss.model.parts import Part
from cutvib_ss.model.paths import Path, with_slots
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.second_order import MatrixStack, SecondOrder
from cutvib_ss.parameters import check_choice, names_of
from cutvib_ss.results import FloatArray, Quantity
from cutvib_ss.results.display import Displayed
from cutvib_ss.units import DERIVATIVE_ORDER

if TYPE_CHECKING:
    import control

Spring = tuple[float, tuple[tuple[Path, float], ...]]


class BaseModel(Displayed, ABC):
    """What the cutting machine and any other structure share; each fills in what its own parts tell."""

    attachments: tuple[Attachment, ...]
    chain: MeasurementChain
    nonlinear: tuple[NonlinearElement, ...]
    effects: tuple[object, ...]

    @property
    def places(self) -> tuple[str, ...]:
        """Places at which an element may be attached."""
        raise NotImplementedError

    @property
    def force_ports(self) -> tuple[str, ...]:
        """Ports at which a force may act."""
        raise NotImplementedError

    @property
    def matrix_parts(self) -> tuple[Part, ...]:
        """
        Parts of its matrices that may err one by one (`cutvib_ss.model.parts`).

        Returns
        -------
        tuple of Part
            None where its values are tuned one by one.
        """
        return ()

    @property
    def elements(self) -> tuple[Element, ...]:
        """
        All linear elements that are attached anywhere.

        Returns
        -------
        tuple of Element
            Those at ports, along the rail, in the guide and under the rail's ends.
        """
        return tuple(a.element for a in self.attachments)

    def equivalent(self, s: complex) -> Self:
        """
        The model with a spring and damper for each element that leaves it no finite set of poles; a constant loss stays.

        Parameters
        ----------
        s : complex
            Where they equal what they stand for [rad/s].

        Returns
        -------
        Machine or Structure
            The model.
        """
        equal = tuple(replace(a, element=of_known_poles(a.element, s)) for a in self.attachments)
        return with_slots(self, attachments=equal)

    @property
    def as_written(self) -> Self:
        """The model as machine.toml holds it."""
        return self

    def port_at(self, place: str) -> str:
        """
        The port through which an element at a place acts.

        Parameters
        ----------
        place : str
            One of `places`.

        Returns
        -------
        str
            The port's name; of most places their own.
        """
        return place

    def place_of(self, port: str) -> str:
        """
        The place that a port belongs to.

        Parameters
        ----------
        port : str
            A port.

        Returns
        -------
        str
            Of another structure the first port that moves with it; else the name itself.
        """
        return port

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
        raise NotImplementedError

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
            Its port's row times the influence vector; 0 where it reads relative motion, or without a shaker.
        """
        return 0.0

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
            True of the joints and of the rail's twist; that is not known of another structure.
        """
        return False

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
        raise NotImplementedError

    @property
    def highest_mode(self) -> tuple[float, float] | None:
        """
        The highest mode of a model that leaves out those above it.

        Returns
        -------
        tuple of float, or None
            Its natural frequency [Hz] and damping ratio; None where the model holds all modes that matter.
        """
        return None

    def accelerance_above(self, signal: str) -> float:
        """
        Driving-point accelerance at a signal's port far above the highest mode.

        Parameters
        ----------
        signal : str
            Signal, channel or port.

        Returns
        -------
        float
            1/kg, one over the mass that a force there moves at once; kg where the input is a shaker's acceleration.
        """
        raise NotImplementedError

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
        raise NotImplementedError

    def spring_at(self, place: str, power: int = 0) -> Spring | None:
        """
        The linear spring that a place spans, or the viscous damper beside it.

        Parameters
        ----------
        place, power : str, int
            One of `places`; of s, 0 or 1.

        Returns
        -------
        Spring or None
            Its value in SI, and the paths that move it with their weights; None where there is none.
        """
        raise NotImplementedError

    def carried_at(self, place: str) -> tuple[float, float, float]:
        """
        What a place carries.

        Parameters
        ----------
        place : str
            One of `places`.

        Returns
        -------
        (float, float, float)
            Mass, stiffness and damping, for starts in proportion to them.
        """
        raise NotImplementedError

    def second_order(
        self, position: float | None = None, viscous_at: float | None = None, points: Mapping[str, float] | None = None
    ) -> SecondOrder:
        """
        The exact second-order form at a position (Section 3.3).

        Parameters
        ----------
        position : float, optional
            y_b / L of the head, strictly inside (0, 1); None of a structure, which has no position.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.
        points : mapping of str to float, optional
            More ports along the rail: name to y / L.

        Returns
        -------
        SecondOrder
            Of a machine modal coordinates of the rail, then the head's rotations; then what is attached.

        Raises
        ------
        CouplingError
            If damping is hysteretic and no ``viscous_at`` is given.
        """
        raise NotImplementedError

    def matrices(self, positions: ArrayLike, viscous_at: float | None = None) -> MatrixStack:
        """
        Mass, damping and stiffness at several positions.

        Parameters
        ----------
        positions : array_like, shape (position,)
            y_b / L of the head, each strictly inside (0, 1); of a structure, which has none, only their number counts.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        MatrixStack
            ``mass``, ``damping`` and ``stiffness``, each of shape (position, n, n), and ``dofs``, the names of the n degrees of
            freedom.

        Raises
        ------
        CouplingError
            If damping is hysteretic and no ``viscous_at`` is given.
        """
        raise NotImplementedError

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
        The model as a python-control object; of a machine head and rail, closed through the base-force constraint.

        Parameters
        ----------
        position : float, optional
            y_b / L of the head, strictly inside (0, 1); None of a structure, which has no position.
        inputs : str or sequence of str
            ``force`` (the input port, or a shaker's acceleration), or any port: ``head_x``, ``base``, ``rail(0.25)`` ...
        outputs : str or sequence of str, optional
            Channels or ports. By default ``tool_x``, ``tool_z``, ``base_x``, ``head_x``, ``head_z`` of a machine, the channels of a
            structure.
        quantity : {"displacement", "velocity", "acceleration"}, optional
            Which motion the outputs give. By default displacement of a machine's signals and of a structure's ports; a structure's
            channels are read in their own.
        pade_order : int, optional
            Order of the Padé approximation of channel delays.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        control.StateSpace
            2(2+m) states for the bare machine. Their names: ``theta1``, ``theta2``, ``eta1`` …, then ``d_theta1`` …, then those of
            what is attached, then delays. A displacement is scaled by √M_xx, M_xx being the mass of its coordinate in the head
            with its base held, or in the rail; a velocity by √M_xx/ω₀, ω₀ being the geometric mean of the lowest and highest
            natural frequency of that part. ``machine.coupling().state_scales`` lists the factors: x = state / factor. 2n states of
            a structure, scaled as by `SecondOrder.state_space`.

        Raises
        ------
        ParameterError
            If a signal or the quantity is unknown; the message lists those that are.
        CouplingError
            If no finite plant exists: of a delay or hysteretic damping without an approximation, or of absolute displacement or
            velocity on a shaker, which integrate the base's acceleration.

        Notes
        -----
        Section 3.3, by the linear fractional transformation (`cutvib_ss.model.coupling`).

        Examples
        --------
        >>> from cutvib_ss import published_machine
        >>> plant = published_machine().plant(0.5, outputs="tool_x")
        >>> plant.state_labels[:4], plant.output_labels
        (['theta1', 'theta2', 'eta1', 'eta2'], ['tool_x'])
        """
        drives = names_of(inputs)
        reads = self._plant_outputs() if outputs is None else names_of(outputs)
        if quantity is not None:
            check_choice("quantity", quantity, DERIVATIVE_ORDER)
        return self.chain.plant(self._plant(position, drives, reads, quantity, viscous_at), reads, pade_order)

    @abstractmethod
    def _plant_outputs(self) -> tuple[str, ...]:
        """Outputs of a plant by default."""

    @abstractmethod
    def _plant(
        self,
        position: float | None,
        drives: Sequence[str],
        reads: Sequence[str],
        quantity: Quantity | None,
        viscous_at: float | None,
    ) -> Callable[[Sequence[str]], control.StateSpace]:
        """What builds the plant of given signals, without the measurement chain."""

    def _effect_rows(self) -> list[tuple[str, str, str]]:
        """Rows of the printed table for the effects."""
        names: Any = ((getattr(e, "effect", type(e).__name__), getattr(e, "place", "")) for e in self.effects)
        return [(str(effect), str(place), "") for effect, place in names]
