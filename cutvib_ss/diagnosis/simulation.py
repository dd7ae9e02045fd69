"""
Causes that depend on the level: the measured force is run through the model in time, and the record's own estimator on what
comes out.

Such a hypothesis has one prediction a record, none that records at one position could share. Its derivatives to the restoring
force's own parameters are differences of two simulations. On the way those to tuning and to linear effects come from the equivalent
linear model: at every record, the nonlinear force is the motion of its port times an equivalent dynamic stiffness z(ω), known from
the simulation, and moves with the model through Sherman-Morrison. But z moves with the motion: beside friction such a derivative to
a stiffness is wrong by half. Of drift and discrepancy they are the directions, and where the fit ends is where they lead. On all
lines they are differences of simulations, too (`Problem.by_simulation`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from cutvib_ss.diagnosis.equivalent_forces import EquivalentForces
from cutvib_ss.diagnosis.form_errors import Form, form_of, scaled
from cutvib_ss.diagnosis.hypothesis import Hypothesis, stages_of
from cutvib_ss.diagnosis.leakage import Leakage, wanders
from cutvib_ss.diagnosis.prediction import Circles, Predicted, Prediction
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import By, Group, Records, merged, site
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulated import Simulated, simulated
from cutvib_ss.diagnosis.unknown_by_level import ByLevelProblem
from cutvib_ss.diagnosis.unknown_element import ByLevel
from cutvib_ss.effects.base import Model
from cutvib_ss.results import ComplexArray, FloatArray


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
                one_blow=True,
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
        in_time = self.by_simulation != "no" and not p.sweeps
        if in_time or (leaking and (p.model.nonlinear or wanders(p.model, p.group))):
            # Neither is a restoring force its equivalent stiffness where blocks leak, nor does a body that wanders off have a pole
            # to leak from. For errors of single parts, which are small and many, that has to do.
            by_simulation += [i for i, _, _ in moves if i not in self.parts.all]
            moves = [move for move in moves if move[0] in self.parts.all]
        out = self._differences(x, by_simulation, p)
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

    def _differences(self, x: FloatArray, which: Sequence[int], p: Simulated) -> dict[int, ComplexArray]:
        """Derivatives to some unknowns by simulation."""
        blows = all(same[0].replay is not None and not same[0].replay.block for same in p.group.entries)
        rounded = blows and (self.by_simulation != "no" or self.hypothesis.touches)
        index, out = self._fitted(p), {}
        # Blows of one record are alike: how one of them changes tells enough of the way.
        one_blow = self.by_simulation != "of all blows"
        scales = None if index is None else self._force_scales(x)[index]
        for i in which:
            moved, step = x.copy(), self._difference(i, rounded)
            moved[i] += step if i < self.n_tuning or x[i] + step <= 1.0 else -step
            there = simulated(
                self.applied(moved), p.group, None, self.steps, scales, self.offset_of(x), one_blow=one_blow
            )
            out[i] = (there.data - (p.typical if one_blow else p.data)) / (moved[i] - x[i])
        return out

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
