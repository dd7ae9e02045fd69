"""
Head and rail as python-control objects, and the base-force loop closed between them (Eqs. 5, 6, 10).

The head, driven by forces and by the motion of its base, gives its rotations and the force on its base; the rail, driven by
that force, gives the motion. `control.interconnect` refuses such a loop of direct feedthroughs; `StateSpace.feedback` closes it.
"""

from __future__ import annotations

from collections.abc import Mapping

import control
import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.mechanical import SecondOrder
from cutvib_ss.results import FloatArray, Quantity, check_choice
from cutvib_ss.subsystems.elements import Guide
from cutvib_ss.units import DERIVATIVE_ORDER


def base_driven(system: SecondOrder, interface: tuple[str, ...], inputs: Mapping[str, str]) -> control.StateSpace:
    """
    A subsystem driven by forces and by the motion of its interface degrees of freedom.

    Parameters
    ----------
    system : SecondOrder
        The subsystem, for instance the head.
    interface : tuple of str
        Ports that are single degrees of freedom, whose motion is prescribed.
    inputs : mapping of str to str
        Signal name to the port on which that force acts.

    Returns
    -------
    control.StateSpace
        Inputs: the forces, then displacement, velocity and acceleration of each interface degree of freedom. Outputs: the
        free degrees of freedom [displacement], then the forces that the subsystem exerts through the interface.

    Notes
    -----
    With free (f) and interface (u) parts of M, C, K: M_ff q̈ + C_ff q̇ + K_ff q = b_f F - M_fu ü - C_fu u̇ - K_fu u, and the
    force handed on is b_u F - (M_uf q̈ + C_uf q̇ + K_uf q) - (M_uu ü + C_uu u̇ + K_uu u), Eq. 3's -F_bx.
    """
    u = [int(np.flatnonzero(system.port(p))[0]) for p in interface]
    f = [i for i in range(len(system.dofs)) if i not in u]
    matrices = (system.stiffness, system.damping, system.mass)
    motions: tuple[Quantity, ...] = ("displacement", "velocity", "acceleration")
    ports = {f"force {name}": system.port(port)[f] for name, port in inputs.items()}
    for matrix, motion in zip(matrices, motions, strict=True):
        for j, dof in enumerate(u):
            ports[f"{motion} {j}"] = -matrix[f, dof]
    ports |= {system.dofs[i]: np.eye(len(f))[k] for k, i in enumerate(f)}
    free = SecondOrder(
        system.mass[np.ix_(f, f)], system.damping[np.ix_(f, f)], system.stiffness[np.ix_(f, f)],
        tuple(system.dofs[i] for i in f), ports,
    )  # fmt: skip
    drives = [*(f"force {name}" for name in inputs), *(f"{m} {j}" for m in motions for j in range(len(u)))]
    reads: dict[str, tuple[str, Quantity]] = {free.dofs[k]: (free.dofs[k], "displacement") for k in range(len(f))}
    reads |= {f"{m} {j}": (f"{m} {j}", m) for m in motions for j in range(len(u))}
    raw = free.state_space({d: d for d in drives}, reads)
    nf, nu = len(f), len(u)
    # The three inertial, damping and elastic parts of each interface force are summed by a constant matrix.
    sums = np.block([[np.eye(nf), np.zeros((nf, 3 * nu))], [np.zeros((nu, nf)), np.tile(np.eye(nu), 3)]])
    direct = np.zeros((nf + nu, len(drives)))
    for k, port in enumerate(inputs.values()):
        direct[nf:, k] = system.port(port)[u]
    for k, matrix in enumerate(matrices):
        columns = slice(len(inputs) + k * nu, len(inputs) + (k + 1) * nu)
        direct[nf:, columns] = -matrix[np.ix_(u, u)]
    names = [*free.dofs, *(f"interface force {j}" for j in range(nu))]
    return control.ss(raw.A, raw.B, sums @ raw.C, sums @ raw.D + direct, inputs=drives, outputs=names)


