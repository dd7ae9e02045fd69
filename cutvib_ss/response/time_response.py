"""
Responses in time to a force that is linear between its samples, from rest, from a state, or in the periodic steady state.

Each complex mode is advanced by its exact recursion, z_{k+1} = e^{ph} z_k + h (φ₁ - φ₂) f_k + h φ₂ f_{k+1}, compiled; outputs are
sums over the modes plus what forces pass on directly. Nonlinear forces are found first, at the ports alone
(`cutvib_ss.response.compiled`), then act as inputs like the force. In the steady state a mode begins where it ends,
z_0 = z_T / (1 - e^{pT}), z_T being where it ends from rest; with nonlinear forces Newton's method solves for that, from where a
run over many periods has come.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize

from cutvib_ss.errors import ConvergenceError, ParameterError
from cutvib_ss.model.protocol import Model
from cutvib_ss.model.restoring_forces import packed
from cutvib_ss.parameters import names_of
from cutvib_ss.response.compiled import interact
from cutvib_ss.response.compiled_modes import advance
from cutvib_ss.response.modal_basis import linear_course, modal_basis, parts, reading
from cutvib_ss.response.modal_form import base_motion, row_of, system_with
from cutvib_ss.response.output_rows import END_FORCES, output_rows
from cutvib_ss.response.signals import input_unit
from cutvib_ss.results import ComplexArray, FloatArray, Quantity, TimeResponse
from cutvib_ss.units import DERIVATIVE_ORDER

_STEPS = 40
"""Steps that a period at the mean frequency of a nonlinear element's port gets, at least; twice as many with friction."""
_FINEST = 64
"""Largest oversampling that is chosen unasked."""
_PERIODIC = 1e-10
"""Where Newton's method stops: modes that move by less than this part of their size."""
_FOUND = 1e-6
"""A steady state is found when the modes begin and end a period alike to this part of their size."""
_SETTLING = (100_000, 1_000_000)
"""Steps of a run before Newton's method starts from it, and before it starts again."""
_TURNS = 20
"""Largest number of times that sliders are moved to where a period leaves them."""
_NEWTON: Any = optimize.root  # its annotations know less than it can do


