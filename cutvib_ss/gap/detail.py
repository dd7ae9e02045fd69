"""What a diagnosis finds beside its verdict, put together."""

from __future__ import annotations

from collections.abc import Sequence

from cutvib_ss.effects.base import Model
from cutvib_ss.gap.bands import bands
from cutvib_ss.gap.findings import Findings
from cutvib_ss.gap.metrics import metrics, scales_of
from cutvib_ss.gap.observations import Observations
from cutvib_ss.gap.place import Located
from cutvib_ss.gap.shrinkage import Judged
from cutvib_ss.gap.winding import nu_gap


def found(
    nominal: Model,
    corrected: Model,
    observed: Observations,
    stand_out: Sequence[tuple[float, float]],
    located: Located,
    before: Sequence[Judged],
    tuned: Sequence[Judged],
    after: Sequence[Judged],
    second: Sequence[Judged] | None,
) -> Findings:
    """
    Distances, bands, places and their free functions.

    Parameters
    ----------
    nominal, corrected : Machine or Structure
        The model as given, and with tuning and cause.
    observed : Observations
        The campaign.
    stand_out : sequence of (float, float)
        Bands in which the re-tuned model's error stands out of the noise [Hz].
    located : Located
        The places.
    before, tuned, after : sequence of Judged
        The same held-out records against the model as given, re-tuned, and with the cause.
    second : sequence of Judged or None
        The same with the second-best cause.

    Returns
    -------
    Findings
        All of it.
    """
    # Where records are marked for checking, the model as given is judged on these alone, as the others are.
    scales = scales_of(before)
    rows = metrics(before, tuned, after, second, observed.per_unit, scales)
    return Findings(
        metrics=rows,
        nu_gap=nu_gap(rows, scales, nominal, corrected, observed.band),
        bands=bands(stand_out, observed.band, before, tuned, after, second, observed.per_unit),
        place_scores=located.scores,
        stiffness=located.stiffness,
    )
