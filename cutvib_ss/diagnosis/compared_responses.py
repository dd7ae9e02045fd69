"""Measured responses beside those of the nominal, the re-tuned and the corrected model, for the report."""

from __future__ import annotations

from collections.abc import Sequence

from cutvib_ss.diagnosis import cross_validation
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Entry, Records, measured_at, merged
from cutvib_ss.diagnosis.result import Comparison
from cutvib_ss.diagnosis.simulation import unforced_problem
from cutvib_ss.diagnosis.unknown_by_level import ByLevelProblem
from cutvib_ss.effects.base import Model
from cutvib_ss.measurement.records import FORCE


def _alike(e: Entry, apart: bool) -> tuple[object, ...]:
    """What records share that one curve of a model stands for: of a restoring force that depends on the level, the level too."""
    level = e.record if e.level is None else e.level
    return (*measured_at(e), level) if apart else measured_at(e)


def compared_responses(nominal: Model, none: Fit, chosen: Fit, entries: Sequence[Entry]) -> tuple[Comparison, ...]:
    """One comparison a position, input and, of a restoring force that depends on it, level."""
    groups = merged(entries)
    out = []
    start = Problem(nominal, groups, Hypothesis())
    end = unforced_problem(nominal, Records(tuple(entries)), chosen.hypothesis)
    sides = [
        (nominal, start.blow_at(none.x), None, None),
        (none.model, start.blow_at(none.x), start, none.x),
        (chosen.model, end.blow_at(chosen.x), end, chosen.x),
    ]
    seen: set[tuple[object, ...]] = set()
    apart = not chosen.hypothesis.linear
    for e in entries:
        here = _alike(e, apart)
        if here in seen:
            continue
        seen.add(here)
        same = [x for x in entries if _alike(x, apart) == here and x.channels == e.channels]
        measured = merged(same)[0].entry(0).response
        computed = []
        for model, blow_at, problem, x in sides:
            if isinstance(problem, ByLevelProblem) and x is not None:
                model = problem.model_of(x, merged(same[:1])[0])
            shown = cross_validation.predicted(same[0], model, blow_at, problem, x).data
            computed.append(measured.computed(shown[None, :, None]))
        unit = "N" if nominal.input_quantity == "force" else "m/s^2"
        told = [
            "" if e.position is None else f"position {e.position:.3g}",
            f"{e.level:.3g} {unit}" if apart and e.level is not None else "",
            "" if e.input == FORCE else f"force at {e.input}",
        ]
        label = ", ".join(part for part in told if part)
        out.append(Comparison(label, measured, *computed))
    return tuple(out)
