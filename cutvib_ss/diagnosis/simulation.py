"""
Causes that depend on the level: the measured force is run through the model in time, and the record's own estimator on what
comes out.

Such a hypothesis has one prediction a record, none that records at one position could share. Its derivatives to tuning
and to linear effects come from the equivalent linear model: at every record, the nonlinear force is the motion of its port times
an equivalent dynamic stiffness z(ω), known from the simulation, and moves with the model through Sherman-Morrison. Those to the
restoring force's own parameters are differences of two simulations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from cutvib_ss.diagnosis.equivalent_forces import EquivalentForces
from cutvib_ss.diagnosis.form_errors import Form, form_of, scaled
from cutvib_ss.diagnosis.hypothesis import Hypothesis, stages_of
from cutvib_ss.diagnosis.leakage import Leakage, wanders
from cutvib_ss.diagnosis.prediction import Circles, Predicted, Prediction
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import By, Group, Records, merged, site
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.sweeps import SweptRecord, swept
from cutvib_ss.diagnosis.unknown_by_level import ByLevelProblem
from cutvib_ss.diagnosis.unknown_element import ByLevel
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
    first: FloatArray | None  # Responses to the first blow; None where it is the only one
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
    def first(self) -> ComplexArray:
        """The prediction as the first blow of each record alone shows it."""
        out = self.data.copy()
        for row, run in self.runs.items():
            if run.first is not None:
                out[row] = run.chain.shown(run.replay.first.simulated([run.first])[run.order])
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
    first_blow: bool = False,
) -> Simulated:
    """
    Run each record's force through a model in time, and its estimator on the responses.

    `offset` is a constant force [N] that acts beside the recorded one all through a continuous recording. With `first_blow` only
    the first of several blows is run, which is all that a difference needs.
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
        if first_blow:
            replays = [r if r.block else r.first for r in replays]
            windows = [(gain, w[: len(r.forces)]) for r, (gain, w) in zip(replays, windows, strict=False)]
        size = dict(zip(rows, scales[rows] * np.array([gain for gain, _ in windows] or [1.0]), strict=True))
        forces = np.concatenate(
            [size[row] * np.stack(r.forces) + offset * _begun(r) for row, r in zip(rows, replays, strict=True)]
        )
        # An unstable model runs away: it leaves no finite residual, and no step is taken there.
        with np.errstate(all="ignore"):
            count(SETTINGS.search_response * forces.size)
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
                replay, chain, order, responses[0].copy() if apart else None, run.motions[own], run.forces[own]
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


