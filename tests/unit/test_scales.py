"""Ranges and starts of every effect on structures of any size, held or free, with ports that move together."""

from __future__ import annotations

import numpy as np
import pytest

from cutvib_ss.diagnosis.hypotheses import candidates, nonlinear_candidates
from cutvib_ss.diagnosis.severity import runs
from cutvib_ss.diagnosis.variants import variants
from cutvib_ss.effects.base import Motion, parameter_fields
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.frequency import frequency_response

LINK = np.array([[1.0, -1.0], [-1.0, 1.0]])


def structure(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray, **more: list[float]) -> Structure:
    n = len(mass)
    ports = {"drive": np.eye(n)[0], **{name: np.array(row) for name, row in more.items()}}
    system = SecondOrder(mass, damping, stiffness, tuple(f"x{i}" for i in range(n)), ports)
    return Structure(system, {"y": Channel("drive", "displacement")}, "drive")


def cantilever(elements: int = 5, length: float = 0.9) -> Structure:
    """A steel beam 40 mm by 10 mm of Euler-Bernoulli elements: every diagonal entry of K is that of one short element."""
    area, inertia, h = 4e-4, 0.04 * 0.01**3 / 12, length / elements
    scale = np.diag([1.0, h, 1.0, h])
    k = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
    m = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
    k, m = 2.1e11 * inertia / h**3 * scale @ k @ scale, 7850 * area * h / 420 * scale @ m @ scale
    n = 2 * elements + 2
    stiffness, mass = np.zeros((n, n)), np.zeros((n, n))
    for i in range(elements):
        own = np.ix_(range(2 * i, 2 * i + 4), range(2 * i, 2 * i + 4))
        stiffness[own] += k
        mass[own] += m
    stiffness, mass = stiffness[2:, 2:], mass[2:, 2:]
    middle, tip = np.eye(n - 2)[4], np.eye(n - 2)[n - 4]
    ports = {"middle": middle, "tip": tip}
    system = SecondOrder(mass, 2e-5 * stiffness, stiffness, tuple(f"x{i}" for i in range(n - 2)), ports)
    return Structure(system, {"y": Channel("tip", "displacement")}, "tip")


STRUCTURES = {
    "a cantilever of finite elements": cantilever(),
    "a carriage that nothing holds": structure(np.array([[95.1]]), np.array([[203.5]]), np.zeros((1, 1))),
    "a mass in space": structure(np.array([[3.0]]), np.zeros((1, 1)), np.zeros((1, 1))),
    "two masses in space": structure(np.diag([2.0, 0.5]), 3.0 * LINK, 4e4 * LINK, tip=[0.0, 1.0], link=[1.0, -1.0]),
    "a circuit": structure(np.array([[5.4e-6]]), np.array([[2.2e-4]]), np.array([[0.99]])),
    "undamped": structure(np.array([[2.0]]), np.zeros((1, 1)), np.array([[1e5]])),
}
each_structure = pytest.mark.parametrize("model", STRUCTURES.values(), ids=STRUCTURES)


@each_structure
@pytest.mark.parametrize("motion", [None, 1e-4])
def test_ranges_are_finite_and_not_empty(model: Structure, motion: float | None) -> None:
    for kind in EFFECTS.values():
        for place in kind.places(model):
            for name, r in kind.ranges(model, place, motion).items():
                assert np.isfinite([r.low, r.high]).all(), (kind.effect, name, r)
                assert r.low < r.high, (kind.effect, name, r)
                assert r.scale in ("linear", "asinh") or r.low > 0.0, (kind.effect, name, r)


@each_structure
def test_starts_apply_and_change_something(model: Structure) -> None:
    band = (5.0, 200.0)
    found = candidates(model, band, ("y",))
    bare = frequency_response(model, None, np.geomspace(*band, 30)).data
    for candidate in found:
        values = [v for run in runs([candidate])[0] for v in vars(run.at(1.0)).values() if isinstance(v, float)]
        assert np.isfinite(values).all(), candidate.name
        shown = [
            frequency_response(run.at(1.0).apply(model), None, np.geomspace(*band, 30)).data
            for run in runs([candidate])[0]
        ]
        assert all(np.abs(s - bare).max() > 0.0 for s in shown), candidate.name


