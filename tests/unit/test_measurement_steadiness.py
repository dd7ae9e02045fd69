"""A machine that changes while it is recorded: its mean response is that of no machine."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from cutvib_ss.diagnosis.posterior import that_are_means
from cutvib_ss.measurement.replay import Replay
from cutvib_ss.measurement.steadiness import change_within

FS, BLOCK, BLOCKS = 100.0, 512, 16
MASS, DAMPING, STIFFNESS = 1.0, 3.0, 3000.0


def recorded(softening, noise=0.01, seed=0):
    """An oscillator under random force, exact between its samples, whose stiffness falls evenly by a part of it."""
    rng, count = np.random.default_rng(seed), BLOCK // 2 * (BLOCKS + 1)
    force, state, out = rng.standard_normal(count), np.zeros(2), np.empty(count)
    for first in range(0, count, 64):
        k = STIFFNESS * (1.0 + softening * (0.5 - first / count))
        a, b, *_ = signal.cont2discrete(
            (
                np.array([[0, 1], [-k / MASS, -DAMPING / MASS]]),
                np.array([[0], [1 / MASS]]),
                np.eye(2),
                np.zeros((2, 1)),
            ),
            1 / FS,
        )
        for n in range(first, min(first + 64, count)):
            out[n] = state[0]
            state = a @ state + b[:, 0] * force[n]
    out += noise * out.std() * rng.standard_normal(count)
    return Replay((force,), FS, np.arange(10, 120), BLOCK, BLOCK // 2, (out[None],))


def test_a_machine_that_stays_the_same_does_not_change():
    assert all(change_within(recorded(0.0, noise, seed)) is None for noise in (1e-4, 0.03, 1.0) for seed in range(3))


@pytest.mark.parametrize("softening", [0.06, 0.12])
def test_a_change_is_found_of_its_size(softening):
    replay = recorded(softening, seed=3)
    found = change_within(replay)
    assert found is not None
    s = 2j * np.pi * FS / BLOCK * replay.lines
    ends = [1.0 / (MASS * s**2 + DAMPING * s + STIFFNESS * (1.0 + part * softening)) for part in (0.5, -0.5)]
    expected = np.sum(np.abs(ends[0] - ends[1]) ** 2) / 4.0
    # A block hears the machine while it changes, and a straight line is not all of the way that a resonance moves.
    assert 0.4 * expected < found.sum() < 1.3 * expected


def test_a_line_that_is_not_driven_tells_nothing():
    replay = recorded(0.12)
    replay.spectra[0][:, 5] = 0.0
    found = change_within(replay)
    assert found is not None
    assert np.isfinite(found).all()


def test_too_few_blocks_tell_nothing():
    whole = recorded(0.12)
    end = BLOCK * 2
    short = Replay((whole.forces[0][:end],), FS, whole.lines, BLOCK, BLOCK // 2, (whole.measured[0][:, :end],))
    assert change_within(short) is None


def test_a_cause_keeps_what_it_explains_of_what_a_mean_may_be_off():
    entry = SimpleNamespace(record=0, precision=np.full((1, 4), 2.0))

    def of(level, name, effect):
        hypothesis = SimpleNamespace(linear=True, causes=((effect, "p"),) if effect else (), effects=())
        judged = SimpleNamespace(records=(SimpleNamespace(entry=entry, predicted=np.full((1, 4), level + 0j)),))
        return SimpleNamespace(name=name, fit=SimpleNamespace(hypothesis=hypothesis)), judged

    rows = [of(0.0, "none", ""), of(1.0, "mass", "added_mass"), of(3.0, "x", "unknown")]
    held = {r.name: j for r, j in rows}
    odds = {"none": 0.1, "mass": 0.8, "x": 0.1}
    assert that_are_means([r for r, _ in rows], odds, lambda r: held[r.name], {}) == odds
    found = that_are_means([r for r, _ in rows], odds, lambda r: held[r.name], {0: np.full((1, 4), 3.0)})
    assert found == pytest.approx({"none": 0.1, "mass": 0.2, "x": 0.1})