class SimulatedProblem(Problem):
    """A hypothesis with nonlinear effects, on records apart."""

    apart = True

    def __init__(
        self, nominal: Model, groups: Sequence[Group], hypothesis: Hypothesis, steps: float = SETTINGS.simulation_steps
    ) -> None:
        super().__init__(nominal, groups, hypothesis)
        self.steps = steps
        self._sites = [_sites(g) for g in self.groups]
        self._site_circles: list[Circles | None] = [None] * len(self.groups)

    def predictions(self, x: FloatArray | Sequence[FloatArray]) -> Sequence[Predicted]:
        """Each record, simulated."""
        each = self.each(x)
        scales = self._force_scales(each[0])
        models = self._models(each)
        offset = self.offset_of(each[0])
        return [
            simulated(m, g, None, self.steps, k, offset) for m, g, k in zip(models, self.groups, scales, strict=True)
        ]

    def _force_scaled(self) -> tuple[tuple[int, int], ...]:
        # What a linear model shows does not depend on the force.
        if self.hypothesis.linear:
            return ()
        found = ((g.entries[row][0], i, row) for i, g in enumerate(self.groups) for row in range(len(g.data)))
        # In the records' order, however they are grouped: unknowns are handed from fit to fit.
        scaled = sorted((e.record, i, row) for e, i, row in found if e.replay is not None and e.replay.assumed)
        return tuple((i, row) for _, i, row in scaled)

    def _force_offset(self) -> float:
        """Scale of the constant force [N] that a continuous recording lacks: a weight, a cable's pull, the zero of an amplifier."""
        if self.hypothesis.linear:
            return 0.0
        # On a restoring force a constant force acts as a working point; of blows the offset before them was taken out.
        replays = (e.replay for g in self.groups for same in g.entries for e in same)
        power = [float(np.mean(f**2)) for r in replays if r is not None and r.block for f in r.forces]
        return SETTINGS.simulation_force_offset * float(np.sqrt(np.mean(power))) if power else 0.0

    def _force_scales(self, x: FloatArray) -> list[FloatArray]:
        """Factors on the forces of each group's records."""
        out = [np.ones(len(g.data)) for g in self.groups]
        for (i, row), unknown in zip(self.force_scaled, self.force_unknowns(x), strict=True):
            out[i][row] = np.exp(SETTINGS.simulation_force_scale * unknown)
        return out

    def form_at(self, predictions: Sequence[Predicted]) -> Form:
        return form_of([p for p in predictions if isinstance(p, Simulated)])

    def form_errors(self, x: FloatArray, predictions: Sequence[Predicted], form: Form) -> dict[int, ComplexArray]:
        """What errors of a restoring force's form do to records, by these: shape (error, channel, frequency)."""
        step, out = SETTINGS.simulation_form_step, {}
        for p in predictions if form else ():
            assert isinstance(p, Simulated)
            index = self._fitted(p)
            scales = None if index is None else self._force_scales(x)[index]
            # A difference needs no exact ends, but for the instants at which a force jumps.
            jumps = any(e.restoring_force.jumps for e in p.model.nonlinear)
            run = partial(
                simulated,
                group=p.group,
                steps=self.steps if jumps else SETTINGS.simulation_rough_steps,
                force_scale=scales,
                offset=self.offset_of(x),
                first_blow=True,
            )
            here = run(p.model).data
            models = [replace(p.model, nonlinear=(*p.model.nonlinear, scaled(e, step))) for e in form]
            each = np.array([(run(m).data - here) / step for m in models])
            # Of a sweep the level is known line by line: that is in the errors of the equivalent stiffness.
            each[:, list(p.sweeps)] = 0.0
            # Where a spring that softens lets the motion run away, small errors do not lead anywhere.
            each[~np.isfinite(each)] = 0.0
            out.update({same[0].record: each[:, row] for row, same in enumerate(p.group.entries)})
        return out

    def _slopes(self, x: FloatArray, p: Simulated) -> list[ComplexArray]:
        index = self._fitted(p)
        sites, row = _sites(p.group) if index is None else self._sites[index]
        effects = self.effects(x)
        stages = stages_of(self.tuned(x), effects)
        moves = [(i, scale, carried) for i, (scale, carried) in enumerate(self._tuning_moves(effects, stages))]
        by_simulation: list[int] = []
        for k, (which, _, _) in enumerate(self.parameters):
            i = self.first_effect + k
            if self.hypothesis.effects[which].linear:
                moves.append((i, *self._effect_moves(x, k, effects, stages)))
            else:
                by_simulation.append(i)
        replays = {row: same[0].replay for row, same in enumerate(p.group.entries)}
        leaking = {row: replay for row, replay in replays.items() if replay is not None and replay.block}
        in_time = self.exact and not p.sweeps
        if in_time or (leaking and (p.model.nonlinear or wanders(p.model, p.group))):
            # Neither is a restoring force its equivalent stiffness where blocks leak, nor does a body that wanders off have a pole
            # to leak from. For errors of single parts, which are small and many, that has to do.
            by_simulation += [i for i, _, _ in moves if i not in self.parts.all]
            moves = [move for move in moves if move[0] in self.parts.all]
        out = {i: self._by_simulation(x, i, p) for i in by_simulation}
        out.update(self._by_force_scale(x, index, p))
        if self.force_offset > 0.0:
            step = SETTINGS.simulation_force_scale_step
            scales = None if index is None else self._force_scales(x)[index]
            there = simulated(p.model, p.group, None, self.steps, scales, self.offset_of(x) + step * self.force_offset)
            out[self._offset] = (there.data - p.data) / step
        if self.n_blow:
            # The assumed blow has its instant.
            out[self._blow] = np.zeros(p.data.shape, dtype=np.complex128)
        if moves:
            linear = Prediction(p.model, sites, 0.0, None if index is None else self._site_circles[index])
            if index is not None:
                self._site_circles[index] = linear.circles
            closed = [tuple((path, w) for path, w in carried if path[0] != "nonlinear") for _, _, carried in moves]
            taken = EquivalentForces(p.model, sites, row, p.stiffness)
            slopes = linear.derivatives(closed)[:, row] - taken.derivatives(closed)
            for k, replay in leaking.items():
                slopes[:, k] += Leakage(p.model, float(p.group.positions[k]), replay, p.group.freq).of(slopes[:, k])
            for (i, scale, carried), slope in zip(moves, slopes, strict=True):
                out[i] = scale * slope
                for k, sweep in p.sweeps.items():
                    out[i][k] = scale * sum(w * sweep.derivative(path) for path, w in carried)
        return [out[i] for i in sorted(out)]

    def _by_simulation(self, x: FloatArray, i: int, p: Simulated) -> ComplexArray:
        moved = x.copy()
        blows = all(same[0].replay is not None and not same[0].replay.block for same in p.group.entries)
        step = self._difference(i, blows and self.hypothesis.touches)
        moved[i] += step if i < self.n_tuning or x[i] + step <= 1.0 else -step
        index = self._fitted(p)
        scales = None if index is None else self._force_scales(x)[index]
        # Blows of one record are alike: how one of them changes tells enough of the way.
        alike = not self.exact
        there = simulated(self.applied(moved), p.group, None, self.steps, scales, self.offset_of(x), first_blow=alike)
        change: ComplexArray = (there.data - (p.first if alike else p.data)) / (moved[i] - x[i])
        return change

    def _difference(self, i: int, rounded: bool) -> float:
        """Step of an unknown in a difference."""
        if rounded:
            return SETTINGS.simulation_blow_steps[0 if i < self.n_tuning else 1]
        if i < self.first_effect:
            return SETTINGS.simulation_tuning_step if i < self.n_tuning else SETTINGS.simulation_law_step
        effect = self.hypothesis.effects[self.parameters[i - self.first_effect][0]]
        return SETTINGS.simulation_linear_step if effect.linear else SETTINGS.simulation_law_step

    def _fitted(self, p: Simulated) -> int | None:
        """Which of the groups a prediction is of; None if it is of records that are not fitted."""
        return next((i for i, g in enumerate(self.groups) if g is p.group), None)

    def _by_force_scale(self, x: FloatArray, index: int | None, p: Simulated) -> dict[int, ComplexArray]:
        """All records' forces moved at once: each moves its own record alone."""
        if index is None:
            nothing = np.zeros(p.data.shape, dtype=np.complex128)
            return dict.fromkeys(range(self._shared_by_all, self._offset), nothing)
        if not self.force_scaled:
            return {}
        moved = x.copy()
        moved[self._shared_by_all : self._offset] += SETTINGS.simulation_force_scale_step
        there = simulated(p.model, p.group, None, self.steps, self._force_scales(moved)[index], self.offset_of(x))
        change = (there.data - p.data) / SETTINGS.simulation_force_scale_step
        out = {}
        for k, (i, row) in enumerate(self.force_scaled):
            own = np.zeros(p.data.shape, dtype=np.complex128)
            if i == index:
                own[row] = change[row]
            out[self._shared_by_all + k] = own
        return out


