"""The rail's shear against finite elements of a Timoshenko beam, alone and with ends, masses and the head."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy import linalg

from cutvib_ss.effects.rail_shear import RailShear
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.elements import SpringDamperMass
from cutvib_ss.model.head import head
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.pinned_modes import SHEAR_TO_EXTENSION, timoshenko
from cutvib_ss.model.rail import EndSupports, Rail, RailAttachment, Shear, rail
from cutvib_ss.parameters import RailParameters
from cutvib_ss.response.frequency import frequency_response

P = RailParameters(length=2.5, mass=76.5, first_frequency=31.7, damping_ratio=0.01, n_modes=60)
PLACE = 0.3


def finite_elements(ratio: float, elements: int) -> tuple[np.ndarray, np.ndarray]:
    """
    Mass and stiffness over (w, ψ) of each node of a free Timoshenko beam.

    Between nodes w is a cubic and the shear strain goes with its third derivative, w' - ψ = -EI/κGA w''', as in statics without
    load; with inertia the frequencies converge with the square of the elements' length, from above.
    """
    h, mu, ei = P.length / elements, P.mass / P.length, P.bending_stiffness
    shear = pi**2 * ei * ratio / P.length**2  # κGA
    gyration = SHEAR_TO_EXTENSION * ei / shear  # ρ²
    lag = 6 * ei / shear
    c = np.linalg.inv([[1, 0, 0, 0], [0, 1, 0, lag], [1, h, h**2, h**3], [0, 1, 2 * h, 3 * h**2 + lag]])
    points, weights = np.polynomial.legendre.leggauss(5)
    k, m = np.zeros((4, 4)), np.zeros((4, 4))
    for x, weight in zip(h / 2 * (points + 1), h / 2 * weights, strict=True):
        w, psi, curvature, strain = np.array(
            [[1, x, x**2, x**3], [0, 1, 2 * x, 3 * x**2 + lag], [0, 0, 2, 6 * x], [0, 0, 0, -lag]]
        ) @ c  # fmt: skip
        k += weight * (ei * np.outer(curvature, curvature) + shear * np.outer(strain, strain))
        m += weight * mu * (np.outer(w, w) + gyration * np.outer(psi, psi))
    n = 2 * (elements + 1)
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    for e in range(elements):
        at = np.ix_(range(2 * e, 2 * e + 4), range(2 * e, 2 * e + 4))
        mass[at] += m
        stiffness[at] += k
    return mass, stiffness


def inside_pins(size: int, nodes: int) -> np.ndarray:
    """What the pins leave free, of a beam's nodes and what follows them."""
    return np.delete(np.arange(size), [0, 2 * nodes - 2])


