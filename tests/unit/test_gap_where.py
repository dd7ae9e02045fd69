"""The place of an element that no catalogue knows, from one free dynamic stiffness."""

import numpy as np
import pytest

from cutvib_ss.gap import where
from cutvib_ss.gap.observations import Entry
from cutvib_ss.machine import published_machine

FREQ = np.arange(20.0, 400.0, 2.0)
CHANNELS = ("tool_x", "tool_z", "base_x")


def measured(port, stiffness, positions=(0.1, 0.3, 0.5, 0.8)):
    """Responses with a fractional damper at a port, by the dense second-order form: no closed form takes part."""
    rng = np.random.default_rng(1)
    entries = []
    for k, position in enumerate(positions):
        system = published_machine().second_order(position)
        s = 2j * np.pi * FREQ
        row = system.port(port)
        dense = system.dynamic_stiffness(s) + stiffness(s)[:, None, None] * np.outer(row, row)
        solution = np.linalg.solve(dense, np.broadcast_to(system.port("tool_x")[:, None], (FREQ.size, len(row), 1)))
        reads = np.array([system.port(p) for p in ("tool_x", "tool_z", "base")])
        data = (reads @ solution[..., 0].T) * s**2
        level = 1e-3 * np.abs(data).max()
        noise = level * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)) / np.sqrt(2)
        entries.append(
            Entry(
                k,
                position,
                np.nan,
                data + noise,
                np.full(data.shape, level**2),
                FREQ,
                CHANNELS,
                ("acceleration",) * 3,
                np.inf,
                np.nan,
                0.0,
                False,
            )
        )
    return entries


@pytest.mark.parametrize(
    ("port", "place", "size"), [("joint2", "joint2", 40.0), ("head_x", "head", 1e5), ("joint1", "joint1", 2e3)]
)
def test_place_of_a_fractional_damper(port, place, size):
    entries = measured(port, lambda s: size * s**0.5)
    calibration = [np.ones((3, FREQ.size), complex)]
    scores = where.locate(published_machine(), entries, calibration, 0.0)
    assert scores[0].place == place
    assert scores[0].chi2 / scores[0].freedom == pytest.approx(1.0, abs=0.1)
    assert scores[1].chi2 / scores[1].freedom > 2.0
    # z itself comes out: modulus and phase of a half-order element, where it is seen.
    expected = size * (2j * np.pi * FREQ) ** 0.5
    seen = (FREQ > 190) & (FREQ < 260)
    assert np.median(np.abs(scores[0].z[seen] / expected[seen] - 1)) < 0.1
