"""Every number of judgement of the diagnosis; shown in `docs/settings.md`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cutvib_ss.diagnosis.settings.concluding import AnswerSettings
from cutvib_ss.diagnosis.settings.field import Weighted
from cutvib_ss.diagnosis.settings.fitting import FitSettings
from cutvib_ss.diagnosis.settings.searching import SearchSettings


@dataclass(frozen=True, kw_only=True)
class Settings(AnswerSettings, SearchSettings, FitSettings):
    """Numbers of judgement of the diagnosis, in the order in which a diagnosis comes to them."""

    @property
    def sizes(self) -> Mapping[str, Weighted]:
        """Priors of the likelihood's sizes, by the names of `likelihood.Sizes`."""
        return {
            "drift": self.likelihood_drift_sizes,
            "nominal": self.likelihood_nominal_sizes,
            "cause": self.likelihood_cause_sizes,
            "noise": self.likelihood_noise_factors,
            "within": self.likelihood_within_sizes,
            "parts": self.likelihood_parts_sizes,
            "losses": self.likelihood_losses_sizes,
            "flexibility": self.likelihood_flexibility_sizes,
            "aim": self.likelihood_set_up_sizes,
            "placing": self.likelihood_set_up_sizes,
        }

    @property
    def priors(self) -> Mapping[str, float]:
        """Prior of each kind of hypothesis."""
        return {
            "none": self.prior_none,
            "known": self.prior_known,
            "unknown": self.prior_unknown,
            "sums": self.prior_sums,
        }


SETTINGS = Settings()
"""The numbers that the diagnosis uses."""
