"""What a diagnosis says: the user's three questions, in the shape of the JSON that outside programs read."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from cutvib_ss.diagnosis.findings import Findings
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.results import FrequencyResponse, MeasuredFrequencyResponse
from cutvib_ss.results.display import Drawn, Table, finite, optional

SCHEMA = "cutvib-diagnosis/1"
Verdict: TypeAlias = Literal["no_gap", "explained", "partly_explained", "ambiguous", "unknown"]


@dataclass(frozen=True)
class GapFigures:
    """How far: mean modulus of the error on held-out records, over channels and bins of a band."""

    unit: str  # ``"g/N"``, or the channel's own
    before: float  # Nominal model as given
    tuned: float  # Re-tuned within tolerance
    after: float  # With the cause added
    noise_floor: float  # Estimator noise alone
    band_hz: tuple[float, float]  # The band [Hz]
    shrinkage: float  # 1 - after/before
    shrinkage_interval: tuple[float, float]  # 95 % interval, by bootstrap over records


@dataclass(frozen=True)
class ErrorFigure:
    """Error and noise at one position or channel."""

    label: float | str | None  # Position y_b / L, or name of the channel
    error: float  # Mean modulus of the re-tuned nominal model's error, and that of noise alone, in the gap's unit
    noise: float
    floor: float | None = (
        None  # What noise and drift between sessions leave of a right model; None where that is not known
    )


@dataclass(frozen=True)
class Where:
    """Where the gap lies."""

    place: str  # Most probable place; ``"none"`` without a gap
    places: tuple[tuple[str, float], ...]  # Places with their probabilities, most probable first
    bands_hz: tuple[tuple[float, float], ...]  # Bands in which the error stands out of the noise [Hz]
    by_position: tuple[ErrorFigure, ...]  # The error over positions and channels
    by_channel: tuple[ErrorFigure, ...]
    level_dependent: bool  # Whether the response changes with the excitation level
    place_set: tuple[str, ...] = ()  # The smallest set of places that carries 0.95


@dataclass(frozen=True)
class Limit:
    """How much of a cause that was not named the data still allow."""

    effect: str  # The cause, the parameter that states its size, and its SI unit
    place: str
    parameter: str
    unit: str
    # 95 % bound of its size beside the accepted answer; of a compliance the lowest stiffness, of a signed value a pair
    allowed: float | tuple[float, float]
    visible: float  # Size at which it would be named with 0.9 in half of repetitions


@dataclass(frozen=True)
class FittedParameter:
    """A fitted parameter."""

    value: float | str  # Estimate, SI; for what is discrete about a cause, its name
    std: float  # Standard deviation, tuning and calibration included
    unit: str  # SI unit


@dataclass(frozen=True)
class Cause:
    """One hypothesis, fitted and judged."""

    effect: str  # Ids of the catalogue; ``"none"`` and ``"unknown"`` are hypotheses too
    place: str
    probability: float  # Probability, all causes together 1
    parameters: dict[str, FittedParameter] = field(default_factory=dict)  # What was fitted
    after: float = math.nan  # Error left on held-out records, and 1 - after/before
    shrinkage: float = math.nan
    reduced_chi2: float = math.nan  # χ² a degree of freedom on held-out records
    # Part of the excess over noise and repeatability that it closes on held-out records; NaN for none and unknown
    share: float = math.nan


@dataclass(frozen=True)
class CandidateEvidence:
    """What one fit says, before it becomes a probability."""

    name: str  # The candidate; a cause may have several, which differ in what is discrete about it
    effect: str  # Ids of the catalogue; ``"none"`` for the re-tuned model
    place: str
    parameters: dict[str, str]  # What is discrete about it
    log_evidence: float  # Up to a constant that all share
    # χ² that it leaves of all data, the scatter of levels about their mean put aside; NaN where it was only tried on
    # few lines
    chi2: float
    unknowns: int  # Parameters of its own, tuning and calibration apart
    judged: bool  # Whether it was judged on held-out records
    held_reduced_chi2: float  # χ² a degree of freedom there
    # Log predictive density there, up to a constant of the data: what prediction says where evidence may err (stacking)
    held_log_density: float = float("nan")


@dataclass(frozen=True)
class NextTest:
    """The record that would best tell the remaining causes apart."""

    why: str  # What it would tell apart
    position: float | None  # y_b / L
    peak_force: float | None  # Level [N]
    channel: str  # Channel to look at


@dataclass(frozen=True)
class Comparison:
    """Measured against computed at one position and level, for pictures."""

    label: str  # Which record
    measured: MeasuredFrequencyResponse  # The measurement
    # The model as given, re-tuned, and with the cause; each through the same estimator as the measurement
    nominal: FrequencyResponse
    tuned: FrequencyResponse
    corrected: FrequencyResponse


@dataclass(frozen=True, repr=False)
class Diagnosis(Drawn):
    """
    A diagnosis of the sim-to-real gap.

    Parameters
    ----------
    verdict : {"no_gap", "explained", "ambiguous", "unknown"}
        What may be concluded.
    gap : GapFigures
        How far.
    where : Where
        Where.
    causes : tuple of Cause
        Which, most probable first.
    ambiguity_set : tuple of int
        Indices into ``causes``: the smallest set that carries 0.95.
    next_test : NextTest or None
        What to measure next, if ambiguous.
    title : str
        Title of the campaign.
    warnings : tuple of str
        What was found in the measurement.
    nominal, corrected_machine : Machine or Structure
        The model as given, and with tuning and effect.
    comparisons : tuple of Comparison
        For pictures.
    evidence : tuple of CandidateEvidence
        What the probabilities were made of.
    reduced_chi2 : float
        χ² a degree of freedom that the candidate of most evidence leaves of what it was fitted to.
    data_count : int
        Real data that the candidates were fitted to.
    findings : Findings
        What was found beside: distances, bands, the free dynamic stiffness at the place, and what it means.
    limits : tuple of Limit
        Of causes not named, each added to the accepted answer.
    repeatability : float
        rms(H_a - H_b) beyond noise over √2 rms(H), of records of the same thing; NaN where none repeat.
    sizes : mapping of str to float
        Of the accepted answer: ``drift`` between sessions, ``within`` them where their records differ, discrepancy of the
        ``nominal`` elements and of the ``cause`` (relative standard deviations), and the factor on the variance of the
        ``noise``; errors of the ``losses`` of single modes, of single ``parts`` of a structure and frequencies of the rail (in
        tolerances), and the ``flexibility`` of modes that a structure leaves out, of what the ports' masses give way at their
        frequencies; set-up errors of the head's position, ``placing`` (in mm), and of
        the force's tilt and offset, ``aim`` (in 0.01 rad and mm).
    """

    verdict: Verdict
    gap: GapFigures
    where: Where
    causes: tuple[Cause, ...]
    ambiguity_set: tuple[int, ...]
    next_test: NextTest | None
    title: str
    warnings: tuple[str, ...]
    nominal: Model
    corrected_machine: Model
    comparisons: tuple[Comparison, ...] = ()
    evidence: tuple[CandidateEvidence, ...] = ()
    reduced_chi2: float = math.nan
    data_count: int = 0
    findings: Findings = field(default_factory=Findings)
    limits: tuple[Limit, ...] = ()
    repeatability: float = math.nan
    sizes: Mapping[str, float] = field(default_factory=dict)

    def _table(self) -> Table:
        g, rows = self.gap, []
        for cause in self.causes:
            values = [
                f"{name} = {p.value if isinstance(p.value, str) else f'{p.value:.4g}'} {p.unit}".rstrip()
                for name, p in cause.parameters.items()
            ]
            rows.append((cause.effect, cause.place, f"{cause.probability:.3f}", ", ".join(values)))
        title = (
            f"Diagnosis: {self.verdict}; gap {g.before:.3g}, tuned {g.tuned:.3g}, after {g.after:.3g}, "
            f"noise floor {g.noise_floor:.3g} {g.unit}"
        )
        return Table(title, ("cause", "place", "probability", "parameters"), rows)

    def to_dict(self) -> dict[str, Any]:
        """
        The diagnosis as plain data; what is not finite becomes None.

        Returns
        -------
        dict
            In the shape of the schema ``cutvib-diagnosis/1``.
        """
        g, w = self.gap, self.where
        data = {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "gap": {
                "unit": g.unit,
                "before": g.before,
                "tuned": g.tuned,
                "after": g.after,
                "noise_floor": g.noise_floor,
                "band_hz": list(g.band_hz),
                "shrinkage": g.shrinkage,
                "shrinkage_interval": list(g.shrinkage_interval),
            },
            "where": {
                "place": w.place,
                "place_set": list(w.place_set),
                "places": [{"place": p, "probability": q} for p, q in w.places],
                "bands_hz": [list(b) for b in w.bands_hz],
                "by_position": [
                    {"position": f.label, "error": f.error, "noise": f.noise, "floor": f.floor} for f in w.by_position
                ],
                "by_channel": [
                    {"channel": f.label, "error": f.error, "noise": f.noise, "floor": f.floor} for f in w.by_channel
                ],
                "level_dependent": w.level_dependent,
                **self.findings.where(),
            },
            "causes": [
                {
                    "effect": c.effect,
                    "place": c.place,
                    "probability": c.probability,
                    "parameters": {
                        n: {"value": p.value, "std": p.std, "unit": p.unit} for n, p in c.parameters.items()
                    },
                    "after": c.after,
                    "shrinkage": c.shrinkage,
                    "reduced_chi2": c.reduced_chi2,
                    "share": c.share,
                }
                for c in self.causes
            ],
            "limits": [dict(vars(x)) for x in self.limits],
            "repeatability": self.repeatability,
            "priors": dict(SETTINGS.priors),
            "likelihood": dict(self.sizes),
            "ambiguity_set": list(self.ambiguity_set),
            "next_test": None if self.next_test is None else dict(vars(self.next_test)),
            "consequences": self.findings.means(),
            "title": self.title,
            "warnings": list(self.warnings),
            "evidence": {
                "reduced_chi2": self.reduced_chi2,
                "data": self.data_count,
                "candidates": [dict(vars(e)) for e in self.evidence],
            },
        }
        cleaned: dict[str, Any] = finite(data)
        return cleaned

    def to_dataframe(self) -> Any:
        """
        The causes as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each cause and parameter: effect, place, probability; parameter, value, std, unit.
        """
        rows = [
            (c.effect, c.place, c.probability, n, p.value, p.std, p.unit)
            for c in self.causes
            for n, p in (c.parameters or {"": FittedParameter("", math.nan, "")}).items()
        ]
        columns = ["effect", "place", "probability", "parameter", "value", "std", "unit"]
        return optional("pandas", "to_dataframe").DataFrame(rows, columns=columns)

    def to_json(self) -> str:
        """
        The diagnosis as JSON text, without NaN or Infinity.

        Returns
        -------
        str
            Indented JSON of the schema ``cutvib-diagnosis/1``.
        """
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False)
