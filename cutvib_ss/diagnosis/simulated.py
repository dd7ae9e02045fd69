"""Records as a model with nonlinear elements shows them: their force run in time, their own estimator on what comes out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cutvib_ss.diagnosis.records import Group
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.sweeps import SweptRecord, swept
from cutvib_ss.diagnosis.work import count
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import DiagnosisError
from cutvib_ss.measurement.replay import Replay
from cutvib_ss.model.measurement_chain import ChainAtLines
from cutvib_ss.response.stepping import ModalForm, modal_form, step
from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.results.arrays import position_at


class _Run(NamedTuple):
    """One record's histories, and what makes responses of them."""

    replay: Replay
    chain: ChainAtLines
    order: list[int]  # Of the signals among the stepped outputs
    typical: FloatArray | None  # Responses to the blow of middle size; None where it is the only one
    motions: FloatArray  # Of each nonlinear element's port
    forces: FloatArray


@dataclass(frozen=True)
class Simulated:
    """Records of a group as a model with nonlinear elements would show them."""

    model: Model  # The model
    group: Group  # The records, a row each
    data: ComplexArray  # The prediction
    runs: Mapping[int, _Run]  # What was stepped, by row; only derivatives ask for more than the prediction
    # Sine sweeps among the records, by row: they are balanced in their harmonics instead of stepped in time
    sweeps: Mapping[int, SweptRecord] = field(default_factory=dict)

    @cached_property
    def typical(self) -> ComplexArray:
        """The prediction as the blow of middle size of each record alone shows it."""
        out = self.data.copy()
        for row, run in self.runs.items():
            if run.typical is not None:
                out[row] = run.chain.shown(run.replay.typical.simulated([run.typical])[run.order])
        return out

    @cached_property
    def stiffness(self) -> ComplexArray:
        """Equivalent dynamic stiffness of each nonlinear element: H1 of its force over the motion of its port."""
        out = np.zeros((len(self.data), len(self.model.nonlinear), self.group.freq.size), dtype=np.complex128)
        for row, run in self.runs.items() if self.model.nonlinear else ():
            out[row] = _equivalent(run.replay, run.motions, run.forces)
        return out