@each_structure
def test_laws_start_from_finite_sizes(model: Structure) -> None:
    moved = {port: Motion(1e-5, 4e-5, 3e-3) for port in model.system.ports}
    for candidate in nonlinear_candidates(model, moved):
        for start in candidate.starts:
            # What may be negative down to some number, as the exponent of a power law, is no size.
            fitted = [f for f in parameter_fields(type(start)) if not (f.metadata["range"].minimum or 0.0) < 0.0]
            sizes = [getattr(start, f.name) for f in fitted]
            assert not any(v is not None and (np.isnan(v) or v == 0.0) for v in sizes), candidate.name


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_sizes_go_with_the_structure(factor: float) -> None:
    small = STRUCTURES["two masses in space"]
    s = small.system
    large = structure(factor * s.mass, factor * s.damping, factor * s.stiffness, tip=[0.0, 1.0], link=[1.0, -1.0])
    for kind in ("added_mass", "local_resonator", "tool_contact"):
        for place in EFFECTS[kind].places(small):
            one, other = (EFFECTS[kind].ranges(m, place) for m in (small, large))
            for name, r in one.items():
                scale = factor if r.unit in ("kg", "N/m", "N s/m") else 1.0
                assert other[name].high == pytest.approx(scale * r.high)
                assert other[name].low == pytest.approx(scale * r.low)


def test_ports_that_move_together_are_one_place_named_after_the_first() -> None:
    both = structure(np.diag([2.0, 0.5]), 3.0 * LINK, 4e4 * LINK, twice=[2.0, 0.0], other=[0.0, 1.0], back=[0.0, -3.0])
    assert ToolContact.places(both) == ("drive", "other")
    assert {v.place for v in variants(both, ("y",))} == {"drive", "other", "measurement"}
    assert both.place_of("back") == "other"
    names = [c.name for c in candidates(both, (5.0, 200.0), ("y",))]
    assert len(names) == len(set(names))
    assert not any("twice" in n or "back" in n for n in names)
    # A file may still name the others.
    freq = np.array([20.0])
    named, first = (ToolContact(p, k).apply(both) for p, k in (("twice", 1e3), ("drive", 4e3)))
    assert frequency_response(named, None, freq).data == pytest.approx(frequency_response(first, None, freq).data)
    with pytest.raises(ParameterError, match="cannot sit at 'nowhere'"):
        ToolContact("nowhere", 1e3).apply(both)


def test_a_point_of_finite_elements_carries_what_holds_it() -> None:
    """Against the static stiffness of a cantilever's tip, 3 E I / L³; the diagonal of K is hundreds of times that."""
    model = cantilever()
    _, stiffness, _ = model.carried_at("tip")
    assert stiffness == pytest.approx(3 * 2.1e11 * (0.04 * 0.01**3 / 12) / 0.9**3, rel=1e-6)
    assert model.system.stiffness[model.system.port("tip") == 1.0].max() > 100 * stiffness


def test_the_sum_of_a_row_of_a_reduced_stiffness_is_no_spring() -> None:
    """The cantilever by three of its points: the rows' sums are far from what holds them."""
    model, freed = cantilever(), np.linalg.inv(cantilever().system.stiffness)
    kept = [int(np.flatnonzero(model.system.port(p))[0]) for p in ("middle", "tip")]
    kept = [kept[0] // 2, *kept]
    held = np.linalg.inv(freed[np.ix_(kept, kept)])
    reduced = structure(np.eye(3), 1e-5 * held, held, b=[0.0, 1.0, 0.0], c=[0.0, 0.0, 1.0])
    assert reduced.spring_at("c")[0] > 3.0 / freed[kept[2], kept[2]]
    assert reduced.carried_at("c")[1] == pytest.approx(1.0 / freed[kept[2], kept[2]])


def test_starts_lie_in_their_ranges_on_finite_elements() -> None:
    model = cantilever()
    motion = Motion(1e-6, 2e-5, 5e-3, 50.0)
    linear = candidates(model, (10.0, 400.0), ("y",))
    laws = nonlinear_candidates(model, {"tip": motion, "middle": motion})
    looked_at = 0
    for candidate in (*linear, *laws):
        for name in (f.name for f in parameter_fields(type(candidate.starts[0]))):
            e = candidate.starts[0]
            r = e.ranges(model, e.place, motion.high).get(name)
            values = np.array([getattr(e, name) for e in candidate.starts if getattr(e, name) is not None], dtype=float)
            if r is None or not values.size or r.limits:
                continue
            inside = (values >= r.low * (1 - 1e-9)) & (values <= r.high * (1 + 1e-9))
            assert np.mean(inside | ~np.isfinite(values)) >= (0.4 if candidate in laws else 1.0), (candidate.name, name)
            looked_at += 1
    assert looked_at > 30


def test_a_stop_many_times_stiffer_than_the_beam_lies_in_its_range() -> None:
    model = cantilever()
    _, stiffness, _ = model.carried_at("tip")
    assert ToolContact.ranges(model, "tip")["stiffness"].high > 50 * stiffness
