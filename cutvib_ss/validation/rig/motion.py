"""
How the machine answers blows.

A linear machine answers in the frequency domain, on a line s = σ + iω that lets a long response die out within the period
of the transform; a machine with nonlinear elements is integrated in time (`laws`), its linear part exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from cutvib_ss.validation.rig.blows import FS, Blow, antialiased
from cutvib_ss.validation.rig.fittings import combination
from cutvib_ss.validation.rig.laws import KINDS, VALUES
from cutvib_ss.validation.rig.multibody import Linearised
from cutvib_ss.validation.rig.stepping import TOLERANCE, integrate
from cutvib_ss.validation.rig.structure import Machinery

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

STEPS = (8, 16, 32, 64, 128, 256, 512)
"""Steps to a sample of the records that are tried in turn."""

CONVERGED = 0.005
"""
What a third of the last halving may be, over the noise: root mean squares.

Half of the 1 % that is asked: where a kink is passed the error does not fall fourfold with every halving.
"""

SENSITIVE = 1e-6
"""Relative change of the force that no record would show: its noise is twenty times that and more."""

_FINE_ENOUGH = 128
"""Steps to a sample from which on it is asked whether the motion itself is what does not repeat."""

_PERIOD = 8.0
"""Period of the transforms [s]."""

_DECAY = 1.5
"""σ [1/s]: a response is e^-12 of itself when the period is over."""

_SOFT = 1e-3
"""Natural frequency that motion as a rigid body is given [rad/s]: within two seconds a part in a million of it."""


class NotConvergedError(RuntimeError):
    """A blow could not be integrated as closely as it must."""


@dataclass(frozen=True)
class Modes:
    """State-space modes, one of each conjugate pair."""

    poles: Complex  # Poles [rad/s]
    shapes: Complex  # Displacement of the ports
    weights: Complex  # How forces at the ports drive the modes, twice where there is a pair
    names: tuple[str, ...]  # The ports

    def port(self, name: str) -> Complex:
        """Displacement of a port in each mode."""
        return np.asarray(sum(factor * self.shapes[self.names.index(n)] for n, factor in combination(name).items()))

    def input(self, name: str) -> Complex:
        """How a force at a port drives each mode."""
        return np.asarray(sum(factor * self.weights[self.names.index(n)] for n, factor in combination(name).items()))


def modes(machine: Linearised) -> Modes:
    """Modes of the first-order form."""
    free = _rigid_shapes(machine)
    return _modes(machine) if free is None else _with_rigid_modes(machine, *free)


def _rigid_shapes(machine: Linearised) -> tuple[Array, Array] | None:
    """Undamped shapes of a body that is free, rigid and elastic, per unit of modal mass; None where nothing is free."""
    # A pole of zero that is double has one eigenvector in the first-order form: rounding decides what residues it gets.
    symmetric = all(
        np.allclose(m, m.T, rtol=1e-9, atol=1e-9 * np.abs(m).max()) for m in (machine.stiffness, machine.damping)
    )
    if not symmetric:
        return None
    squares, shapes = eigh(machine.stiffness, machine.mass)
    rigid = np.abs(squares) < 1e-9 * squares.max()
    damped = np.abs(machine.damping @ shapes[:, rigid]).max(initial=0.0) > 1e-6 * np.abs(machine.damping @ shapes).max()
    return None if damped or not rigid.any() else (shapes[:, rigid], shapes[:, ~rigid])


def _with_rigid_modes(machine: Linearised, rigid: Array, elastic: Array) -> Modes:
    """Modes of a free body: of its elastic motion by themselves, and each rigid one on a very soft spring."""
    mass, damping, stiffness = (elastic.T @ m @ elastic for m in (machine.mass, machine.damping, machine.stiffness))
    ports = {name: row @ elastic for name, row in machine.ports.items()}
    rest = _modes(Linearised(mass, damping, stiffness, ports))
    moved = np.array([machine.ports[name] @ rigid for name in rest.names])
    return Modes(
        np.concatenate([rest.poles, np.full(rigid.shape[1], 1j * _SOFT)]),
        np.hstack([rest.shapes, moved]),
        np.hstack([rest.weights, moved / (1j * _SOFT)]),
        rest.names,
    )


def _modes(machine: Linearised) -> Modes:
    """Modes of a machine without poles that are double."""
    n = machine.mass.shape[0]
    stiffness, damping = (np.linalg.solve(machine.mass, matrix) for matrix in (machine.stiffness, machine.damping))
    scale = np.sqrt(np.abs(np.diag(stiffness)).max())  # velocities over it: a balanced matrix
    state = np.block([[np.zeros((n, n)), scale * np.eye(n)], [-stiffness / scale, -damping]])
    poles, right = np.linalg.eig(state)
    names = tuple(machine.ports)
    rows = np.array([machine.ports[name] for name in names])
    forces = np.vstack([np.zeros((n, len(names))), np.linalg.solve(machine.mass, rows.T) / scale])
    left = np.linalg.solve(right, forces)  # mode, port
    keep = poles.imag >= 0
    twice = np.where(poles.imag > 0, 2.0, 1.0)
    return Modes(poles[keep], rows @ right[:n][:, keep], (twice[:, None] * left)[keep].T, names)


def receptance(m: Modes, s: Complex, outputs: Sequence[str], inputs: Sequence[str]) -> Complex:
    """Displacements over forces."""
    # 2 Re of one of a pair holds in time; over s the conjugate has to be written out
    out = np.array([m.port(name) for name in outputs])
    force = np.array([m.input(name) for name in inputs])
    single = np.where(m.poles.imag > 0, 0.5, 1.0)
    residue = (out[:, None] * force[None] * single).reshape(-1, m.poles.size)
    response = residue @ (1.0 / (s[None] - m.poles[:, None]))
    pair = m.poles.imag > 0
    response += residue[:, pair].conj() @ (1.0 / (s[None] - m.poles[pair, None].conj()))
    return np.asarray(response.reshape(len(outputs), len(inputs), s.size))


def frequency_response(rig: Machinery, machine: Linearised, s: Complex) -> Complex:
    """Motion of the channels over the force, nonlinear laws left out."""
    m = modes(machine)
    elements, channels = rig.fittings.lossy, [c.port for c in rig.channels]
    alpha = receptance(
        m, s, [*channels, *(e.sense or e.port for e in elements)], [rig.drive, *(e.port for e in elements)]
    )
    shown, sensed = alpha[: len(channels)], alpha[len(channels) :]
    response = shown[:, 0]
    if elements:
        # f = -z q where q is sensed: q = (1 + A z)^-1 α
        z = np.array([e.stiffness(s) for e in elements])
        system = np.eye(len(elements))[:, :, None] + sensed[:, 1:] * z[None]
        motion = np.linalg.solve(system.transpose(2, 0, 1), sensed[:, 0].T[..., None])[..., 0].T
        response = response - np.einsum("cjf,jf->cf", shown[:, 1:], z * motion)
    return np.asarray(response * np.array([s**c.order for c in rig.channels]))


def linear_answer(rig: Machinery, machine: Linearised, forces: Array, fs: float) -> Array:
    """Accelerations of a linear machine from rest."""
    count = round(_PERIOD * fs)
    time = np.arange(forces.shape[-1]) / fs
    s = np.asarray(_DECAY + 2j * np.pi * np.fft.rfftfreq(count, 1 / fs), dtype=np.complex128)
    response = frequency_response(rig, machine, s)
    spectra = np.fft.rfft(forces * np.exp(-_DECAY * time), count)
    answer = np.fft.irfft(spectra[:, None] * response[None], count)[..., : time.size]
    answer = np.asarray(answer * np.exp(_DECAY * time))
    if any(e.kind == "feedback" for e in rig.fittings.lossy):
        # an unstable loop has poles right of the line s: its answer would come before the blow
        before = np.abs(answer[..., : round(0.04 * fs)]).max(axis=-1)
        if (before > 1e-4 * np.abs(answer).max(axis=-1)).any():
            raise NotConvergedError("feedback: the loop is unstable")
    return answer


def nonlinear_answer(rig: Machinery, machine: Linearised, force: Array, fs: float) -> Array:
    """Accelerations of a machine with nonlinear elements from rest."""
    if rig.fittings.lossy:
        raise ValueError("elements without matrices have no motion in time beside nonlinear ones")
    m = modes(machine)
    step = 1 / fs
    ports = [law.port for law in rig.fittings.laws]
    drive = np.array([m.input(name) for name in (rig.drive, *ports)]).T
    z = m.poles * step
    decay = np.exp(z)
    # ∫ e^(λ(h-t)) of an input linear in t; the second form where the first would lose digits
    small = np.abs(z) < 1e-3
    safe = np.where(small, 1.0, z)
    end = np.where(small, 0.5 + z / 6 + z**2 / 24, (decay - 1 - z) / safe**2) * step
    begin = np.where(small, 1 + z / 2 + z**2 / 6, (decay - 1) / safe) * step - end
    deflections = np.array([m.port(name) for name in ports])
    channels = np.array([m.port(c.port) for c in rig.channels])
    order = np.array([c.order for c in rig.channels])[:, None]
    # v = Σ λ·shape·x is exact away from the instant of a force; its derivative adds what the force accelerates at once
    direct = (channels * m.poles) @ drive * (order == 2)
    values = np.zeros((len(ports), VALUES))
    for row, law in zip(values, rig.fittings.laws, strict=True):
        row[: len(law.values)] = law.values
    response, left = integrate(
        decay,
        begin[:, None] * drive,
        end[:, None] * drive,
        np.vstack([deflections, deflections * m.poles]),
        channels * m.poles**order,
        np.ascontiguousarray(direct.real),
        np.array([KINDS[law.kind] for law in rig.fittings.laws], dtype=np.int64),
        values,
        force,
        step,
    )
    if not left <= 10 * TOLERANCE:
        kinds = ", ".join(law.kind for law in rig.fittings.laws)
        raise NotConvergedError(f"{kinds}: a step of {step:.3g} s is solved to {left:.3g} of the largest force only")
    return np.asarray(response)


@dataclass(frozen=True)
class Stepped:
    """A blow's answer in steps that are short enough."""

    response: Array  # Accelerations of the channels
    steps: int  # Steps to a sample
    error: float  # A third of what the last halving changed, over the noise
    # What a change of the force by `SENSITIVE` does, over the noise, where that is more than the steps do and than `CONVERGED`
    sensitivity: float = 0.0


