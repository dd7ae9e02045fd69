"""Blows on an oscillator, as instruments that hum and jitter record them."""

from pathlib import Path

import numpy as np
from scipy import signal

from cutvib_ss.measurement.records import Campaign, History, Record
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure, StructureTolerances

MASS, DAMPING, SPRING = 2.0, 8.0, 8.0e4
FINE = 16
OSCILLATOR = Structure(
    SecondOrder(
        np.array([[MASS]]), np.array([[DAMPING]]), np.array([[SPRING]]), ("x",), {"spring": np.ones(1)}
    ),
    {"a": Channel("spring", "acceleration")},
    "spring",
    tolerance=StructureTolerances(0.01, 0.1, 0.01, 0.01),
)  # fmt: skip


def struck(
    hum: float = 0.0,
    mass: float = MASS,
    jitter: float = 0.0,
    late: float = 0.0,
    damping: float = DAMPING,
    noise: tuple[float, float] = (0.01, 0.02),
) -> Campaign:
    """
    Three records of three blows; standard deviations of the noise on force and response.

    Hum is over that of the response, jitter the standard deviation by which responses are late [s] besides `late`.
    """
    rng, fs, count, records = np.random.default_rng(11), 1024.0, 2048, []
    numerator, denominator, _ = signal.cont2discrete(([1.0, 0.0, 0.0], [mass, damping, SPRING]), 1 / (FINE * fs), "foh")
    time = np.arange(count) / fs
    fine = np.arange(count * FINE) / (FINE * fs)
    for k, level in enumerate((20.0, 60.0, 180.0)):
        histories = []
        for _ in range(3):
            pulse = np.sin(np.pi * np.clip((fine - 0.05) / 0.006, 0.0, 1.0)) ** 2
            force = level * rng.uniform(0.9, 1.1) * pulse
            exact = signal.lfilter(numerator.ravel(), denominator, force)
            response = np.interp(time - late - jitter * rng.standard_normal(), fine, exact)
            tones = sum(np.sin(2 * np.pi * n * (50.02 * time + rng.uniform())) for n in (1, 2, 3, 5))
            response = response + noise[1] * (rng.standard_normal(count) + hum * tones)
            measured = force[::FINE] + noise[0] * rng.standard_normal(count)
            histories.append(History(fs, measured, response[None], ("a",)))
        records.append(Record(f"r{k}", "impact", None, level, None, ("a",), ("acceleration",), tuple(histories)))
    return Campaign("", Path(), OSCILLATOR, tuple(records), ())
