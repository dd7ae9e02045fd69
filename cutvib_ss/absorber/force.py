"""The tool's periodic force as its harmonics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.parameters import check_number
from cutvib_ss.response.pulses import PULSE_RATE, check_pulse
from cutvib_ss.results import FloatArray, read_only

WORKING_FREQUENCY = PULSE_RATE
"""Fundamental frequency of the cutting tool's force [Hz] (Section 2)."""


@dataclass(frozen=True)
class HarmonicForce:
    """
    A periodic force.

    Parameters
    ----------
    freq : array_like, shape (harmonic,)
        Frequencies [Hz].
    amplitude : array_like, shape (harmonic,)
        Amplitude of each harmonic, mean to peak [N].
    """

    freq: FloatArray
    amplitude: FloatArray

    def __post_init__(self) -> None:
        for name in ("freq", "amplitude"):
            object.__setattr__(self, name, read_only(np.atleast_1d(getattr(self, name)), np.float64))
        if self.freq.ndim != 1 or self.freq.shape != self.amplitude.shape or not self.freq.size:
            raise ParameterError("a harmonic force needs as many amplitudes as frequencies, and at least one")
        if not (np.isfinite(self.freq) & (self.freq > 0)).all() or not np.isfinite(self.amplitude).all():
            raise ParameterError("a harmonic force needs frequencies above zero, and amplitudes that are finite")

    @classmethod
    def tone(cls, freq: float = WORKING_FREQUENCY, amplitude: float = 1.0) -> HarmonicForce:
        """
        One harmonic.

        Parameters
        ----------
        freq : float
            Frequency [Hz].
        amplitude : float
            Amplitude [N].

        Returns
        -------
        HarmonicForce
            By default 1 N at 217 Hz: accelerations under it are accelerances.
        """
        return cls(np.array([freq]), np.array([amplitude]))

    @classmethod
    def pulses(
        cls,
        rate: float = WORKING_FREQUENCY,
        duty: float = 0.3,
        rise: float = 5e-4,
        fall: float = 5e-4,
        peak: float = 1.0,
        harmonics: int = 5,
    ) -> HarmonicForce:
        """
        A train of trapezoidal pulses, whose history is `cutvib_ss.response.pulses.pulse_train`.

        Parameters
        ----------
        rate : float
            Pulses a second [Hz].
        duty : float
            Part of the period in which the force is above half its peak: mean force over peak.
        rise, fall : float
            Duration of either flank, foot to top [s].
        peak : float
            Largest force [N].
        harmonics : int
            Number of harmonics kept.

        Returns
        -------
        HarmonicForce
            The harmonics, without the mean.

        Raises
        ------
        ParameterError
            If the pulse does not fit into its period, or its flanks into the pulse.

        Notes
        -----
        The derivative of a trapezoid is two rectangles, one of each flank, whose middles are duty · T apart. With ω = 2πnrate

            c_n = peak / (jωT) · (sinc(ω rise/2) e^(-jω t₁) - sinc(ω fall/2) e^(-jω t₂)),  t₂ - t₁ = duty T,

        sinc x = sin x / x; the amplitude is 2|c_n|. Equal flanks give 2 peak duty |sinc(nπ duty) sinc(ω rise/2)|.

        Examples
        --------
        >>> HarmonicForce.pulses(duty=0.5, rise=0.0, fall=0.0, harmonics=3).amplitude.round(4)
        array([0.6366, 0.    , 0.2122])
        """
        check_pulse(rate, duty, rise, fall)
        check_number("harmonics", harmonics, 1)
        n = np.arange(1.0, harmonics + 1)
        # numpy's sinc has π inside.
        c = np.sinc(n * rate * rise) - np.sinc(n * rate * fall) * np.exp(-2j * np.pi * n * duty)
        amplitude: FloatArray = peak / np.pi * np.abs(c) / n
        return cls(n * rate, amplitude)
