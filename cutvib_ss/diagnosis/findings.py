"""What a diagnosis finds beside its verdict: distances, bands, the free dynamic stiffness at the place, and what all that means."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from cutvib_ss.diagnosis.consequence_result import Consequences
from cutvib_ss.results import ComplexArray, FloatArray


@dataclass(frozen=True)
class Distances:
    """
    How far a model is from a measured response.

    Parameters
    ----------
    mean_modulus : float
        Mean of |ΔH| over the band, in the gap's unit (the metric of the paper's Table 4).
    frac : float
        Frequency response assurance criterion: 1 where the two are proportional.
    log_error_db : float
        Mean of |20 lg |H_model / H_measured|| [dB].
    nu_gap : float
        Largest chordal distance of the scaled responses over the band, 0 to 1; root mean square over a few lines, noise taken out.
    """

    mean_modulus: float
    frac: float
    log_error_db: float
    nu_gap: float


@dataclass(frozen=True)
class Metric:
    """
    Distances at one record and channel.

    Parameters
    ----------
    position : float or None
        y_b / L.
    level : float or None
        Peak force [N].
    channel : str
        Channel; ``"all"`` takes the channels as one response with several outputs.
    before, tuned, after : Distances
        Model as given; re-tuned; with the cause, fitted on other records.
    second : Distances or None
        The same with the second-best cause.
    noise_modulus, noise_nu_gap : float
        Of noise alone: its mean modulus, and the distance that it exceeds in one of twenty records.
    """

    position: float | None
    level: float | None
    channel: str
    before: Distances
    tuned: Distances
    after: Distances
    second: Distances | None
    noise_modulus: float
    noise_nu_gap: float


@dataclass(frozen=True)
class ChannelGap:
    """
    The ν-gap of one channel.

    Parameters
    ----------
    channel : str
        Channel; ``"all"`` takes the channels as one response with several outputs.
    scale : float or None
        What its response was divided by [SI]: the nominal model's root mean square over records and band, unless given; None for
        all.
    before, tuned, after : float
        Largest distance of the measurement from each model over positions, at each the record of least noise.
    noise : float
        What noise alone would show.
    models : float
        The largest between the nominal and the corrected model at these positions: without noise.
    """

    channel: str
    scale: float | None
    before: float
    tuned: float
    after: float
    noise: float
    models: float


@dataclass(frozen=True)
class NuGap:
    """
    Whether a controller that is designed on the model would notice.

    Parameters
    ----------
    channels : tuple of ChannelGap
        By channel, and all together where there are several.
    winding : str
        ``"holds"``, ``"fails"`` or ``"not checked"``: the winding condition between the nominal and the corrected model.
    why : str
        Where it fails, or why it cannot be checked.
    """

    channels: tuple[ChannelGap, ...]
    winding: str
    why: str


@dataclass(frozen=True)
class Band:
    """
    The error in one band of frequency.

    Parameters
    ----------
    low, high : float
        The band [Hz].
    before, tuned, after, noise : float
        Mean modulus of the error over records and channels, in the gap's unit.
    second : float
        The same with the second-best cause; NaN where there is none.
    stands_out : bool
        Whether the re-tuned model's error stands out of the noise here; else the band is one of those between.
    centres : tuple of (float, float)
        Position y_b / L and the centre of the error's excess over the noise there [Hz].
    moves_with_position, moves_with_level : bool
        Whether that centre moves by more than it is uncertain.
    coherence : float
        Part of the error's power that records of one position share, noise taken out: 1 for an error that repeats whatever the
        level; NaN with one record a position.
    """

    low: float
    high: float
    before: float
    tuned: float
    after: float
    noise: float
    second: float
    stands_out: bool
    centres: tuple[tuple[float, float], ...]
    moves_with_position: bool
    moves_with_level: bool
    coherence: float


@dataclass(frozen=True)
class ElementType:
    """
    A law that the shape of an unknown dynamic stiffness suggests.

    Parameters
    ----------
    name : str
        For instance ``"mass"``, ``"spring and damper"``, ``"sprung mass"``.
    law : str
        As a formula.
    parameters : dict of str to float
        Its values [SI].
    share : float
        Part of the function's weighted squares that it explains.
    """

    name: str
    law: str
    parameters: dict[str, float]
    share: float


@dataclass(frozen=True)
class DynamicStiffness:
    """
    One unknown dynamic stiffness z(ω) at a place: what the records ask for there, whatever its law.

    Parameters
    ----------
    place, variant, label : str
        Where, in which way, and which function of that.
    quantity, unit : str
        What it is (a dynamic stiffness, a compliance, a gain), and its unit.
    shape : float or None
        The one value fitted beside it (where on the rail, how eccentric), where there is one.
    freq : ndarray, shape (frequency,)
        Frequency [Hz].
    levels : tuple of float or None
        Level of each row: peak force [N]; one None where all levels share the function.
    value : ndarray of complex, shape (level, frequency)
        The function.
    std : ndarray, shape (level, frequency)
        Standard deviation of its real and of its imaginary part, from the curvature at each line.
    element_type : ElementType or None
        The law that its shape suggests; None where none of those known is close.
    with_level : str
        How it changes with the level, in words; empty where it does not.
    """

    place: str
    variant: str
    label: str
    quantity: str
    unit: str
    shape: float | None
    freq: FloatArray
    levels: tuple[float | None, ...]
    value: ComplexArray
    std: FloatArray
    element_type: ElementType | None = None
    with_level: str = ""

    def to_dict(self) -> dict[str, Any]:
        """
        As plain data.

        Returns
        -------
        dict
            Frequencies, and a row of real parts, imaginary parts and standard deviations for each level.
        """
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
    """
    Residual with unknown dynamic stiffnesses at a place.

    Parameters
    ----------
    place, variant : str
        Where, and the way of being at fault that leaves least.
    left : float
        Square of the error over noise and model error, at the median line: of positions that the functions were not fitted to; of
        all records where each has functions of its own.
    probability : float
        Among the places, from what is left alone.
    """

    place: str
    variant: str
    left: float
    probability: float


@dataclass(frozen=True)
class Findings:
    """
    All of it.

    Parameters
    ----------
    metrics : tuple of Metric
        Distances by record and channel.
    nu_gap : NuGap or None
        Whether a controller would notice.
    bands : tuple of Band
        The error by bands.
    place_scores : tuple of PlaceScore
        Residual with unknown dynamic stiffnesses at each place, best first; empty where the residual is noise.
    stiffness : tuple of DynamicStiffness
        The unknown dynamic stiffnesses at the likeliest places.
    consequences : Consequences or None
        What it means.
    """

    metrics: tuple[Metric, ...] = ()
    nu_gap: NuGap | None = None
    bands: tuple[Band, ...] = ()
    place_scores: tuple[PlaceScore, ...] = ()
    stiffness: tuple[DynamicStiffness, ...] = ()
    consequences: Consequences | None = field(default=None)

    def where(self) -> dict[str, Any]:
        """
        What belongs under ``where`` in the JSON.

        Returns
        -------
        dict
            Keys ``metrics``, ``nu_gap``, ``bands``, ``place_scores`` and ``dynamic_stiffness``.
        """
        return {
            "metrics": [asdict(m) for m in self.metrics],
            "nu_gap": None if self.nu_gap is None else asdict(self.nu_gap),
            "bands": [asdict(b) for b in self.bands],
            "place_scores": [asdict(p) for p in self.place_scores],
            "dynamic_stiffness": [z.to_dict() for z in self.stiffness],
        }

    def means(self) -> dict[str, Any] | None:
        """
        What belongs under ``consequences`` in the JSON.

        Returns
        -------
        dict or None
            None where nothing can be said.
        """
        return None if self.consequences is None else asdict(self.consequences)


def finite_or_none(value: float) -> float | None:
    """
    A position or level as JSON has it.

    Parameters
    ----------
    value : float
        The value; NaN where there is none.

    Returns
    -------
    float or None
        The value.
    """
    return float(value) if np.isfinite(value) else None
