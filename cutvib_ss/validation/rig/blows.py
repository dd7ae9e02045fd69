"""Hammer blows: what is struck where, how hard, and the force over time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Array = NDArray[np.float64]

FS = 4000.0
"""Sampling rate of the records [Hz]."""

FINE = 32
"""Steps of the simulation to a sample of the records."""

BLOCK = 2.0
"""Length of a record [s]; a little more is simulated, so that what is late has something to show."""

SIMULATED = 2.1

HAMMERS = {"half_sine": 0.0, "two_lobes": 0.25, "tail": 0.12, "ringing": 0.08}
"""Shapes of blows, and the usual size of what makes each."""

_SECOND = signal.firwin(257, 1820.0, window=("kaiser", 8.0), fs=FS * 4)


@dataclass(frozen=True)
class Pulse:
    """One contact of the hammer."""

    at: float  # When it begins [s]
    peak: float  # Peak force [N]
    width: float  # How long it lasts [s]
    skewness: float  # 0 for a symmetric pulse
    shape: str = "half_sine"  # One of `HAMMERS`
    detail: float = 0.0  # Size of what makes the shape, over the peak

    def force(self, time: Array) -> Array:
        """Force [N] at some times [s]."""
        phase = (time - self.at) / self.width
        inside = (phase > 0) & (phase < 1)
        total = np.zeros_like(time)
        # a half sine with rounded feet, its crest drawn forward or back
        bent = phase[inside] ** np.exp(self.skewness)
        total[inside] = self.peak * np.sin(np.pi * bent) ** 1.3
        after = np.maximum(phase, 0.0)
        if self.shape == "two_lobes":  # the head of the hammer turns on its handle
            total[inside] *= 1 + self.detail * np.cos(4.4 * np.pi * phase[inside])
        elif self.shape == "tail":  # a soft tip creeps back
            total += self.detail * self.peak * (1 - np.exp(-5 * after)) * np.exp(-after / 1.5)
        elif self.shape == "ringing":  # a light hammer rings
            total += (
                self.detail
                * self.peak
                * np.exp(-after / 2)
                * np.sin(2 * np.pi * 3.5 * after)
                * (1 - np.exp(-9 * after))
            )
        return total


@dataclass(frozen=True)
class Blow:
    """A blow of the hammer."""

    pulses: tuple[Pulse, ...]  # Its contacts; a second one where the hammer bounced

    def force(self, fine: int = FINE) -> Array:
        """The force over time."""
        time = np.arange(round(SIMULATED * FS * fine)) / (FS * fine)
        return np.asarray(sum(p.force(time) for p in self.pulses))


def draw_blow(rng: np.random.Generator, level: float, width: float, bounce: float, hammer: str = "half_sine") -> Blow:
    """Draw a blow."""
    peak = level * float(np.clip(1 + 0.12 * rng.standard_normal(), 0.6, 1.4))
    # a stiffer contact under a harder blow
    width = width * (level / 50.0) ** -0.03 * float(np.exp(0.04 * rng.standard_normal()))
    skewness = -0.1 + 0.06 * float(rng.standard_normal())
    at = 0.050 + 0.002 * float(rng.random())
    detail = HAMMERS[hammer] * float(np.exp(0.2 * rng.standard_normal())) if HAMMERS[hammer] else 0.0
    pulses = [Pulse(at, peak, width, skewness, hammer, detail)]
    if rng.random() < bounce:
        late = float(rng.uniform(0.012, 0.045))
        pulses.append(Pulse(at + late, peak * float(rng.uniform(0.05, 0.3)), width * 1.1, skewness))
    return Blow(tuple(pulses))


@cache
def _first(fine: int) -> Array:
    """The filter before the first decimation: the same in hertz at every rate."""
    return np.asarray(signal.firwin(8 * fine + 1, 6500.0, window=("kaiser", 8.0), fs=FS * fine))


def antialiased(history: Array, fine: int = FINE) -> Array:
    """Through the digitiser's filter and down to FS; without delay."""
    for taps, down in ((_first(fine), fine // 4), (_SECOND, 4)):
        count = -(-history.shape[-1] // down)
        delay = taps.size // 2
        padded = np.concatenate([history, np.zeros((*history.shape[:-1], delay))], axis=-1)
        # the filter's delay is a whole number of the kept samples: it is cut off at the front
        history = signal.upfirdn(taps, padded, down=down)[..., delay // down :][..., :count]
    return np.asarray(history)
