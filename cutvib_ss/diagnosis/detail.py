"""What a diagnosis finds beside its verdict, put together."""

from __future__ import annotations

from collections.abc import Sequence

from cutvib_ss.diagnosis.bands import bands
from cutvib_ss.diagnosis.consequences import consequences
from cutvib_ss.diagnosis.correlation import correlations, mode_pairs
from cutvib_ss.diagnosis.findings import Findings
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.metrics import Sides, metrics, scales_of
from cutvib_ss.diagnosis.nu_gap import nu_gap
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.place import Located
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.result import Verdict
from cutvib_ss.effects.base import Model


def found(
    nominal: Model,
    chosen: Fit,
    records: Records,
    verdict: Verdict,
    observed: Observations,
    stand_out: Sequence[tuple[float, float]],
    located: Located,
    sides: Sides,
    seed: int,
) -> Findings:
    """Distances, bands, places and their unknown dynamic stiffnesses."""
    # Where records are marked for checking, the model as given is judged on these alone, as the others are.
    scales = scales_of(sides.before)
    rows = metrics(sides, observed.per_unit, scales)
    return Findings(
        metrics=rows,
        nu_gap=nu_gap(rows, scales, nominal, chosen.model, observed.band),
        bands=bands(stand_out, observed.band, sides, observed.per_unit),
        place_scores=located.scores,
        stiffness=located.stiffness,
        frac=correlations(sides),
        modes=mode_pairs(nominal, chosen.model, _some(records), observed.band),
        consequences=consequences(nominal, chosen, records, observed, verdict, seed),
    )


def _some(records: Records) -> tuple[float | None, ...]:
    """The first, middle and last measured position; None of a structure."""
    places = sorted({e.position for e in records.entries if e.position is not None})
    if not places:
        return (None,)
    return tuple(dict.fromkeys((places[0], places[len(places) // 2], places[-1])))
