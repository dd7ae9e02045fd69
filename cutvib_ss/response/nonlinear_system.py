"""A model with its nonlinear elements as python-control's nonlinear system, for others' tools."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cutvib_ss.model.protocol import Model
from cutvib_ss.model.restoring_forces import Hysteretic
from cutvib_ss.parameters import check_number
from cutvib_ss.response.modal_form import row_of, system_with
from cutvib_ss.results import FloatArray, Quantity

if TYPE_CHECKING:
    import control


def nonlinear_system(
    machine: Model,
    position: float | None = None,
    outputs: Sequence[str] | None = None,
    quantity: Quantity | None = None,
    viscous_at: float | None = None,
    sticking_rate: float = 1e-6,
) -> control.NonlinearIOSystem:
    """
    The model, its measurement chain apart, with its nonlinear elements as a `control.nlsys` from ``force`` to the outputs.

    Friction is torque · tanh(rate/sticking_rate); it creeps where `time_response` sticks. Slip has corners, on which implicit
    methods stall: integrate it with an explicit one (RK45), and always with a ``max_step`` below the force's shortest detail.

    >>> from cutvib_ss.effects.cubic_stiffness import CubicStiffness
    >>> from cutvib_ss.model.machine import published_machine
    >>> nonlinear_system(CubicStiffness("joint2", 8e9).apply(published_machine()), 0.5).nstates
    12
    """
    check_number("sticking_rate", sticking_rate, 0.0, strict=True)
    names = tuple(machine.channels) if outputs is None else tuple(outputs)
    elements = machine.nonlinear
    system = system_with(machine, position, viscous_at, [n for n in names if n not in machine.channels])
    ports = {"force": machine.drive(system)}
    reads: dict[str, tuple[str, Quantity]] = {}
    for name in names:
        channel = machine.channels.get(name)
        ports[f"read {name}"] = row_of(system, channel.port if channel else name)
        reads[name] = (f"read {name}", quantity or (channel.quantity if channel else "displacement"))
    inputs = {"force": "force"}
    for k, e in enumerate(elements):
        ports[f"element {k}"] = row_of(system, e.port)
        inputs[f"element {k}"] = f"element {k}"
        reads |= {f"motion {k}": (f"element {k}", "displacement"), f"rate {k}": (f"element {k}", "velocity")}
    plant = replace(system, ports=ports).state_space(inputs, reads)
    count, n = len(names), plant.nstates
    # Of Coulomb friction a smooth sign; of other Jenkins elements each is a state.
    laws = [e.restoring_force for e in elements]
    sliders = {k: f.sliders() for k, f in enumerate(laws) if isinstance(f, Hysteretic) and not f.jumps}
    owner = np.array([k for k, own in sliders.items() for _ in own], dtype=int)
    stiffness, limit = np.vstack([np.zeros((0, 2)), *sliders.values()]).T
    states = [
        *plant.state_labels,
        *(f"slip {k}" if len(own) == 1 else f"slip {k}.{i}" for k, own in sliders.items() for i in range(len(own))),
    ]

    def resisting(x: FloatArray) -> FloatArray:
        motion = plant.C[count:] @ x[:n]
        slipping = np.clip(x[n:], -limit, limit)
        forces = np.zeros(len(elements))
        for k, force in enumerate(laws):
            q, v = motion[2 * k], motion[2 * k + 1]
            if k in sliders:
                forces[k] = slipping[owner == k].sum()
            elif isinstance(force, Hysteretic):
                forces[k] = force.sliders()[0, 1] * np.tanh(v / sticking_rate)
            else:
                forces[k] = force.force(q, v)
        return forces

    def update(t: float, x: FloatArray, u: FloatArray, params: Any) -> FloatArray:
        rates = plant.A @ x[:n] + plant.B @ np.concatenate([np.atleast_1d(u), -resisting(x)])
        v = plant.C[count + 2 * owner + 1] @ x[:n]
        slides = (np.abs(x[n:]) >= limit) & (x[n:] * v > 0.0)
        return np.concatenate([rates, np.where(slides, 0.0, stiffness * v)])

    def output(t: float, x: FloatArray, u: FloatArray, params: Any) -> FloatArray:
        inputs_ = np.concatenate([np.atleast_1d(u), -resisting(x)])
        return np.asarray(plant.C[:count] @ x[:n] + plant.D[:count] @ inputs_)

    import control  # late: it takes long to load

    return control.nlsys(update, output, inputs=["force"], outputs=list(names), states=states, name="corrected machine")
