"""Random excitation: what a restoring force does to it scatters from block to block, and passes for noise."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.diagnosis.layout import Sizes
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.result import Diagnosis
from cutvib_ss.measurement.records import Campaign, History, Record
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure, StructureTolerances

MASS, DAMPING, SPRING = 1.0, 4.0, 4.0e4
FS, FINE, SAMPLES = 256.0, 8, 4096
OSCILLATOR = Structure(
    SecondOrder(
        np.array([[MASS]]), np.array([[DAMPING]]), np.array([[SPRING]]), ("x",), {"spring": np.ones(1)}
    ),
    {"y": Channel("spring", "displacement")},
    "spring",
    tolerance=StructureTolerances(0.01, 0.1, 0.01, 0.01),
)  # fmt: skip


def _shaken(level: float, cubic: float, seed: int) -> Record:
    """A spring with a cubic part under random noise, Runge-Kutta of the fourth order on eight times the clock."""
    rng = np.random.default_rng(seed)
    count, h = SAMPLES + 1024, 1.0 / (FS * FINE)
    force = signal.sosfiltfilt(signal.butter(4, (8.0, 60.0), "band", fs=FS, output="sos"), rng.standard_normal(count))
    force *= level / np.std(force)
    between = signal.resample(force, 2 * FINE * count)
    y, v, out = 0.0, 0.0, np.empty(count)

    def rate(y: float, v: float, f: float) -> float:
        return (f - DAMPING * v - SPRING * y - cubic * y**3) / MASS

    for k in range(count * FINE):
        if k % FINE == 0:
            out[k // FINE] = y
        f0, f1, f2 = between[2 * k], between[2 * k + 1], between[min(2 * k + 2, between.size - 1)]
        a1, v1 = rate(y, v, f0), v
        a2, v2 = rate(y + h / 2 * v1, v + h / 2 * a1, f1), v + h / 2 * a1
        a3, v3 = rate(y + h / 2 * v2, v + h / 2 * a2, f1), v + h / 2 * a2
        a4, v4 = rate(y + h * v3, v + h * a3, f2), v + h * a3
        y, v = y + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    measured = out + 2e-3 * np.std(out) * rng.standard_normal(count)
    kept = slice(1024, None)
    return Record(
        f"r{seed}", "timeseries", None, None, None, ("y",), ("displacement",),
        (History(FS, force[kept], measured[None, kept], ("y",)),),
    )  # fmt: skip


@cache
def _answer(levels: tuple[float, ...], cubic: float) -> Diagnosis:
    records = tuple(_shaken(level, cubic, seed) for seed, level in enumerate(levels))
    return diagnose(Campaign("", Path(), OSCILLATOR, records, ()))


def test_a_cubic_spring_is_found_at_one_level() -> None:
    # Three or four records do not tell it from a clearance of a micron, a nat behind.
    first = _answer((1.0,) * 5, 2e9).causes[0]
    assert (first.effect, first.place) == ("cubic_stiffness", "spring")
    assert first.probability > 0.9
    assert first.parameters["stiffness3"].value == pytest.approx(2e9, rel=0.1)


def test_scatter_that_is_noise_hides_nothing() -> None:
    found = _answer((1.0, 1.0, 1.0), 0.0)
    assert found.verdict == "no_gap"
    assert not any(e.judged for e in found.evidence if e.effect in ("cubic_stiffness", "dry_friction"))


@pytest.mark.slow
def test_a_cubic_spring_is_found_at_two_levels() -> None:
    first = _answer((0.5, 1.0), 2e9).causes[0]
    assert (first.effect, first.place) == ("cubic_stiffness", "spring")
    assert first.probability > 0.9


def test_held_out_records_are_no_quieter_than_stated() -> None:
    noise = [Spread(None, Sizes(noise=n), np.zeros(0), np.zeros((0, 0))).noise for n in (0.1, 1.0, 3.0)]  # type: ignore[arg-type]
    assert noise == [1.0, 1.0, 3.0]
