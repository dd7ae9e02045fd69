"""First guess of the head's parameters from two peaks and the dip between them (Section 5, Eqs. 14-20)."""

from __future__ import annotations

from math import pi, radians, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage, signal

from cutvib_ss.errors import IdentificationError, ParameterError
from cutvib_ss.parameters import HeadParameters, check_number
from cutvib_ss.results import FrequencyResponse

PAPER_PEAKS = (215.0, 248.0)
"""The paper's two measured resonances of the tool [Hz] (Section 2)."""
PAPER_DIP = 230.0
"""The minimum between them [Hz] (Section 5)."""

_SMOOTHING = 2.0
"""Width over which a measured modulus is smoothed before its peaks are sought [Hz]."""


def stiffness_ratio(peaks: tuple[float, float], dip: float) -> float:
    """
    Ratio κ = k1/k2 that sets two resonances as far apart as two measured peaks (Eq. 19 solved for κ).

    Eq. 19 is f_{1,2} = f_n √(1 ∓ ε) with ε = 1/√(κ+1). With d = (f_2 - f_1)/f_n, d² = 2 - 2√(1 - ε²), so that
    ε² = 1 - (1 - d²/2)² and κ = 1/ε² - 1.

    >>> stiffness_ratio((215.0, 248.0), 230.0)
    47.83
    """
    low, high = peaks
    if not 0.0 < low < dip < high:
        raise ParameterError(f"peaks {low} and {high} Hz with a dip at {dip} Hz: the dip must lie between the peaks")
    d = (high - low) / dip
    if d * d >= 2.0:
        raise ParameterError(f"peaks {low} and {high} Hz are too far apart for Eq. 19 with a dip at {dip} Hz")
    return 1.0 / (1.0 - (1.0 - d * d / 2.0) ** 2) - 1.0


def resonances(tuning: float, ratio: float) -> tuple[float, float]:
    """Natural frequencies of the two coupled systems of equal tuning (Eq. 19)."""
    gap = 1.0 / sqrt(ratio + 1.0)
    return tuning * sqrt(1.0 - gap), tuning * sqrt(1.0 + gap)


def first_guess(
    peaks: tuple[float, float],
    dip: float,
    *,
    length: float = 0.1,
    tool_mass: float = 0.5,
    damping_ratio: float = 0.1,
    ratio: float | None = None,
) -> HeadParameters:
    """
    Head whose two resonances are as far apart as the measured peaks, around the measured dip (Eqs. 14-20).

    Parameters
    ----------
    peaks : tuple of float
        Frequencies of the two peaks of XX [Hz], ascending.
    dip : float
        Frequency of the minimum between them [Hz].
    length : float
        l_1 = l_2 = l [m], a meaningful value.
    tool_mass : float
        m_2 [kg], a meaningful value.
    damping_ratio : float
        ζ of Eq. 20, of both joints.
    ratio : float, optional
        κ = k_1/k_2 in place of the one that follows from the peaks.

    Returns
    -------
    HeadParameters
        θ_01 = 0, θ_02 = 90°, k_2 = m_2 l² Ω², k_1 = κ k_2, m_1 = κ m_2, c_i = 2ζ √(k_i m_i l²).

    Raises
    ------
    ParameterError
        If the dip does not lie between the peaks, or a value is impossible.

    Notes
    -----
    Table 1 does not follow from these equations throughout: its k_1 is κ = 50 where the printed peaks give 47.8, its
    m_1 of 24 kg is κ = 48, and its dampings are those of ζ = 0.05, c_1 with m_1 = 26 kg.

    Examples
    --------
    >>> round(first_guess(PAPER_PEAKS, PAPER_DIP).k2)
    10442
    """
    kappa = stiffness_ratio(peaks, dip) if ratio is None else check_number("ratio", ratio, 0.0, strict=True)
    check_number("length", length, 0.0, strict=True)
    check_number("tool_mass", tool_mass, 0.0, strict=True)
    check_number("damping_ratio", damping_ratio, 0.0)
    inertia = tool_mass * length**2
    k2 = inertia * (2 * pi * dip) ** 2
    c2 = 2 * damping_ratio * sqrt(k2 * inertia)
    return HeadParameters(
        m1=kappa * tool_mass, m2=tool_mass, l1=length, l2=length, theta01=0.0, theta02=radians(90.0),
        k1=kappa * k2, k2=k2, c1=kappa * c2, c2=c2, source="Eqs. 14-20",
        caveat="lengths, m2 and damping ratios are chosen, not measured",
    )  # fmt: skip


def peaks_and_dip(
    frf: FrequencyResponse, output: str = "tool_x", band: tuple[float, float] = (150.0, 300.0)
) -> tuple[tuple[float, float], float]:
    """
    The two close peaks of a driving-point response, and the dip between them.

    Parameters
    ----------
    frf : FrequencyResponse
        One position is used, the first.
    output : str
        Output at the driving point.
    band : tuple of float
        Where to look [Hz].

    Returns
    -------
    peaks : tuple of float
        Frequencies of the two most prominent peaks [Hz], ascending.
    dip : float
        Frequency of the minimum between them [Hz].

    Raises
    ------
    IdentificationError
        If the band does not show two peaks.
    """
    inside = (frf.freq >= band[0]) & (frf.freq <= band[1])
    freq = frf.freq[inside]
    modulus = np.abs(frf.sel(output=output).to_form("accelerance").data[0, 0, 0, inside])
    if freq.size < 5 or not np.isfinite(modulus).all():
        raise IdentificationError(
            f"{band[0]:g} to {band[1]:g} Hz holds {freq.size} usable lines; too few for two peaks"
        )
    smooth = _smoothed(freq, modulus)
    index, properties = signal.find_peaks(smooth, prominence=0.02 * smooth.max())
    if index.size < 2:
        raise IdentificationError(
            f"{band[0]:g} to {band[1]:g} Hz shows {index.size} peak(s) of {output}, the first guess needs two; "
            "choose another record or band, or start from given parameters"
        )
    first, second = np.sort(index[np.argsort(properties["prominences"])[-2:]])
    dip = first + int(np.argmin(smooth[first : second + 1]))
    return (float(freq[first]), float(freq[second])), float(freq[dip])


def _smoothed(freq: ArrayLike, modulus: ArrayLike) -> np.ndarray:
    step = float(np.median(np.diff(np.asarray(freq))))
    return np.asarray(ndimage.gaussian_filter1d(np.asarray(modulus, dtype=float), _SMOOTHING / step, mode="nearest"))