def converged_answer(
    rig: Machinery, machine: Linearised, blow: Blow, noise: Sequence[float], first: int = STEPS[0]
) -> Stepped:
    """
    Accelerations of a machine with nonlinear elements, steps halved until that no longer matters.

    A joint that comes to rest inside its clearance rattles between the flanks, and that motion is unstable: what a step of 1/4096
    of a sample does is as large, a second later, as what a hundred millionth of the force does (`tests/unit/test_rig_motion.py`).
    No integrator converges there to the response. It converges to the response to a force that differs by less than anybody could
    measure, and such a blow is as good as any: it is kept where `SENSITIVE` of the force changes more than the halved steps do.
    """
    scale = np.asarray(noise)[:, None]

    def differ(one: Array, other: Array) -> float:
        return float(np.sqrt(np.mean(((one - other) / scale) ** 2, axis=1)).max())

    before, error = None, np.inf
    for fine in STEPS:
        if fine < first and fine != STEPS[-2]:
            continue
        force = blow.force(fine)
        answer = antialiased(nonlinear_answer(rig, machine, force, FS * fine), fine)
        if before is not None:
            error = differ(answer, before) / 3
            if error <= CONVERGED:
                return Stepped(answer, fine, error)
            if fine >= _FINE_ENOUGH:
                other = antialiased(nonlinear_answer(rig, machine, force * (1 + SENSITIVE), FS * fine), fine)
                sensitivity = differ(answer, other)
                if sensitivity >= max(error, CONVERGED):
                    return Stepped(answer, fine, error, sensitivity)
        before = answer
    kinds = ", ".join(law.kind for law in rig.fittings.laws)
    raise NotConvergedError(f"{kinds}: at steps of 1/{STEPS[-1] * FS:.0f} s {error:.3g} of the noise is still wrong")
