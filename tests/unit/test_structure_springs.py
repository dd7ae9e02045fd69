"""Springs at the ports of a structure whose matrices are written to a few digits."""

import numpy as np
import pytest

from cutvib_ss.effects.base import Measured, Motion, parameter_fields
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure

SPRINGS = (1.234567891e7, 0.987654321e7, 1.111111119e7)


def chain(digits: int) -> Structure:
    """Four masses on a row, the first held to the ground, with numbers of so many digits."""
    k = np.diag([2.5e7, *np.zeros(3)])
    for i, s in enumerate(SPRINGS):
        k[i : i + 2, i : i + 2] += s * np.array([[1.0, -1.0], [-1.0, 1.0]])
    k = np.array([[float(f"{x:.{digits}g}") for x in row] for row in k])
    ports = {"held": np.eye(4)[0], "free": np.eye(4)[2], "between": np.array([0.0, 1.0, -1.0, 0.0])}
    system = SecondOrder(np.diag([3.0, 2.0, 1.0, 4.0]), 1e-5 * k, k, tuple("abcd"), ports)
    return Structure(system, {"y": Channel("free", "acceleration")}, "free")


@pytest.mark.parametrize("digits", [6, 8, 12])
def test_what_rounding_leaves_of_a_row_is_no_spring(digits: int) -> None:
    model = chain(digits)
    assert model.spring_at("free") is None
    held, between = model.spring_at("held"), model.spring_at("between")
    assert held is not None
    assert between is not None
    assert held[0] == pytest.approx(2.5e7, rel=1e-4)
    assert between[0] == pytest.approx(SPRINGS[1], rel=1e-4)


def test_starts_of_laws_lie_in_their_ranges_at_every_port() -> None:
    model = chain(6)
    motion = Motion(1e-6, 2e-5, 5e-3, 50.0)
    measured = Measured((10.0, 400.0), ("y",), dict.fromkeys(("held", "free", "between"), motion))
    looked_at = 0
    for kind in EFFECTS.values():
        if kind.linear:
            continue
        for place, starts in kind.starts(model, measured):
            port = place.split()[-1]
            ranges = kind.ranges(model, port, motion.high)
            for name in (f.name for f in parameter_fields(kind)):
                values = [getattr(e, name) for e in starts if getattr(e, name) is not None]
                low, high = ranges[name].low, ranges[name].high
                # The strongest may lie beyond.
                inside = [v for v in values if np.isfinite(v) and min(low, high) <= v <= max(low, high)]
                assert inside or not values, (kind.effect, place, name, low, high, values)
                looked_at += 1
    assert looked_at > 10