def time_response(
    machine: Model,
    position: float | None,
    force: ArrayLike,
    fs: float,
    *,
    outputs: str | Sequence[str] | None = None,
    quantity: Quantity | Sequence[Quantity | None] | None = None,
    start: Literal["rest", "periodic"] | ArrayLike = "rest",
    input: str = "force",
    oversample: int | None = None,
    viscous_at: float | None = None,
) -> TimeResponse:
    """
    Response in time to a sampled force, exact for a force that is linear between its samples.

    Parameters
    ----------
    machine : Machine or Structure
        The model, its nonlinear elements included; its measurement chain is not applied.
    position : float or None
        y_b / L of the head, strictly inside (0, 1); None for a structure.
    force : array_like, shape (sample,)
        The force [N], or for a structure on a shaker the base's acceleration [m/s^2].
    fs : float
        Sampling frequency [Hz].
    outputs : str or sequence of str, optional
        Channels, ports (``tool_x``, ``head_z``, ``joint2``, ``rail(0.25)`` …), and ``rail_left_force``, ``rail_right_force``: what
        the rail's ends pass on. By default the channels.
    quantity : {"displacement", "velocity", "acceleration"}, or a sequence of these, optional
        Motion quantity of all outputs, or of each; by default a channel's own, displacement of a port.
    start : {"rest", "periodic"} or array_like, shape (2 n,)
        From rest; in the steady state, of which ``force`` is one period; or from displacement, then velocity, of the degrees of
        freedom of ``machine.second_order``.
    input : str
        ``force`` (the cutting force, or the structure's input), or the port at which the force acts.
    oversample : int, optional
        Steps of nonlinear forces in a sample; by default as many as resolve the motion of their ports.
    viscous_at : float, optional
        Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

    Returns
    -------
    TimeResponse
        Histories at the instants of the force.

    Raises
    ------
    ParameterError
        If a signal or the position is impossible, or shapes do not fit.
    CouplingError
        If damping is hysteretic and no ``viscous_at`` is given.
    ConvergenceError
        If no periodic steady state is found, or a softening spring lets the motion run away.

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> from cutvib_ss.response.pulses import pulse_train
    >>> force = pulse_train(fs=217 * 64, duration=1 / 217, amplitude=100.0)
    >>> steady = time_response(published_machine(), 0.5, force, 217 * 64, start="periodic")
    >>> steady.sel(output="tool_x").in_g().rms().round(2)
    array([8.77])
    """
    f = np.asarray(force, dtype=np.float64)
    if f.ndim != 1 or f.size < 2 or not np.isfinite(f).all():
        raise ParameterError(f"force has shape {f.shape}; give a history of finite numbers, two samples or more")
    if not fs > 0.0 or (oversample is not None and oversample < 1):
        raise ParameterError(f"fs = {fs} and oversample = {oversample} must be positive")
    names = tuple(machine.channels) if outputs is None else names_of(outputs)
    wanted = (quantity,) * len(names) if quantity is None or isinstance(quantity, str) else tuple(quantity)
    if len(wanted) != len(names):
        raise ParameterError(f"{len(names)} outputs need as many quantities, not {len(wanted)}")
    run = _Run(machine, position, viscous_at, names, wanted, input, fs)
    if isinstance(start, str) and start not in ("rest", "periodic"):
        raise ParameterError(f'start = {start!r} is neither "rest" nor "periodic" nor a state')
    periodic = isinstance(start, str) and start == "periodic"
    begin = np.zeros(run.modes.poles.size, dtype=np.complex128)
    if not isinstance(start, str):
        state = np.asarray(start, dtype=np.float64)
        if state.shape != (run.modes.from_state.shape[1],):
            raise ParameterError(
                f"start has shape {state.shape}; give displacement and velocity of {', '.join(run.dofs)}"
            )
        begin = run.modes.from_state @ state
    data = run.periodic(f, oversample) if periodic else run.histories(f, begin, oversample)
    shaken = machine.influence is not None and input == "force"
    for row, name, asked in zip(data, names, wanted, strict=True):
        if shaken and (share := machine.base_share(name)):
            order = DERIVATIVE_ORDER[asked or machine.channels[name].quantity]
            row += share * base_motion(f, fs, order, periodic)
    place = float("nan") if position is None else position
    return TimeResponse(data, f, fs, names, run.units, place, periodic, input_unit(machine, input))


