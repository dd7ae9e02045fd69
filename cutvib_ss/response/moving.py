"""
Responses in time while the head travels along the rail.

The equations are those of `cutvib_ss.response.moving_head`, with their convective terms. Steps are Gauss collocation of order six
(three stages): stable at any step, and the energy of a head that stands is conserved but for dampers and forces. A step is a
sample, or a part of one; forces are linear between samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.coupling import Coupling
from cutvib_ss.model.machine import CUTTING_SIGNALS, Machine
from cutvib_ss.model.rail import EndSupports, rail_points
from cutvib_ss.parameters import check_choice, check_number, names_of
from cutvib_ss.response.compiled_travel import NODES, RULES, travel_steps
from cutvib_ss.response.moving_head import RidingCourse, RidingState, Rows
from cutvib_ss.response.output_rows import END_FORCES
from cutvib_ss.response.signals import displacement_unit
from cutvib_ss.response.travel import Travel
from cutvib_ss.results import Energies, FloatArray, MovingResponse, Quantity
from cutvib_ss.units import DERIVATIVE_ORDER, rate_unit

_BLOCK = 8192
"""Steps whose rows are computed at once."""


def moving_response(
    machine: Machine,
    travel: Travel,
    force: ArrayLike,
    fs: float,
    *,
    outputs: str | Sequence[str] | None = None,
    quantity: Quantity | Sequence[Quantity | None] | None = None,
    input: str = "force",
    loads: Mapping[str, float] | None = None,
    substeps: int = 1,
    viscous_at: float | None = None,
) -> MovingResponse:
    """
    Response in time, from rest, while the head travels and a force acts.

    Parameters
    ----------
    machine : Machine
        The machine; its measurement chain is not applied.
    travel : Travel
        Position over time; the force begins at t = 0.
    force : array_like, shape (sample,)
        The force [N], linear between samples.
    fs : float
        Sampling frequency [Hz].
    outputs : str or sequence of str, optional
        Channels, ports, ``rail(0.25)``, and ``rail_left_force``, ``rail_right_force``: what the rail's ends pass on. By default
        the channels.
    quantity : {"displacement", "velocity", "acceleration"}, or a sequence of these, optional
        Motion quantity of all outputs, or of each; by default a channel's own, displacement of a port. What rides is read
        as a sensor on it would: the convective terms belong to it.
    input : str
        ``force`` (the cutting force), or the port at which the force acts.
    loads : mapping of str to float, optional
        Constant forces [N] by port, under which the machine is at rest at the start: for instance the head's weight, which then
        travels along.
    substeps : int
        Steps in a sample.
    viscous_at : float, optional
        Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

    Returns
    -------
    MovingResponse
        Histories at the instants of the force, the head's path, and energies.

    Raises
    ------
    ParameterError
        If a signal is unknown, or a shape does not fit.
    CouplingError
        If the rail twists, of which one coordinate belongs to the place of the head; if the
        machine has nonlinear elements; or damping is hysteretic and no
        ``viscous_at`` is given.

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> from cutvib_ss.response.travel import trapezoid
    >>> way = trapezoid(0.3, 0.4, speed=1.0, acceleration=10.0, length=2.5)
    >>> moving_response(published_machine(), way, np.ones(100), 2000.0).data.shape
    (3, 100)
    """
    f = np.asarray(force, dtype=np.float64)
    if f.ndim != 1 or f.size < 2 or not np.isfinite(f).all():
        raise ParameterError(f"force has shape {f.shape}; give a history of finite numbers, two samples or more")
    check_number("fs", fs, 0.0, strict=True)
    if check_number("substeps", substeps, 1) != int(substeps):
        raise ParameterError(f"substeps = {substeps} must be a whole number")
    names = tuple(machine.channels) if outputs is None else names_of(outputs)
    wanted = (quantity,) * len(names) if quantity is None or isinstance(quantity, str) else tuple(quantity)
    if len(wanted) != len(names):
        raise ParameterError(f"{len(names)} outputs need as many quantities, not {len(wanted)}")
    steady = dict(loads or {})
    ports = [CUTTING_SIGNALS.get(name, name) for name in (input, *steady)]
    points = rail_points([*names, *ports])
    course = RidingCourse.of(_checked(machine, viscous_at, points), ports)
    forces = np.column_stack([f, *(np.full(f.size, load) for load in steady.values())])
    begin = course.at_rest(course.rows_at(travel, np.zeros(1))[0][0], np.array([0.0, *steady.values()]))
    motion, work = _stepped(course, travel, _refined(forces, int(substeps)), 1.0 / (fs * substeps), begin)
    time = np.arange(f.size) / fs
    state = course.state(travel, time, motion[::substeps], forces)
    data, units = [], []
    for name, asked in zip(names, wanted, strict=True):
        if name in END_FORCES:
            data.append(_end_force(machine, name, viscous_at, ports, points, state, lambda c: c.rows_at(travel, time)))
            units.append("N")
            continue
        channel = machine.channels.get(name)
        read = asked or (channel.quantity if channel else "displacement")
        check_choice("quantity", read, tuple(DERIVATIVE_ORDER))
        data.append(course.read(channel.port if channel else CUTTING_SIGNALS.get(name, name), state, read))
        units.append(rate_unit(displacement_unit(machine, name), read))
    energies = Energies(course.stored(state), *work[::substeps].T)
    path = travel.at(time)[0]
    return MovingResponse(
        np.reshape(data, (len(names), f.size)), f, fs, names, tuple(units), float(path[0]), path=path, energies=energies
    )


def _checked(machine: Machine, viscous_at: float | None, points: Mapping[str, float]) -> Coupling:
    if machine.rail.torsion is not None:
        raise CouplingError(
            "one coordinate of the rail's twist belongs to the place of the head, which cannot travel with it; leave it out"
        )
    if machine.nonlinear:
        raise CouplingError(
            "nonlinear elements are not stepped while the head travels; leave them out, or let it stand"
        )
    return machine.coupling(viscous_at, points)


def _end_force(
    machine: Machine, name: str, viscous_at: float | None, ports: Sequence[str], points: Mapping[str, float],
    state: RidingState, rows_at: Callable[[RidingCourse], Rows],
) -> FloatArray:  # fmt: skip
    """Force of the rail on what holds an end: of spring and damper, or what the equation of the released end lacks at rest."""
    end, dofs = name.removesuffix("_force"), machine.coupling(viscous_at).dofs
    supports = machine.coupling(viscous_at).rail.supports
    if supports is not None:
        k, c = (supports.k_left, supports.c_left) if end == "rail_left" else (supports.k_right, supports.c_right)
        q, v, _ = (part[:, dofs.index(end)] for part in state.motion)
        return k * q + c * v
    released = replace(machine, rail=replace(machine.rail, supports=EndSupports(1.0, 1.0)))
    free = RidingCourse.of(released.coupling(viscous_at, points), ports)
    place = np.zeros((len(dofs), len(free.exact.dofs)))
    place[np.arange(len(dofs)), [free.exact.dofs.index(dof) for dof in dofs]] = 1.0
    q, v, a = (part @ place for part in state.motion)
    lacking = free.residual(RidingState((q, v, a), rows_at(free), state.forces))
    return lacking[:, free.exact.dofs.index(end)]


def _refined(forces: FloatArray, substeps: int) -> FloatArray:
    """Forces at the ends of the substeps, shape (step + 1, input): linear between samples."""
    if substeps == 1:
        return forces
    part = np.arange(substeps)[:, None] / substeps
    inner = forces[:-1, None] * (1 - part) + forces[1:, None] * part
    return np.concatenate([inner.reshape(-1, forces.shape[1]), forces[-1:]])


def _stepped(
    course: RidingCourse, travel: Travel, forces: FloatArray, h: float, begin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """q and q̇, shape (step + 1, 2, n), and work, shape (step + 1, 3), at the ends of the steps."""
    steps, n = len(forces) - 1, len(course.exact.dofs)
    motion, work = np.zeros((steps + 1, 2, n)), np.zeros((steps + 1, 3))
    motion[0, 0] = begin
    for first in range(0, steps, _BLOCK):
        last = min(first + _BLOCK, steps)
        instants = h * (np.arange(first, last)[:, None] + NODES)
        carried = np.array(course.rows_at(travel, instants.ravel())).reshape(3, last - first, 3, n)
        block = np.ascontiguousarray(forces[first : last + 1])
        found, stages = travel_steps(
            course.fixed,
            course.rows,
            course.own,
            course.pushes,
            course.own_pushes,
            carried,
            block,
            h,
            RULES,
            motion[first],
        )
        motion[first + 1 : last + 1] = found[1:]
        work[first + 1 : last + 1] = work[first] + np.cumsum(course.work(found, stages, carried, block, h), axis=0)
    return motion, work