def close_base_loop(
    head: SecondOrder,
    rail: SecondOrder,
    interface: tuple[tuple[str, ...], tuple[str, ...]],
    guide: Guide | None,
    inputs: Mapping[str, str],
    outputs: Mapping[str, str],
) -> control.StateSpace:
    """
    Head and rail joined at the base, rigidly or through the guide.

    Parameters
    ----------
    head, rail : SecondOrder
        The two parts.
    interface : tuple
        Ports of the rail and of the head that move together.
    guide : Guide or None
        What gives between the first of them; None: nothing does.
    inputs, outputs : mapping of str to str
        Signal names to ports of the head or the rail (the rail's first, where both have it).

    Returns
    -------
    control.StateSpace
        Displacement outputs, signals named.
    """
    on_rail, on_head = interface
    head_ports = set(head.ports) - set(rail.ports)
    for port in [*inputs.values(), *outputs.values()]:
        if port not in head_ports and port not in rail.ports:
            known = ", ".join(sorted(head_ports | set(rail.ports)))
            raise ParameterError(f"no port {port!r}; there are {known}")
    head_in = {n: p for n, p in inputs.items() if p in head_ports}
    rail_in = {n: p for n, p in inputs.items() if p not in head_ports}
    driven_ports = on_head if guide is None else on_head[1:]
    elastic = () if guide is None else on_head[:1]
    driven = base_driven(head, driven_ports, {**head_in, **{f"guide {p}": p for p in elastic}})
    motions: tuple[Quantity, ...] = ("displacement", "velocity", "acceleration")
    joints = [f"joint {j}" for j in range(len(on_rail))]
    reads: dict[str, tuple[str, Quantity]] = {f"{m} {j}": (p, m) for m in motions for j, p in enumerate(on_rail)}
    reads |= {f"dof {d}": (d, "displacement") for d in rail.dofs}
    with_dofs = SecondOrder(
        rail.mass, rail.damping, rail.stiffness, rail.dofs,
        {**rail.ports, **{d: np.eye(len(rail.dofs))[i] for i, d in enumerate(rail.dofs)}},
    )  # fmt: skip
    beam = with_dofs.state_space({**dict(zip(joints, on_rail, strict=True)), **rail_in}, reads)
    both = control.append(driven, beam)
    ins = [*driven.input_labels, *beam.input_labels]
    outs = [*driven.output_labels, *beam.output_labels]
    loop = np.zeros((len(ins), len(outs)))
    shift = 0 if guide is None else 1
    for j in range(shift, len(on_rail)):
        loop[ins.index(f"joint {j}"), outs.index(f"interface force {j - shift}")] = 1.0
        for m in motions:
            loop[ins.index(f"{m} {j - shift}"), len(driven.output_labels) + beam.output_labels.index(f"{m} {j}")] = 1.0
    if guide is not None:
        # The guide's force acts on the head's base and, opposite and equal, on the rail.
        both, outs = _with_rates(both, outs, [on_head[0] if on_head[0] in outs else "base"])
        across = np.zeros(len(outs))
        dof = head.dofs[int(np.flatnonzero(head.port(on_head[0]))[0])]
        offset = len(driven.output_labels)
        across[outs.index(dof)] = guide.stiffness
        across[offset + beam.output_labels.index("displacement 0")] = -guide.stiffness
        across[len(outs) - 1] = guide.damping
        across[offset + beam.output_labels.index("velocity 0")] = -guide.damping
        loop = np.hstack([loop, np.zeros((len(ins), 1))])
        loop[ins.index("joint 0")] = across
        loop[ins.index(f"force guide {on_head[0]}")] = -across
    closed = both.feedback(control.ss([], [], [], loop), sign=1)
    pick_in = [ins.index(f"force {n}") if n in head_in else ins.index(n) for n in inputs]
    rows = np.array(
        [_output_row(head, rail, p, p in head_ports, on_head, on_rail, guide, outs) for p in outputs.values()]
    )
    rows = rows.reshape(len(outputs), len(outs))
    return control.ss(
        closed.A, closed.B[:, pick_in], rows @ closed.C, np.zeros((len(outputs), len(inputs))),
        inputs=list(inputs), outputs=list(outputs),
    )  # fmt: skip


def _with_rates(system: control.StateSpace, names: list[str], of: list[str]) -> tuple[control.StateSpace, list[str]]:
    """The system with velocities of some of its displacement outputs as further outputs."""
    index = [names.index(n) for n in of]
    rate_c = system.C[index] @ system.A
    rate_d = system.C[index] @ system.B
    out = control.ss(system.A, system.B, np.vstack([system.C, rate_c]), np.vstack([system.D, rate_d]))
    return out, names + [f"{n} rate" for n in of]


def _output_row(
    head: SecondOrder, rail: SecondOrder, port: str, of_head: bool, on_head: tuple[str, ...], on_rail: tuple[str, ...],
    guide: Guide | None, outs: list[str],
) -> FloatArray:  # fmt: skip
    """Displacement of a port over the outputs of both parts."""
    row = np.zeros(len(outs))
    if not of_head:
        for i, dof in enumerate(rail.dofs):
            row[outs.index(f"dof {dof}")] = rail.port(port)[i]
        return row
    prescribed = {int(np.flatnonzero(head.port(p))[0]): j for j, p in enumerate(on_head) if guide is None or j > 0}
    for i, weight in enumerate(head.port(port)):
        if i not in prescribed:
            row[outs.index(head.dofs[i])] += weight
        else:
            for k, dof in enumerate(rail.dofs):
                row[outs.index(f"dof {dof}")] += weight * rail.port(on_rail[prescribed[i]])[k]
    return row


def with_quantity(plant: control.StateSpace, quantity: Quantity, name: str) -> control.StateSpace:
    """
    A displacement plant with its outputs differentiated.

    Parameters
    ----------
    plant : control.StateSpace
        Displacement outputs.
    quantity : {"displacement", "velocity", "acceleration"}
        Wanted motion.
    name : str
        Name of the result.

    Returns
    -------
    control.StateSpace
        The same states; y = C x, C A x, or C A² x + C A B u (a force moves neither displacement nor velocity at once).
    """
    c, d = plant.C, plant.D
    check_choice("quantity", quantity, tuple(DERIVATIVE_ORDER))
    for _ in range(DERIVATIVE_ORDER[quantity]):
        d = c @ plant.B
        c = c @ plant.A
    if quantity == "velocity":
        d = np.zeros_like(plant.D)
    return control.ss(
        plant.A,
        plant.B,
        c,
        d,
        inputs=plant.input_labels,
        outputs=plant.output_labels,
        states=plant.state_labels,
        name=name,
    )
