"""The answer as the user reads it: rows of causes, places, and figures of the gap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from cutvib_ss.diagnosis.cross_validation import Judged, mean_error, shrinkage_interval
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.held_out import HeldOut, share
from cutvib_ss.diagnosis.hit_errors import SET_UPS
from cutvib_ss.diagnosis.metrics import Sides
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.result import Cause, FittedParameter, GapFigures, Verdict
from cutvib_ss.effects.base import parameter_fields


@dataclass(frozen=True)
class Shown:
    """The likeliest hypothesis and its rivals on held-out records."""

    none: Ranked  # The re-tuned nominal model
    causes: tuple[Ranked, ...]  # All others, the likeliest first
    first: Ranked  # The answer
    second: Ranked | None  # What it is worth is seen against this one
    before: tuple[Judged, ...]  # The model as given on held-out records
    held: Mapping[str, HeldOut]  # Hypotheses on them by name: the two above and the re-tuned model, at least

    @property
    def tuned(self) -> HeldOut:
        """The re-tuned model on held-out records."""
        return self.held[self.none.name]

    @property
    def after(self) -> HeldOut:
        """The answer on held-out records."""
        return self.held[self.first.name]

    @property
    def sides(self) -> Sides:
        """All of these side by side."""
        second = None if self.second is None else self.held[self.second.name].records
        return Sides(self.before, self.tuned.records, self.after.records, second)


def causes(
    shown: Shown, odds: Mapping[str, float], hidden: Mapping[tuple[str, str], float], rest: Cause, per_unit: float
) -> tuple[Cause, ...]:
    """All hypotheses as rows, variants of one cause together, with what is hidden of them; and "unknown", with the rest."""
    start = mean_error(shown.before)
    rows: dict[tuple[str, str], Cause] = {}
    for r in (shown.none, *shown.causes):
        key = (r.fit.hypothesis.effect, r.fit.hypothesis.place)
        if key in rows:
            # A variant (another channel, another parameter) of a cause that stands there with its best one.
            rows[key] = replace(rows[key], probability=rows[key].probability + odds[r.name])
            continue
        held = shown.held.get(r.name)
        after = float("nan") if held is None else mean_error(held.records)
        rows[key] = Cause(
            effect=key[0],
            place=key[1],
            probability=odds[r.name],
            parameters=_parameters(r.fit.corrected),
            after=after / per_unit,
            shrinkage=1.0 - after / start,
            reduced_chi2=float("nan") if held is None else held.reduced,
            share=float("nan") if key[0] in ("none", "unknown") else share(shown.tuned, held, shown.after),
        )
    for (effect, place), p in hidden.items():
        own = rows.get((effect, place)) or Cause(effect, place, 0.0)
        rows[effect, place] = replace(own, probability=own.probability + p)
    unknown = [c for c in rows.values() if c.effect == "unknown"]
    # One row for an unknown element, at the place where it is likeliest; what no hypothesis holds is unknown too.
    unknown.append(rest)
    best = max(unknown, key=lambda c: c.probability)
    out = [c for c in rows.values() if c.effect != "unknown"]
    out.append(replace(best, probability=sum(c.probability for c in unknown), parameters={}))
    return tuple(sorted(out, key=lambda c: -c.probability))


def _parameters(fit: Fit) -> dict[str, FittedParameter]:
    out: dict[str, FittedParameter] = {}
    causes = fit.hypothesis.causes
    for k, e in enumerate(fit.hypothesis.effects):
        if e.effect == "unknown":
            # Coefficients of a smooth function say nothing one by one.
            continue
        units = e.units(fit.model)
        before = [x for x in fit.hypothesis.effects[:k] if (x.effect, x.place) == (e.effect, e.place)]
        again = f"_{len(before) + 1}" if before else ""
        for f in parameter_fields(type(e)):
            if f"{k}.{f.name}" not in fit.stds:
                continue
            name = (f.name if len(causes) == 1 else f"{e.effect}.{f.name}") + again
            out[name] = FittedParameter(float(getattr(e, f.name)), float(fit.stds[f"{k}.{f.name}"]), units[f.name])
        continuous = {f.name for f in parameter_fields(type(e))}
        for f in fields(e):
            if f.name not in continuous | {"place"} and getattr(e, f.name) is not False:
                out[f.name + again] = FittedParameter(getattr(e, f.name), 0.0, f.metadata.get("unit", ""))
    return out


def figures(observed: Observations, shown: Shown, verdict: Verdict, seed: int) -> GapFigures:
    """How far the gap shrinks."""
    unit, after = observed.per_unit, shown.tuned if verdict == "no_gap" else shown.after
    start, end = mean_error(shown.before), mean_error(after.records)
    return GapFigures(
        unit=observed.unit,
        before=start / unit,
        tuned=mean_error(shown.tuned.records) / unit,
        after=end / unit,
        noise_floor=float(np.mean([j.noise.mean() for j in shown.before])) / unit,
        band_hz=observed.band,
        shrinkage=1.0 - end / start,
        shrinkage_interval=shrinkage_interval(shown.before, after.records, seed),
    )


def places(
    ranked: Sequence[Ranked], odds: Mapping[str, float], hidden: Mapping[tuple[str, str], float], rest: Cause
) -> tuple[tuple[str, float], ...]:
    """Probability of each place, or places of a sum: that of the hypotheses there, and of what none of them holds."""
    total: dict[str, float] = {"none": odds["none"]}
    for r in ranked[1:]:
        place = r.fit.hypothesis.places
        total[place] = total.get(place, 0.0) + odds[r.name]
    for (_, place), p in hidden.items():
        total[place] = total.get(place, 0.0) + p
    total[rest.place] = total.get(rest.place, 0.0) + rest.probability
    return tuple(sorted(total.items(), key=lambda item: -item[1]))


def sizes(chosen: Fit) -> dict[str, float]:
    """Sizes in the likelihood of a fit, of what there is: records that were followed, parts that may err."""
    lay = chosen.spread.layout
    absent = {"within": not lay.records, "parts": not lay.parts.matrices, "losses": not lay.parts.losses}
    absent["flexibility"] = not lay.residual_modes
    absent |= {kind: not any(hit[0] == kind for hit in lay.hits) for kind in SET_UPS}
    return {name: v for name, v in vars(chosen.spread.sizes).items() if not absent.get(name)}
