"""A hypothesis on the records that its fits have not seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutvib_ss.diagnosis.cross_validation import Judged, reduced_chi2
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.settings import SETTINGS


@dataclass(frozen=True)
class HeldOut:
    """A hypothesis and what it leaves of held-out records."""

    ranked: Ranked
    records: tuple[Judged, ...]
    unseen: bool = True  # Whether the records were held out; else they were fitted too, for want of others

    @property
    def reduced(self) -> float:
        """χ² per datum."""
        return reduced_chi2(self.records)

    @property
    def against_stated(self) -> float:
        """The same against the noise as stated, where its histories were seen to scatter."""
        # What repeats alike in every blow, as a converter's steps do, no coherence tells.
        known = all(j.entry.estimator.scatter_seen and j.entry.estimator.kind for j in self.records)
        return self.reduced * (self.ranked.fit.spread.noise if known else 1.0)

    @property
    def log_density(self) -> float:
        """Log predictive density of all records."""
        return float(np.sum([j.log_density for j in self.records]))

    @property
    def squares(self) -> float:
        """Mean square of the error."""
        return float(np.mean([j.squares for j in self.records]))

    @property
    def floor(self) -> float:
        """Mean square that noise and drift leave of a right model."""
        return float(np.mean([j.floor for j in self.records]))


def share(tuned: HeldOut | None, after: HeldOut | None, accepted: HeldOut) -> float:
    """
    Part of the excess over noise and repeatability that a cause closes on held-out records.

    Their floor is that under the accepted answer: the fit of a poor cause takes its own misfit for noise and drift. Where that
    leaves no more than noise, it is the noise as it was drawn: its mean on a few lines without a force may outweigh the gap.
    """
    if tuned is None or after is None:
        return float("nan")
    start, end = tuned.squares, after.squares
    noise = accepted.reduced <= SETTINGS.verdict_noise
    floor = min(start, accepted.squares if noise else min(after.floor, accepted.floor))
    return float(np.clip((start - end) / max(start - floor, 1e-300), 0.0, 1.0)) if start > end else 0.0