def _sites(group: Group) -> tuple[Group, np.ndarray]:
    """The positions behind records apart, and the index of each record's."""
    entries = [same[0] for same in group.entries]
    (sites,) = merged(entries)
    names = [site(same[0]) for same in sites.entries]
    return replace(sites, blow_at=np.nan_to_num(sites.blow_at)), np.array([names.index(site(e)) for e in entries])


def unforced_problem(nominal: Model, records: Records, hypothesis: Hypothesis) -> Problem:
    """The unknowns of a hypothesis without the forces of single records: to draw models and calibration errors from a fit."""
    if any(isinstance(e, ByLevel) for e in hypothesis.effects):
        return ByLevelProblem(nominal, records.groups("record"), hypothesis)
    return Problem(nominal, records.merged, hypothesis)


def problem_for(
    nominal: Model, records: Records, hypothesis: Hypothesis, apart: bool = False, by: By | None = None
) -> Problem:
    """The problem of a hypothesis on some records; its groups hold all, one session, or one record each."""
    problem: Problem
    if any(isinstance(e, ByLevel) for e in hypothesis.effects):
        problem = ByLevelProblem(nominal, records.groups("record"), hypothesis)
    elif hypothesis.linear and not records.leaking and not apart:
        problem = Problem(nominal, records.groups(by), hypothesis)
    else:
        steps = SETTINGS.simulation_rough_steps if records.rough else SETTINGS.simulation_steps
        problem = SimulatedProblem(nominal, records.apart_groups(by), hypothesis, steps)
    # Beside a widened noise errors of single parts are nothing, and would take up what a cause does.
    problem.parts_held = records.widened
    if records.moving:
        problem.drifting_within = tuple(sorted(same[0].record for g in problem.groups for same in g.entries))
    return problem