class _Run:
    """A model at its position with the outputs of one call."""

    def __init__(
        self,
        machine: Model,
        position: float | None,
        viscous_at: float | None,
        names: Sequence[str],
        quantities: Sequence[Quantity | None],
        input: str,
        fs: float,
    ) -> None:
        self.elements, self.fs = machine.nonlinear, fs
        ports = [e.port for e in self.elements]
        points = [n for n in (*names, input) if n not in END_FORCES and n not in machine.channels]
        system = system_with(machine, position, viscous_at, points)
        self.dofs = system.dofs
        self.modes = modal_basis(system)
        first = machine.drive(system) if input == "force" else row_of(system, input)
        signs = np.array([1.0, *(-1.0 for _ in ports)])  # forces of elements act against their ports' motion
        drives = signs * np.array([first, *(row_of(system, p) for p in ports)]).T
        rows = output_rows(machine, system, position, viscous_at, names, quantities, (input, *ports))
        self.units = tuple(r.unit for r in rows)
        self.weights = np.array([r.weights(self.modes) for r in rows])
        self.direct = np.array([r.direct(system, drives, signs) for r in rows])
        self.drives = (self.modes.drives @ drives).T
        self.ports = np.array([row_of(system, p) @ self.modes.shapes for p in ports])
        self._resolve(fs)

    def _resolve(self, rate: float) -> None:
        """Take the laws as steps at a rate resolve them."""
        _, pushes = linear_course(self.modes.poles, -self.drives[1:], 1.0 / rate)
        over_a_step = np.sum(self.ports * (pushes[0] + pushes[1]), axis=-1).real if self.elements else ()
        laws = [e.restoring_force.at_step(float(a)) for e, a in zip(self.elements, over_a_step, strict=True)]
        self.laws, self.jumps = packed(laws), [f.jumps for f in laws]

    def histories(self, force: FloatArray, begin: ComplexArray, oversample: int | None) -> FloatArray:
        """Outputs at the samples of a force, from given modes."""
        fine = self._enough(force, begin) if oversample is None else oversample
        self._resolve(self.fs * fine)
        # One sample more, since a nonlinear force at an instant is complete when the step after it is known.
        longer = np.append(force, force[-1]) if self.elements else force
        data = self._run(_refined(longer, fine), fine, begin, np.zeros(self.laws.sliders.shape[:2]))[0]
        return data[:, : force.size]

    def periodic(self, force: FloatArray, oversample: int | None) -> FloatArray:
        """Outputs over one period of the steady state."""
        closed = np.append(force, force[0])
        turned = 1.0 - np.exp(self.modes.poles * force.size / self.fs)
        if np.abs(turned).min() < 1e-9:
            raise ParameterError("an undamped mode is in tune with the force: there is no periodic steady state")
        begin = self._linear(closed, np.zeros_like(turned))[1] / turned
        if not self.elements:
            return self._run(closed, 1, begin, np.zeros((0, 1)))[0][:, :-1]
        fine = self._enough(closed, begin) if oversample is None else oversample
        self._resolve(self.fs * fine)
        refined, n, size = _refined(closed, fine), begin.size, float(np.abs(begin).max()) or 1.0

        def after(x: FloatArray, slid: FloatArray) -> tuple[FloatArray, ComplexArray, FloatArray]:
            modes = np.asarray(size * (x[:n] + 1j * x[n:]), dtype=np.complex128)
            data, end, kept = self._run(refined, fine, modes, self._kept(modes, slid), closed=True)
            return data, end, self._slid(end, kept)

        def missing(x: FloatArray, slid: FloatArray) -> FloatArray:
            modes = (after(x, slid)[1] / size - x[:n] - 1j * x[n:]) / turned
            return np.concatenate([modes.real, modes.imag])

        # Where a run from rest goes to of itself, to start from: where several steady states live, this one is meant.
        begin, kept = np.zeros_like(begin), np.zeros(self.laws.sliders.shape[:2])
        for steps in _SETTLING:
            many = np.append(np.tile(refined[:-1], max(5, steps // refined.size)), refined[0])
            _, begin, kept = self._run(many, fine, begin, kept)
            x, slid = np.concatenate([begin.real / size, begin.imag / size]), self._slid(begin, kept)
            for _ in range(_TURNS):
                found = _NEWTON(missing, x, (slid,), method="hybr", tol=_PERIODIC)
                data, _, new = after(found.x, slid)
                x, settled = found.x, np.abs(new - slid).max() <= _FOUND * np.abs(self.ports @ begin).max()
                slid = new
                if settled and np.abs(missing(x, slid)).max() < _FOUND:
                    return data[:, :-1]
        raise ConvergenceError(
            "no periodic steady state was found: the nonlinear response may not repeat itself with the force; run it from rest "
            "over many periods and look"
        )

    def _slid(self, modes: ComplexArray, kept: FloatArray) -> FloatArray:
        """Where Jenkins elements stand: displacement of their port less that of their springs, shape (element, slider)."""
        stiffness = self.laws.sliders[..., 0]
        slides = np.isfinite(stiffness) & (stiffness > 0.0)
        at = (self.ports @ modes).real[:, None] - kept / np.where(slides, stiffness, 1.0)
        return np.where(slides, at, 0.0)

    def _kept(self, modes: ComplexArray, slid: FloatArray) -> FloatArray:
        """Forces of their springs."""
        stiffness, limit = np.moveaxis(self.laws.sliders, -1, 0)
        forces = np.where(np.isfinite(stiffness), stiffness, 0.0) * ((self.ports @ modes).real[:, None] - slid)
        return np.asarray(np.clip(forces, -limit, limit))

    def _linear(self, force: FloatArray, begin: ComplexArray) -> tuple[FloatArray, ComplexArray]:
        """Displacements and velocities of the elements' ports without nonlinear forces, and the modes at the end."""
        both = np.concatenate([self.ports, self.ports * self.modes.poles]) if self.elements else self.weights[:0]
        return self._advance(force[None], self.drives[:1], both, begin, 1, 1)

    def _advance(
        self,
        forces: FloatArray,
        drives: ComplexArray,
        weights: ComplexArray,
        begin: ComplexArray,
        fine: int,
        every: int,
    ) -> tuple[FloatArray, ComplexArray]:
        turn, pushes = linear_course(self.modes.poles, drives, 1.0 / (self.fs * fine))
        for k, jumps in enumerate(self.jumps[: len(forces) - 1], start=1):
            if jumps:  # its history is the mean over each step
                pushes[:, k] = 0.0 * pushes[0, k], pushes[0, k] + pushes[1, k]
        out, end = advance(
            np.ascontiguousarray(forces), parts(turn), np.stack([parts(p) for p in pushes]), reading(weights),
            parts(begin), every,
        )  # fmt: skip
        return out, end[0] + 1j * end[1]

    def _run(
        self, force: FloatArray, fine: int, begin: ComplexArray, memory: FloatArray, closed: bool = False
    ) -> tuple[FloatArray, ComplexArray, FloatArray]:
        """Outputs at every ``fine``-th instant, modes at the last, and what elements remember."""
        forces = force[None]
        if self.elements:
            resisting, memory = self._resisting(force, fine, begin, memory)
            if closed:
                _close(resisting, memory.sum(axis=-1), self.jumps)
            forces = np.concatenate([forces, resisting])
        data, end = self._advance(forces, self.drives, self.weights, begin, fine, fine)
        return data + self.direct @ forces[:, ::fine], end, memory

    def _resisting(
        self, force: FloatArray, fine: int, begin: ComplexArray, memory: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Nonlinear forces at all instants, and what elements remember at the last."""
        h, count = 1.0 / (self.fs * fine), len(self.elements)
        both = np.concatenate([self.ports, self.ports * self.modes.poles])
        motion, _ = self._advance(force[None], self.drives[:1], both, begin, fine, 1)
        turn, pushes = linear_course(self.modes.poles, -self.drives[1:], h)
        forces, away, kept = interact(
            motion.reshape(1, 2, count, -1), np.zeros((1, 2, begin.size)), h, parts(turn),
            np.stack([parts(p) for p in pushes]),
            np.stack([reading(self.ports), reading(self.ports * self.modes.poles)]), np.zeros((2, count, count)),
            *self.laws, memory[None],
        )  # fmt: skip
        if away.any():
            raise ConvergenceError("a softening spring lets the motion run away; lower the force or the softening")
        return forces[0], kept[0]

    def _enough(self, force: FloatArray, begin: ComplexArray) -> int:
        """Steps in a sample that resolve the motion of the elements' ports."""
        if not self.elements:
            return 1
        rates = self._linear(force, begin)[0][len(self.elements) :]
        size = np.sqrt(np.sum(rates**2))
        mean = float(np.sqrt(np.sum(np.diff(rates, axis=1) ** 2)) / size) * self.fs / (2 * np.pi) if size > 0 else 0.0
        steps = _STEPS * (2 if any(self.jumps) else 1)
        return int(min(_FINEST, 2 ** np.ceil(np.log2(max(1.0, steps * mean / self.fs)))))


def _close(forces: FloatArray, last: FloatArray, means: Sequence[bool]) -> None:
    """Make the ends of a period alike: corrections of its first and last step belong to both, and so does a mean over the last."""
    for k, mean in enumerate(means):
        if mean:
            forces[k, 0] = forces[k, -1]
        else:
            forces[k, 0] += forces[k, -1] - last[k]
            forces[k, -1] = forces[k, 0]


def _refined(force: FloatArray, fine: int) -> FloatArray:
    """The force between its samples."""
    if fine == 1:
        return force
    at = np.arange((force.size - 1) * fine + 1) / fine
    return np.asarray(np.interp(at, np.arange(force.size), force))
