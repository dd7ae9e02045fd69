"""Parts of a structure differ by themselves within the tolerance of their matrix; springs in reduced coordinates."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy import linalg

from cutvib_ss.diagnosis.candidate_evidence import out_of_tolerance
from cutvib_ss.diagnosis.discrepancy import weights
from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypotheses import Candidate, candidates
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.linearity import _in_band
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scouting import beside_parts
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknowns import tuning_paths
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.structural_damping import StructuralDamping
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.frequency import frequency_response
from tests.unit.record_example import entry_of

MASS = np.diag([2.0, 1.0, 1.0])
STIFFNESS = np.array([[5e4, -3e4, 0.0], [-3e4, 5e4, -2e4], [0.0, -2e4, 2e4]])
PORTS = {"base": [1.0, 0.0, 0.0], "tip": [0.0, 0.0, 1.0], "upper": [0.0, -1.0, 1.0], "both": [-1.0, 0.0, 1.0]}


def of(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray, ports: dict[str, np.ndarray]) -> Structure:
    system = SecondOrder(mass, damping, stiffness, ("a", "b", "c"), ports)
    return Structure(system, {"y": Channel("tip", "acceleration")}, "base")


def structure(turned: np.ndarray | None = None) -> Structure:
    """A chain of three masses, its coordinates turned if need be."""
    t = np.eye(3) if turned is None else turned
    matrices = [t.T @ m @ t for m in (MASS, 1e-4 * STIFFNESS, STIFFNESS)]
    return of(*matrices, {name: t.T @ np.array(row) for name, row in PORTS.items()})


def test_what_a_part_may_differ_by_is_tolerated() -> None:
    chain = structure()
    # Two percent each, of a spring of 2e4 N/m, of a mass of 1 kg.
    assert ToolContact("upper", 600.0, 0.0).tolerated(chain)
    assert ToolContact("upper", -600.0, 0.0).tolerated(chain)
    assert not ToolContact("upper", 1000.0, 0.0).tolerated(chain)
    assert not ToolContact("upper", 600.0, 50.0).tolerated(chain)
    assert AddedMass("tip", 0.03).tolerated(chain)
    assert not AddedMass("tip", 0.06).tolerated(chain)
    # Nothing holds the tip to ground: a spring there is no part of the model.
    assert not ToolContact("tip", 10.0, 0.0).tolerated(chain)


def test_the_spring_of_a_port_in_modal_coordinates() -> None:
    chain = structure()
    rng = np.random.default_rng(1)
    turned = structure(np.linalg.qr(rng.standard_normal((3, 3)))[0])
    spring, same = chain.spring_at("upper"), turned.spring_at("upper")
    assert spring is not None
    assert same is not None
    # In a chain that is held at its base the static stiffness between two masses is that of the spring.
    assert same[0] == pytest.approx(spring[0], rel=1e-9)


def test_a_port_that_floats_has_no_spring() -> None:
    free = STIFFNESS.copy()
    free[0, 0] -= 2e4
    t = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    ports = {name: t.T @ np.array(row) for name, row in PORTS.items()}
    floating = of(t.T @ MASS @ t, 1e-4 * t.T @ free @ t, t.T @ free @ t, ports)
    assert floating.spring_at("tip") is None
    found = floating.spring_at("both")
    assert found is not None
    assert found[0] == pytest.approx(1.0 / (1.0 / 3e4 + 1.0 / 2e4))


def test_what_wanders_off_is_no_motion_in_the_band() -> None:
    time = np.arange(8000) / 400.0
    ringing = 1e-4 * np.sin(2 * np.pi * 40.0 * time)
    found = _in_band((ringing + 1e-3 * time)[None, None], 400.0, 20.0)
    # 20 mm of wander; where a record is cut off in full swing the filter rings a little.
    np.testing.assert_allclose(found[0, 0, 2000:6000], ringing[2000:6000], atol=1e-6)
    assert np.abs(found).max() < 1.5e-4


def measured(truth: Structure, nominal: Structure, seed: int) -> Records:
    """Three sessions of a structure as its matrices give it, which drifts by 0.1 % between them."""
    rng, freq = np.random.default_rng(seed), np.linspace(8.0, 45.0, 150)
    entries = []
    for k in range(3):
        s = 2j * np.pi * freq
        moved = 1 + 1e-3 * rng.standard_normal()
        rows = []
        for z in s:
            system = truth.system
            q = np.linalg.solve(
                system.mass * z**2 + system.damping * z + moved * system.stiffness, system.ports["base"]
            )
            rows.append([z**2 * (system.ports[p] @ q) for p in ("base", "tip")])
        data = np.array(rows).T
        variance = np.full(data.shape, (1e-3 * np.abs(data).max()) ** 2)
        noise = np.sqrt(variance / 2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
        entries.append(
            entry_of(k, None, 1.0, data + noise, variance, freq, ("b", "t"), ("acceleration", "acceleration"))
        )
    return Records(tuple(entries))


def chain_of(to_ground: float = 2e4, lower: float = 3e4, upper: float = 2e4, tip: float = 1.0) -> Structure:
    stiffness = np.array([[to_ground + lower, -lower, 0.0], [-lower, lower + upper, -upper], [0.0, -upper, upper]])
    ports = {name: np.array(row) for name, row in PORTS.items()}
    out = of(np.diag([2.0, 1.0, tip]), 1e-4 * STIFFNESS, stiffness, ports)
    return replace(out, channels={"b": Channel("base", "acceleration"), "t": Channel("tip", "acceleration")})


@pytest.mark.parametrize("seed", [1, 2])
def test_springs_that_differ_one_by_one_are_no_gap(seed: int) -> None:
    nominal, rng = chain_of(), np.random.default_rng(10 + seed)
    k = [value * (1 + 0.01 * rng.standard_normal()) for value in (2e4, 3e4, 2e4)]
    records = measured(chain_of(*k), nominal, seed)
    none = fit(nominal, records, Hypothesis())
    assert none.reduced < 1.15
    assert none.spread.sizes.parts > 1e-2
    mass = fit(nominal, records, Hypothesis((AddedMass("tip", 0.02),)))
    assert mass.log_evidence < none.log_evidence + 1.0
    # Matrices that are right up to one factor each take more drift and discrepancy, and are less likely.
    exact = replace(nominal, system=replace(nominal.system))
    exact.system.__dict__["parts"] = ()
    without = fit(replace(exact, parts=()), records, Hypothesis())
    assert without.log_evidence < none.log_evidence - 10.0


@pytest.mark.parametrize("springs", [3, 4, 6])
def test_modes_drift_by_half_of_what_springs_do(springs: int) -> None:
    rng, own, turned = np.random.default_rng(springs), [], []
    ends = np.eye(springs) - np.eye(springs, k=-1)
    for _ in range(100):
        stiffness, mass = rng.uniform(0.3, 3.0, springs), np.diag(rng.uniform(0.5, 2.0, springs))
        squares, shapes = linalg.eigh(ends.T @ np.diag(stiffness) @ ends, mass)
        # By how much each spring moves each mode: its share of the strain energy.
        shares = (stiffness[:, None] * (ends @ shapes) ** 2 / squares).T
        assert shares.sum(axis=1) == pytest.approx(1.0)
        own.append(np.sqrt(np.mean(np.sum((shares - shares.mean(axis=0)) ** 2, axis=1))))
        # By how much it turns each mode into the others, on either side of the diagonal.
        between = np.sqrt(shares @ shares.T)[np.triu_indices(springs, 1)]
        turned.append(np.sqrt(np.mean(between**2)))
    assert np.mean(own) == pytest.approx(SETTINGS.discrepancy_modes_drift, rel=0.2)
    assert np.mean(turned) == pytest.approx(SETTINGS.discrepancy_modes_drift, rel=0.3)


def test_modes_drift_by_themselves_and_into_each_other() -> None:
    problem = Problem(chain_of(), measured(chain_of(), chain_of(), 2).merged, Hypothesis())
    drift, _ = weights(problem)
    whole = next(i for i, (path, _) in enumerate(problem.tuning) if path == ("scales", 2))
    parts = chain_of().matrix_parts
    for i, (path, _) in enumerate(problem.tuning):
        if path[0] == "parts":
            part = parts[int(path[1])]
            alone = part.modes[0] == part.modes[1]
            expected = {0: 1.0 if alone else 2.0, 1: float(alone), 2: 0.0}[part.power]
            assert drift[i] == pytest.approx(expected * SETTINGS.discrepancy_modes_drift * drift[whole])


def test_a_mass_stands_out_of_springs_that_differ() -> None:
    nominal = chain_of()
    records = measured(chain_of(2.02e4, 2.97e4, 2e4, tip=1.15), nominal, 3)
    none = fit(nominal, records, Hypothesis())
    mass = fit(nominal, records, Hypothesis((AddedMass("tip", 0.1),)))
    assert mass.log_evidence > none.log_evidence + 10.0
    (found,) = mass.hypothesis.effects
    assert isinstance(found, AddedMass)
    assert found.mass == pytest.approx(0.15, abs=0.03)
    assert mass.spread.sizes.parts < none.spread.sizes.parts


def test_the_size_of_a_cause_is_held_against_what_is_known_beside_errors_of_parts() -> None:
    """A mass of 8 % on a floor whose tolerance is 2 % was nothing: errors of parts may take its place, which evidence weighs."""
    nominal = chain_of()
    found = fit(
        nominal, measured(chain_of(2.02e4, 2.97e4, 2e4, tip=1.08), nominal, 3), Hypothesis((AddedMass("tip", 0.05),))
    )
    assert found.stds_beside["0.mass"] < 0.8 * found.stds["0.mass"]
    (mass,) = found.hypothesis.effects
    assert isinstance(mass, AddedMass)
    between = (found.stds["0.mass"] + found.stds_beside["0.mass"]) / 2
    hardly = replace(found, hypothesis=Hypothesis((replace(mass, mass=SETTINGS.verdict_size * between),)))
    assert hardly.of_no_size == ()
    assert replace(hardly, stds_beside=found.stds).of_no_size == hardly.hypothesis.effects
    # Without parts the two are the same.
    exact = replace(nominal, system=replace(nominal.system))
    exact.system.__dict__["parts"] = ()
    alone = fit(replace(exact, parts=()), measured(chain_of(), nominal, 3), Hypothesis((AddedMass("tip", 0.05),)))
    assert alone.stds_beside == alone.stds


def test_what_leads_beside_errors_of_parts_is_fitted_on_all_lines() -> None:
    nominal = chain_of()
    records = measured(chain_of(2.02e4, 2.97e4, 2e4, tip=1.15), nominal, 3)
    few = records.coarse(SETTINGS.search_coarse_lines, SETTINGS.search_coarse_error)
    mass, spring = AddedMass("tip", 0.1), ToolContact("upper", 100.0, 0.0)
    rough = [(Candidate(e.effect, (e,)), fit(nominal, few, Hypothesis((e,)))) for e in (spring, mass)]
    # Beside the widened noise no part errs.
    assert all(not f.x[list(Problem(nominal, records.merged, Hypothesis()).parts.matrices)].any() for _, f in rough)
    ranked = [Ranked(c.name, f, False) for c, f in rough]
    with Workers(1, None) as workers:
        found = {r.name: r for r in beside_parts(nominal, records, few, rough, ranked, workers)}
    assert set(found) == {"added_mass", "tool_contact"}
    assert found["added_mass"].refined
    none = fit(nominal, records, Hypothesis())
    assert found["added_mass"].fit.log_evidence > none.log_evidence + 10.0


def test_of_many_parts_out_of_tolerance_the_farthest_is_told() -> None:
    nominal = structure()
    paths = [path for path, _ in tuning_paths(nominal)]
    x = np.zeros(len(paths))
    x[[i for i, path in enumerate(paths) if path[0] == "parts"][:2]] = 4.0, -5.0
    fitted = cast(Fit, SimpleNamespace(x=x, n_tuning=x.size, gains={}))
    [told] = out_of_tolerance(nominal, fitted)
    assert told.startswith("with this answer a part of the structure's matrices is 5.0 tolerances off (-")
    x[paths.index(("scales", 2))] = 6.0
    assert out_of_tolerance(nominal, fitted)[0].startswith(
        "with this answer the stiffness as a whole is 6.0 tolerances off (+"
    )


@pytest.mark.parametrize(("port", "spring"), [("upper", 2e4), ("base", 2e4)])
@pytest.mark.parametrize("form", ["constant", "causal"])
def test_a_spring_with_a_loss_factor_in_place_of_its_damper(port: str, spring: float, form: str) -> None:
    nominal, loss = chain_of(), 0.2
    row, s = np.array(PORTS[port]), 2j * np.pi * np.linspace(8.0, 45.0, 150)
    alpha = 2 / np.pi * np.arctan(loss)
    own = {
        "constant": spring * (1 + 1j * loss) + 0 * s,
        "causal": spring * np.sqrt(1 + loss**2) * (s / (2 * np.pi * 20.0)) ** alpha,
    }[form]
    system, effect = nominal.system, StructuralDamping(port, loss, form, 20.0)
    rows = []
    for z, k in zip(s, own, strict=True):
        less = system.damping * z + system.stiffness + (k - spring - 1e-4 * spring * z) * np.outer(row, row)
        rows.append(z**2 * np.linalg.solve(system.mass * z**2 + less, system.ports["base"])[[0, 2]])
    data, freq = np.array(rows).T, s.imag / (2 * np.pi)
    seen = frequency_response(effect.apply(nominal), None, freq).data[0, :, 0]
    np.testing.assert_allclose(seen, data, rtol=1e-9)
    # A second one without loss finds no damper to take away.
    again = StructuralDamping(port, 0.0, "constant").apply(effect.apply(nominal))
    np.testing.assert_allclose(frequency_response(again, None, freq).data[0, :, 0], data, rtol=1e-9)
    variance = np.full(data.shape, (1e-3 * np.abs(data).max()) ** 2)
    entry = entry_of(0, None, 1.0, data, variance, freq, ("b", "t"), ("acceleration", "acceleration"))
    found = fit(nominal, Records((entry,)), Hypothesis((replace(effect, loss_factor=0.08),)))
    assert found.hypothesis.effects[0].loss_factor == pytest.approx(loss, rel=0.02)
    assert {port} == {
        c.starts[0].place
        for c in candidates(nominal, (8.0, 45.0), ("b",))
        if c.name.startswith(f"structural_damping {port} ")
    }


def test_no_loss_factor_where_no_single_spring_is() -> None:
    turned = structure(np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0])
    assert turned.spring_at("upper", 1) is None
    assert StructuralDamping.places(turned) == ()
    with pytest.raises(ParameterError, match="cannot sit at"):
        StructuralDamping("upper", 0.1).apply(turned)
