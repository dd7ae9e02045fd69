"""What a diagnosis finds beside its verdict: distances, bands, the free dynamic stiffness at the place, and what all that means."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from cutvib_ss.diagnosis.consequence_result import Consequences
from cutvib_ss.results import ComplexArray, FloatArray


@dataclass(frozen=True)
class Distances:
    """How far a model is from a measured response."""

    mean_modulus: float  # Mean of |ΔH| over the band, in the gap's unit (the metric of the paper's Table 4)
    frac: float  # Frequency response assurance criterion: 1 where the two are proportional
    log_error_db: float  # Mean of |20 lg |H_model / H_measured|| [dB]
    # Largest chordal distance of the scaled responses over the band, 0 to 1; root mean square over a few lines, noise
    # taken out
    nu_gap: float


@dataclass(frozen=True)
class Metric:
    """Distances at one record and channel."""

    position: float | None  # y_b / L
    level: float | None  # Peak force [N]
    channel: str  # Channel; ``"all"`` takes the channels as one response with several outputs
    before: Distances  # Model as given
    tuned: Distances  # Re-tuned
    after: Distances  # With the cause, fitted on other records
    second: Distances | None  # The same with the second-best cause
    noise_modulus: float  # Of noise alone: its mean modulus, and the distance that it exceeds in one of twenty records
    noise_nu_gap: float
    input: str | None = None  # Where the record's force acted; None at the model's input


@dataclass(frozen=True)
class Correlation:
    """FRAC of one channel at one position: 1 where measured and computed response are proportional."""

    position: float | None  # y_b / L
    input: str | None  # Where the force acted; None at the model's input
    channel: str
    before: float  # Model as given, re-tuned, and with the cause
    tuned: float
    after: float


@dataclass(frozen=True)
class ModePair:
    """A mode of the corrected model, and the mode of the nominal one that it continues; None where there is none."""

    position: float | None  # y_b / L
    nominal_hz: float | None  # Undamped natural frequencies [Hz]
    corrected_hz: float
    nominal_damping: float | None  # Damping ratios
    corrected_damping: float
    mac: float | None  # Modal assurance criterion of their shapes at the model's points


@dataclass(frozen=True)
class ChannelGap:
    """The ν-gap of one channel."""

    channel: str  # Channel; ``"all"`` takes the channels as one response with several outputs
    # What its response was divided by [SI]: the nominal model's root mean square over records and band, unless given;
    # None for all
    scale: float | None
    # Largest distance of the measurement from each model over positions, at each the record of least noise
    before: float
    tuned: float
    after: float
    noise: float  # What noise alone would show
    models: float  # The largest between the nominal and the corrected model at these positions: without noise


@dataclass(frozen=True)
class NuGap:
    """Whether a controller that is designed on the model would notice."""

    channels: tuple[ChannelGap, ...]  # By channel, and all together where there are several
    # ``"holds"``, ``"fails"`` or ``"not checked"``: the winding condition between the nominal and the corrected model
    winding: str
    why: str  # Where it fails, or why it cannot be checked


@dataclass(frozen=True)
class Band:
    """The error in one band of frequency."""

    low: float  # The band [Hz]
    high: float
    before: float  # Mean modulus of the error over records and channels, in the gap's unit
    tuned: float
    after: float
    noise: float
    second: float  # The same with the second-best cause; NaN where there is none
    # Whether the re-tuned model's error stands out of the noise here; else the band is one of those between
    stands_out: bool
    # Position y_b / L and the centre of the error's excess over the noise there [Hz]
    centres: tuple[tuple[float, float], ...]
    moves_with_position: bool  # Whether that centre moves by more than it is uncertain
    moves_with_level: bool
    # Part of the error's power that records of one position share, noise taken out: 1 for an error that repeats
    # whatever the level; NaN with one record a position
    coherence: float


@dataclass(frozen=True)
class ElementType:
    """A law that the shape of an unknown dynamic stiffness suggests."""

    name: str  # For instance ``"mass"``, ``"spring and damper"``, ``"sprung mass"``
    law: str  # As a formula
    parameters: dict[str, float]  # Its values [SI]
    share: float  # Part of the function's weighted squares that it explains


@dataclass(frozen=True)
class DynamicStiffness:
    """One unknown dynamic stiffness z(ω) at a place: what the records ask for there, whatever its form."""

    place: str  # Where, in which way, and which function of that
    variant: str
    label: str
    quantity: str  # What it is (a dynamic stiffness, a compliance, a gain), and its unit
    unit: str
    shape: float | None  # The one value fitted beside it (where on the rail, how eccentric), where there is one
    freq: FloatArray  # Frequency [Hz]
    levels: tuple[float | None, ...]  # Level of each row: peak force [N]; one None where all levels share the function
    value: ComplexArray  # The function
    std: FloatArray  # Standard deviation of its real and of its imaginary part, from the curvature at each line
    element_type: ElementType | None = None  # The law that its shape suggests; None where none of those known is close
    with_level: str = ""  # How it changes with the level, in words; empty where it does not

    def to_dict(self) -> dict[str, Any]:
        """As plain data."""
        rows = [
            {"level": level, "real": z.real.tolist(), "imag": z.imag.tolist(), "std": s.tolist()}
            for level, z, s in zip(self.levels, self.value, self.std, strict=True)
        ]
        return {
            "place": self.place,
            "variant": self.variant,
            "function": self.label,
            "quantity": self.quantity,
            "unit": self.unit,
            "shape": self.shape,
            "freq_hz": self.freq.tolist(),
            "rows": rows,
            "element_type": None if self.element_type is None else asdict(self.element_type),
            "with_level": self.with_level,
        }


@dataclass(frozen=True)
class PlaceScore:
    """Residual with unknown dynamic stiffnesses at a place."""

    place: str  # Where, and the way of being at fault that leaves least
    variant: str
    # Square of the error over noise and model error, at the median line: of positions that the functions were not
    # fitted to; of all records where each has functions of its own
    left: float
    probability: float  # Among the places, from the residual alone


@dataclass(frozen=True)
class Findings:
    """All of it."""

    metrics: tuple[Metric, ...] = ()  # Distances by record and channel
    nu_gap: NuGap | None = None  # Whether a controller would notice
    bands: tuple[Band, ...] = ()  # The error by bands
    # Residual with unknown dynamic stiffnesses at each place, best first; empty where the residual is noise
    place_scores: tuple[PlaceScore, ...] = ()
    stiffness: tuple[DynamicStiffness, ...] = ()  # The unknown dynamic stiffnesses at the likeliest places
    consequences: Consequences | None = field(default=None)  # What it means
    frac: tuple[Correlation, ...] = ()  # FRAC by channel and position
    modes: tuple[ModePair, ...] = ()  # Modes of the nominal and the corrected model

    def where(self) -> dict[str, Any]:
        """What belongs under ``where`` in the JSON."""
        return {
            "metrics": [asdict(m) for m in self.metrics],
            "nu_gap": None if self.nu_gap is None else asdict(self.nu_gap),
            "bands": [asdict(b) for b in self.bands],
            "place_scores": [asdict(p) for p in self.place_scores],
            "dynamic_stiffness": [z.to_dict() for z in self.stiffness],
            "frac": [asdict(c) for c in self.frac],
            "modes": [asdict(m) for m in self.modes],
        }

    def means(self) -> dict[str, Any] | None:
        """What belongs under ``consequences`` in the JSON."""
        return None if self.consequences is None else asdict(self.consequences)