def simulated(
    model: Model,
    group: Group,
    wanted: np.ndarray | None = None,
    steps: float = SETTINGS.simulation_steps,
    force_scale: FloatArray | None = None,
    offset: float = 0.0,
    one_blow: bool = False,
) -> Simulated:
    """
    Run each record's force through a model in time, and its estimator on the responses.

    `offset` is a constant force [N] that acts beside the recorded one all through a continuous recording. With `one_blow` only
    that of middle size of several blows is run, which is all that a difference needs.
    """
    elements = model.nonlinear
    # Stepped are the channels' own quantities, and a window is applied in time: the chain does the rest.
    none, s = (0,) * len(group.channels), 2j * np.pi * group.freq
    windowed, steady = (c.at(group.channels, none, s) for c in (model.chain, replace(model.chain, decay_rate=0.0)))
    outputs = tuple(dict.fromkeys(steady.signals))
    data = np.zeros(group.data.shape, dtype=np.complex128)
    runs: dict[int, _Run] = {}
    still = SETTINGS.simulation_static_above * float(group.freq[-1])
    sweeps = {row: swept(model, group, row) for row in range(len(data)) if group.entries[row][0].sine is not None}
    for row, sweep in sweeps.items():
        data[row] = sweep.data
    forms: dict[tuple[float | None, str], ModalForm] = {}
    for rows in _batches(group, wanted):
        position = position_at(group.positions[rows[0]])
        replays = [_replay(group, row) for row in rows]
        struck = group.inputs[rows[0]]
        if (position, struck) not in forms:
            forms[position, struck] = modal_form(
                model,
                position,
                outputs,
                SETTINGS.simulation_hysteresis_at,
                classical_above=SETTINGS.simulation_classical_above * float(group.freq[-1]),
                input=struck,
            )
        form = forms[position, struck]
        # All records at a position in one call: they share the modal sum.
        scales = np.ones(len(data)) if force_scale is None else force_scale
        windows = [_window(model, r) for r in replays] if model.chain.decay_rate else []
        if one_blow:
            windows = [(gain, w if r.block else w[[r.middle]]) for r, (gain, w) in zip(replays, windows, strict=False)]
            replays = [r if r.block else r.typical for r in replays]
        size = dict(zip(rows, scales[rows] * np.array([gain for gain, _ in windows] or [1.0]), strict=True))
        forces = np.concatenate(
            [size[row] * np.stack(r.forces) + offset * _begun(r) for row, r in zip(rows, replays, strict=True)]
        )
        # An unstable model runs away: it leaves no finite residual, and no step is taken there.
        with np.errstate(all="ignore"):
            count(SETTINGS.search_sample * forces.size)
            run = step(form, forces, replays[0].fs, elements, dynamic_below=still, steps=steps)
        if windows:
            for part in (run.responses, run.motions, run.forces):
                part *= np.concatenate([w for _, w in windows])[:, None, :]
        begun = 0
        for row, replay in zip(rows, replays, strict=True):
            own = slice(begun, begun + len(replay.forces))
            begun = own.stop
            responses = list(run.responses[own] / size[row])
            chain = steady if replay.block else windowed
            order = [outputs.index(name) for name in chain.signals]
            data[row] = chain.shown(replay.simulated(responses)[order])
            apart = len(responses) > 1 and not replay.block
            runs[row] = _Run(
                replay,
                chain,
                order,
                responses[replay.middle].copy() if apart else None,
                run.motions[own],
                run.forces[own],
            )
    return Simulated(model, group, data, runs, sweeps)


def _window(model: Model, replay: Replay) -> tuple[float, FloatArray]:
    """What an exponential window that nobody took out does to blows: gain of the force, window on responses (blow, sample)."""
    # The force was larger than recorded by the gain; the window is one at the blow.
    force = np.stack(replay.forces)
    # A continuous recording, cut into blocks, has no blow for a window to begin at.
    chain = replace(model.chain, decay_rate=0.0) if replay.block else model.chain
    at = np.argmax(np.abs(force), axis=1)[:, None] / replay.fs
    # A guessed force is the one that acted.
    gain = 1.0 if replay.assumed else float(chain.window(-at.mean()))
    return gain, chain.window(np.arange(force.shape[1]) / replay.fs - at)


def _begun(replay: Replay) -> FloatArray:
    """How far a constant force acts in a simulation from rest: it rises over half a block, for a step would make it ring."""
    count = replay.forces[0].size
    if not replay.block:
        return np.zeros(count)
    return 0.5 - 0.5 * np.cos(np.pi * np.minimum(np.arange(count) / (replay.block // 2), 1.0))


def _replay(group: Group, row: int) -> Replay:
    replay = group.entries[row][0].replay
    if replay is None:
        raise DiagnosisError("a record without a force history cannot be simulated")
    return replay


def _batches(group: Group, wanted: np.ndarray | None) -> list[list[int]]:
    """Rows at one position and input whose histories have one length and clock."""
    found: dict[tuple[float | None, str, float, int], list[int]] = {}
    for row, position in enumerate(group.positions):
        if group.entries[row][0].sine is None and (wanted is None or wanted[row]):
            replay = _replay(group, row)
            key = (position_at(position), group.inputs[row], replay.fs, replay.forces[0].size)
            found.setdefault(key, []).append(row)
    return list(found.values())


def _equivalent(replay: Replay, motions: FloatArray, forces: FloatArray) -> ComplexArray:
    """Force of each element over its motion, shape (element, frequency)."""
    pairs = [(motions[:, k], forces[:, k]) for k in range(motions.shape[1])]
    return np.array([replay.ratio(list(q), list(f)) for q, f in pairs])