def frequencies(mass: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Natural frequencies [Hz], ascending."""
    return np.sqrt(np.abs(linalg.eigvalsh(stiffness, mass))) / (2 * pi)


def extrapolated(solve: Callable[[int], np.ndarray], meshes: Sequence[int] = (60, 120)) -> np.ndarray:
    """The limit of fine elements, from two meshes (Richardson)."""
    coarse, fine = map(solve, meshes)
    count = min(len(coarse), len(fine))
    return (4 * fine[:count] - coarse[:count]) / 3


@pytest.mark.parametrize("ratio", [4.0, 25.0, 150.0])
def test_both_branches_between_pins(ratio: float) -> None:
    def solve(elements: int) -> np.ndarray:
        mass, stiffness = finite_elements(ratio, elements)
        free = np.ix_(*[inside_pins(len(mass), elements + 1)] * 2)
        return frequencies(mass[free], stiffness[free])[:10]

    modes, _ = timoshenko(P.n_modes, ratio)
    found = np.sort(P.first_frequency * modes.frequency)[:10]
    expected = extrapolated(solve)
    assert found == pytest.approx(expected, rel=3e-4)
    assert found[:3] == pytest.approx(expected[:3], rel=2e-6)


def test_the_upper_branch_begins_at_the_cut_off() -> None:
    # All cross-sections turn alike: √(κGA/(μρ²)), the fifth frequency of a rail as stubby as this.
    def solve(elements: int) -> np.ndarray:
        mass, stiffness = finite_elements(4.0, elements)
        free = np.ix_(*[inside_pins(len(mass), elements + 1)] * 2)
        return frequencies(mass[free], stiffness[free])[:5]

    cut_off = P.first_frequency * 4.0 / SHEAR_TO_EXTENSION**0.5
    modes, _ = timoshenko(5, 4.0)
    assert P.first_frequency * modes.frequency[5] == pytest.approx(cut_off, rel=1e-12)
    assert extrapolated(solve)[4] == pytest.approx(cut_off, rel=1e-6)


def test_shear_lowers_a_mode_by_the_square_of_its_number() -> None:
    modes, _ = timoshenko(6, 1e4)
    r = np.arange(1, 7)
    assert 1 - modes.frequency[:6] / r**2 == pytest.approx((1 + SHEAR_TO_EXTENSION) / 2 * r**2 / 1e4, rel=0.01)


@pytest.mark.parametrize("ratio", [6.0, 40.0])
def test_ends_that_give_with_a_mass_between(ratio: float) -> None:
    def solve(elements: int) -> np.ndarray:
        mass, stiffness = finite_elements(ratio, elements)
        at = 2 * round(PLACE * elements)
        for node, k in ((0, 2e7), (at, 2e5), (-2, 6e6)):
            stiffness[node, node] += k
        mass[at, at] += 4.0
        return frequencies(mass, stiffness)[:6]

    load = RailAttachment(SpringDamperMass(stiffness=2e5, mass=4.0), PLACE)
    system = rail(Rail(P, EndSupports(2e7, 6e6), attachments=(load,), shear=Shear(ratio)), {})
    found = frequencies(system.mass, system.stiffness)[:6]
    # Sixty sines leave a little of the kink at the mass.
    assert found == pytest.approx(extrapolated(solve), rel=3e-4)
    assert found[:3] == pytest.approx(extrapolated(solve)[:3], rel=5e-5)


def test_ends_that_resist_turning() -> None:
    def solve(elements: int) -> np.ndarray:
        mass, stiffness = finite_elements(12.0, elements)
        stiffness[1, 1] += 2e6
        stiffness[-1, -1] += 3e5
        free = np.ix_(*[inside_pins(len(mass), elements + 1)] * 2)
        return frequencies(mass[free], stiffness[free])[:4]

    springs = tuple(RailAttachment(SpringDamperMass(stiffness=k), y, slope=True) for k, y in ((2e6, 0.0), (3e5, 1.0)))
    expected, errors = extrapolated(solve), []
    for n in (40, 80):
        system = rail(Rail(replace(P, n_modes=n), attachments=springs, shear=Shear(12.0)), {})
        errors.append(frequencies(system.mass, system.stiffness)[:4] / expected - 1)
    # An end's turning converges like 1/n in the number of sines: the error halves, and vanishes in the limit.
    assert (errors[0] > 4e-4).all()
    assert np.abs(2 * errors[1] - errors[0]).max() < 0.02 * errors[0].max()


def test_the_machine_on_a_rail_that_shears() -> None:
    ratio, freq = 15.0, np.array([15.0, 60.0, 130.0, 215.0, 330.0])
    machine = published_machine()
    machine = replace(machine, rail=Rail(replace(P, damping_ratio=0.0)))
    own = head(machine.head)

    def solve(elements: int) -> np.ndarray:
        mass, stiffness = finite_elements(ratio, elements)
        n, at = len(mass), 2 * round(PLACE * elements)
        joint = np.zeros((3, n + 2))
        joint[[0, 1, 2], [n, n + 1, at]] = 1.0
        parts = zip((mass, 0 * mass, stiffness), (own.mass, own.damping, own.stiffness), strict=True)
        mass, damping, stiffness = (np.pad(beam, (0, 2)) + joint.T @ part @ joint for beam, part in parts)
        free = inside_pins(n + 2, elements + 1)
        rows = np.array([own.port(p) @ joint for p in ("tool_x", "tool_z", "base")])[:, free]
        s = 2j * pi * freq
        dynamic = [(mass * w**2 + damping * w + stiffness)[np.ix_(free, free)] for w in s]
        return np.array([rows @ np.linalg.solve(d, rows[0]) for d in dynamic])

    data = frequency_response(RailShear("rail", ratio).apply(machine), PLACE, freq, form="receptance").data[0, :, 0]
    expected = extrapolated(solve).T
    # What sixty sines leave of the kink under the load.
    assert (np.abs(data - expected).max(axis=0) < 3e-3 * np.abs(expected).max(axis=0)).all()


def test_no_stiffness_against_shear_is_refused() -> None:
    with pytest.raises(ParameterError, match="shear ratio"):
        RailShear("rail", 0.0)
