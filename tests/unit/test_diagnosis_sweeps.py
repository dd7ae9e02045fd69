"""Sine records: force line by line, held responses, branches behind a jump; against Duffing's closed form."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.linearity import motions
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records, merged, thinned
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.simulation import SimulatedProblem, problem_for
from cutvib_ss.diagnosis.sine_test import SineTest
from cutvib_ss.diagnosis.sweeps import branches, swept
from cutvib_ss.diagnosis.unknown_element import UnknownForce
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.results import MeasuredFrequencyResponse
from tests.unit.record_example import entry_of

W0, ZETA, K3 = 2 * np.pi * 50.0, 0.01, 1e9
FREQ = np.linspace(44.0, 60.0, 97)
W = 2 * np.pi * FREQ
NOISE = 0.01


def oscillator() -> Structure:
    """A mass of 1 kg on a spring."""
    system = SecondOrder(np.eye(1), [[2 * ZETA * W0]], [[W0**2]], ("x",), {"x": np.ones(1)})
    return Structure(system, {"x": Channel("x", "displacement")}, "x")


def duffing(amplitude):
    """H at a given amplitude of the motion: a cubic spring is one of k + ¾ k3 A² to the fundamental."""
    return 1.0 / (W0**2 + 0.75 * K3 * amplitude**2 - W**2 + 2j * ZETA * W0 * W)


def roots(force):
    """Amplitudes of all steady motions at each line, ascending: ((ω0² - ω²) + ¾ k3 A²)² A² + (2ζω0ω)² A² = f²."""
    out = []
    for w, f in zip(W, np.broadcast_to(force, W.shape), strict=True):
        k, d, c = 0.75 * K3, W0**2 - w**2, (2 * ZETA * W0 * w) ** 2
        found = np.roots([k**2, 2 * k * d, d**2 + c, -(f**2)])
        out.append(np.sqrt(np.sort(found[np.abs(found.imag) < 1e-6 * np.abs(found)].real)))
    return out


def record(data, sine, seed=0, number=0):
    """A record of a closed form, with noise of a percent."""
    rng = np.random.default_rng(seed)
    variance = (NOISE * np.abs(data)) ** 2
    noise = np.sqrt(variance / 2) * (rng.standard_normal(data.size) + 1j * rng.standard_normal(data.size))
    return entry_of(
        number, None, float(np.median(sine.force)), (data + noise)[None], variance[None], FREQ, ("x",),
        ("displacement",), sine=sine, session="day",
    )  # fmt: skip


def upper(force, until=np.inf):
    """H on the branch that a sweep up follows, to a line where it jumps."""
    size = np.array([r[0] if f >= until else r[-1] for f, r in zip(FREQ, roots(force), strict=True)])
    return duffing(size)


def fitted(*entries):
    return fit(oscillator(), Records(entries), Hypothesis((CubicStiffness("x", 5e8),), {"x": 4e-3}))


def test_a_force_that_varies_is_taken_line_by_line():
    force = 5.0 * (1.0 + 0.5 * np.sin(FREQ / 2.0))
    entry = record(upper(force), SineTest(force, "up"))
    right = fitted(entry)
    assert right.reduced < 1.3
    # Line by line the values scatter by 2.5 % by the fit's own account, and so they do.
    deviation = right.stds["0.stiffness3"]
    assert deviation < 0.03 * K3
    assert right.hypothesis.effects[0].stiffness3 == pytest.approx(K3, abs=2 * deviation)
    assert right.corrected.hypothesis.effects[0].stiffness3 == pytest.approx(K3, rel=0.02)
    # Taken for constant it is another restoring force's record.
    constant = fitted(replace(entry, sine=SineTest(np.full(FREQ.size, 5.0), "up")))
    assert constant.log_evidence < right.log_evidence - 100.0
    assert constant.spread.largest("cause")


def test_a_held_response_is_solved_for_its_force():
    held = np.array([1e-3, 3e-3])
    entries = [
        record(duffing(a), SineTest(a / np.abs(duffing(a)), None, np.full(FREQ.size, a)), k, k)
        for k, a in enumerate(held)
    ]
    found = fitted(*entries)
    assert found.reduced < 1.3
    assert found.hypothesis.effects[0].stiffness3 == pytest.approx(K3, rel=0.02)


def test_the_lines_behind_a_jump_are_told_apart():
    force = np.full(FREQ.size, 12.0)
    both = np.array([r.size == 3 for r in roots(force)])
    first, last = FREQ[both][0], FREQ[both][-1]
    assert both.sum() > 15
    early = last - 0.15 * (last - first)
    model = CubicStiffness("x", K3).apply(oscillator())
    for until, direction, whole in (
        (np.inf, "up", True),
        (early, "up", True),
        (first, "down", True),
        (first, "up", False),
    ):
        entry = record(upper(force, until), SineTest(force, direction))
        (group,) = merged([entry])
        left = np.abs(swept(model, group, 0).data - entry.data) ** 2 / entry.variance
        # Duffing's closed form lacks the third harmonic, which the balance has.
        assert (np.mean(left) < 2.0) == whole, (until, direction)
    assert fitted(record(upper(force, early), SineTest(force, "up"))).reduced < 1.5


def test_a_jump_is_told_where_the_curve_folds_beyond_the_last_line():
    force = np.full(FREQ.size, 30.0)
    assert roots(force)[-1].size == 3
    model = CubicStiffness("x", K3).apply(oscillator())
    entry = record(upper(force, 57.5), SineTest(force, "up"))
    (group,) = merged([entry])
    shown = swept(model, group, 0)
    assert shown.which.tolist() == (FREQ >= 57.5).astype(int).tolist()
    assert np.mean(np.abs(shown.data - entry.data) ** 2 / entry.variance) < 2.0


@pytest.mark.parametrize(("direction", "off"), [("up", 0.03), ("down", 0.3)])
def test_a_jump_that_is_off_by_a_line_outweighs_no_other(direction, off):
    """A line on the wrong branch had a residual of twice its response, and the steps of a fit ended there."""
    force = np.full(FREQ.size, 12.0)
    size = np.array([r[-1 if direction == "up" else 0] for r in roots(force)])
    entry = record(duffing(size), SineTest(force, direction))
    (group,) = merged([entry])
    end = [swept(CubicStiffness("x", k).apply(oscillator()), group, 0) for k in ((1 - off) * K3, (1 + off) * K3)]
    both = np.array([r.size == 3 for r in roots(force)])
    assert any(one.beyond.any() for one in end)
    for one in end:
        wrong = np.abs(one.data - entry.data)[0] / np.abs(entry.data[0])
        assert wrong.max() < 0.5
        # Where there is one branch alone nothing is taken from elsewhere.
        np.testing.assert_array_equal(one.ends[:, ~both][:, :5], np.arange(5) + np.zeros((2, 1)))


def test_branches_between_folds():
    apart = np.array([0, 1, 1, 1, 1, 1, 1, 1, 1, 0], dtype=bool)
    up, down = np.where(apart, 0.0, 1.0), np.where(apart, 9.0, 1.0)
    assert not branches("up", apart, up, down).any()
    up[7:9], down[7:9] = 9.0, 0.0
    assert branches("up", apart, up, down).tolist() == [0, 0, 0, 0, 0, 0, 0, 1, 1, 0]
    # Nearer to the other fold a sweep does not jump.
    up[3:9], down[3:9] = 9.0, 0.0
    assert branches("up", apart, up, down).tolist() == [0, 0, 0, 0, 0, 1, 1, 1, 1, 0]
    which = branches("down", apart, up, down)
    assert which[1:9].tolist() == [0, 0, 1, 1, 1, 1, 1, 1]
    assert branches(None, apart, up, down)[1:9].tolist() == which[1:9].tolist()
    up[5], down[5] = 0.0, 9.0
    assert branches("random", apart, up, down).tolist() == [0, 0, 0, 1, 1, 0, 1, 1, 1, 0]


@pytest.mark.parametrize("held", [False, True])
def test_derivatives_of_sine_records(held):
    force = np.full(FREQ.size, 12.0)
    size = np.full(FREQ.size, 3e-3)
    sine = SineTest(12.0 + 0 * size, None, size) if held else SineTest(force, "up")
    entry = record(duffing(size) if held else upper(force, 55.0), sine)
    problem = problem_for(oscillator(), Records((entry,)), Hypothesis((CubicStiffness("x", K3),), {"x": 4e-3}))
    assert isinstance(problem, SimulatedProblem)
    x = problem.start()
    (p,), _, _ = problem.residuals(x)
    slopes = problem._slopes(x, p)
    for k, i in enumerate((*range(problem.n_tuning), problem.first_effect)):
        moved = x.copy()
        moved[i] += 1e-5
        (q,), _, _ = problem.residuals(moved)
        change = (q.data - p.data) / 1e-5
        # The line next to a fold moves off it.
        alike = np.abs(slopes[k] - change) < 0.02 * np.abs(change).max()
        assert alike.mean() > 0.97
        assert np.abs(change).max() > 0.0


def test_lines_are_left_out_with_their_force():
    force = np.linspace(1.0, 2.0, FREQ.size)
    entry = thinned(record(upper(force), SineTest(force, "up", 2 * force)), slice(None, None, 4))
    np.testing.assert_array_equal(entry.sine.force, force[::4])
    np.testing.assert_array_equal(entry.sine.held, 2 * force[::4])
    (coarse,) = Records((record(upper(force), SineTest(force, "up")),)).coarse(20, 0.01).entries
    assert coarse.sine.force.size == coarse.freq.size


def test_places_move_as_the_force_of_each_line_has_it():
    force = np.full(FREQ.size, 1.0)
    force[FREQ > 49.0] = 1e-3
    entry = record(upper(force), SineTest(force, "up"))
    model = oscillator()
    linear = np.abs(1.0 / (W0**2 - W**2 + 2j * ZETA * W0 * W))
    assert motions(model, Records((entry,)))["x"].high == pytest.approx((force * linear).max(), rel=1e-6)
    assert Problem(model, merged([entry]), Hypothesis()).count == 2 * FREQ.size


def campaign(**keys):
    """A campaign of one sine record."""
    frf = MeasuredFrequencyResponse(
        duffing(1e-3)[None, None, None], FREQ, [np.nan], ("x",), ("force",), ("displacement",),
        variance=np.full((1, 1, 1, FREQ.size), 1e-16), averages=1,
    )  # fmt: skip
    sine = Record(
        "r",
        "frf",
        None,
        keys.pop("peak_force", None),
        None,
        ("x",),
        ("displacement",),
        frf=frf,
        excitation="sine",
        **keys,
    )
    return Campaign("c", ".", oscillator(), (sine,))


def seen(**keys) -> SimpleNamespace:
    made = campaign(**keys)
    (entry,) = observe(made, made.machine).entries
    return entry


def test_a_force_that_is_not_known_is_said():
    for keys, told in (
        ({}, "state peak_force"),
        ({"controlled": "response", "peak_force": 4.0}, "state peak_response"),
    ):
        made = campaign(**keys)
        (line,) = observe(made, made.machine).warnings
        assert line.startswith("r: causes that depend on the level are not tried")
        assert told in line
    made = campaign(peak_force=4.0)
    assert observe(made, made.machine).warnings == ()


def test_what_a_record_states_of_its_sine():
    column = np.linspace(2.0, 3.0, FREQ.size)
    gain = np.abs(duffing(1e-3))
    assert seen().sine is None
    assert seen().level is None
    one = seen(peak_force=4.0, sweep="up")
    assert (one.level, one.sine.direction) == (4.0, "up")
    np.testing.assert_array_equal(one.sine.force, np.full(FREQ.size, 4.0))
    # The column states more than one figure.
    two = seen(peak_force=4.0, force_amplitude=column)
    np.testing.assert_array_equal(two.sine.force, column)
    assert seen(force_amplitude=column).level == pytest.approx(2.5)
    three = seen(controlled="response", peak_response=1e-3)
    np.testing.assert_allclose(three.sine.held, 1e-3)
    np.testing.assert_allclose(three.sine.force, 1e-3 / gain)
    four = seen(controlled="response", force_amplitude=column)
    np.testing.assert_allclose(four.sine.held, column * gain)
    # Which force is not known without either.
    assert seen(controlled="response", peak_force=4.0).sine is None


def test_an_unknown_force_of_displacements_differs_from_line_to_line():
    """What a sine's displacements leave has no block that cuts rigid motion off, for which every line would need one element."""
    force = np.full(FREQ.size, 5.0)
    records = Records(
        tuple(record(upper(scale * force), SineTest(scale * force), k, k) for k, scale in enumerate((1.0, 3.0)))
    )
    problem = problem_for(oscillator(), records, Hypothesis((UnknownForce("x", "x", 0.1, FREQ[0], FREQ[-1]),)))
    x = 0.3 * np.random.default_rng(0).standard_normal(problem.size)
    assert all(np.isfinite(p.data).all() for p in problem.predictions(x))


def test_starts_are_compared_in_shape_where_resonances_lie_apart() -> None:
    """A spring half as hard again lies nearer to what was measured than no cubic spring at all."""
    entries = [record(upper(f), SineTest(np.full(FREQ.size, f), "up"), number=k) for k, f in enumerate((2.0, 8.0))]
    scan = Scan(oscillator(), Records(tuple(entries)), Hypothesis(), None, {"x": 1e-3}, apart=True)
    assert scan.is_far
    cubic = [CubicStiffness("x", factor * K3) for factor in (1e-4, 1.0, 1.5, 100.0)]
    nothing, truth, near, wrong = (scan.nearest([e])[0] for e in cubic)
    assert 10 * truth < near < nothing < 2.0
    assert wrong > near
    differs, best = scan.nearest(cubic[2:])
    assert (differs, best.hypothesis.effects) == (near, (cubic[2],))
