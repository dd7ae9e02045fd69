"""Records whose force acts elsewhere than at the model's input: roving hammers, several references, blows on the rail."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss import read_campaign
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.linearity import motions
from cutvib_ss.diagnosis.modification import Lines
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.place import locate
from cutvib_ss.diagnosis.prediction import Prediction
from cutvib_ss.diagnosis.records import Records, merged
from cutvib_ss.diagnosis.simulated import simulated
from cutvib_ss.diagnosis.simulation import SimulatedProblem
from cutvib_ss.diagnosis.variants import variants
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.effects.guide_compliance import GuideCompliance
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.inputs import struck_port
from cutvib_ss.measurement.replay import assumed_blow
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.paths import value_at, with_values
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.stepping import modal_form, step
from tests.unit.record_example import entry_of

MASS = np.diag([2.0, 1.5, 1.0, 1.2])
STIFFNESS = 1e5 * np.array([[5.0, -2.0, 0, 0], [-2.0, 4.5, -2.5, 0], [0, -2.5, 4.0, -1.5], [0, 0, -1.5, 3.0]])
DAMPING = 8e-5 * STIFFNESS + 2.0 * MASS
FREQ = np.arange(20.0, 160.0, 0.5)
PORTS = ("p1", "p2", "p3", "p4")
NOISE = 2e-4
EXTRA = 2.4e4
"""Stiffness to ground at p3 that the model lacks [N/m]."""


def structure() -> Structure:
    """Four masses in a chain, a hammer that roves, one accelerometer at p1."""
    rows = {name: np.eye(4)[k] for k, name in enumerate(PORTS)}
    system = SecondOrder(MASS, DAMPING, STIFFNESS, ("x1", "x2", "x3", "x4"), rows)
    return Structure(system, {"a": Channel("p1", "acceleration")}, "p1")


def roving(inputs, seed=0):
    """One record a hammer point, from the matrices alone: H = -w² e1ᵀ (K + iwC - w²M)^-1 e_j."""
    rng, entries = np.random.default_rng(seed), []
    stiffness = STIFFNESS.copy()
    stiffness[2, 2] += EXTRA
    w = 2 * np.pi * FREQ[:, None, None]
    h = np.linalg.inv(stiffness + 1j * w * DAMPING - w**2 * MASS) * -(w**2)
    for k, name in enumerate(inputs):
        struck = PORTS[k]
        data = h[:, 0, PORTS.index(struck)][None]
        data = data + NOISE / np.sqrt(2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
        entries.append(
            entry_of(
                k, None, None, data, np.full(data.shape, NOISE**2), FREQ, ("a",), ("acceleration",), session="day",
                input="force" if name == "p1" else name,
            )
        )  # fmt: skip
    return Records(tuple(entries))


def test_a_roving_hammer_finds_the_spring_where_it_is():
    records = roving(PORTS)
    assert len(records.merged) == 1  # One group: the records share what is unknown.
    model = structure()
    none = fit(model, records, Hypothesis())
    fits = {p: fit(model, records, Hypothesis((ToolContact(p, 1e4, 1.0),))) for p in PORTS}
    best = max(fits, key=lambda p: fits[p].log_evidence)
    assert best == "p3"
    assert fits["p3"].reduced < 1.1
    # Errors of single parts, and modes that are left out, take the spring up, at a price.
    assert fits["p3"].log_evidence > none.log_evidence + 10.0
    assert fits["p3"].hypothesis.effects[0].stiffness == pytest.approx(EXTRA, rel=0.01)
    found = locate(model, none, records.entries, 0.0, False)
    assert found.best == "p3"


def test_a_wrong_input_changes_the_answer():
    right, wrong = roving(PORTS), roving(("p1", "p3", "p2", "p4"))
    model, cause = structure(), Hypothesis((ToolContact("p3", 1e4, 1.0),))
    assert fit(model, right, cause).reduced < 1.1
    assert fit(model, wrong, cause).reduced > 100.0


MACHINE = published_machine()
LINES = np.arange(18.0, 400.0, 6.0)
CHANNELS = ("tool_x", "tool_z", "base_x")
STRUCK = ("force", "rail@0.25", "head_x", "rail@0.7")


def on_the_machine(inputs, level=None, position=0.4):
    """Empty records of the machine, one an input."""
    empty = np.zeros((3, LINES.size), dtype=complex)
    replay = None if level is None else assumed_blow(LINES, 0.5, 0.05, level)
    return [
        entry_of(
            k, position, level, empty, np.full(empty.shape, 1e-6), LINES, CHANNELS, ("acceleration",) * 3, block=0.5, blow_at=0.05,
            replay=replay, input=name,
        )
        for k, name in enumerate(inputs)
    ]  # fmt: skip


def dense(machine, s, position=0.4):
    """Accelerance of each input by the matrices, shape (input, channel, line)."""
    points = {name: float(name[5:]) for name in STRUCK if name.startswith("rail@")}
    system = machine.second_order(position, points=points)
    inverse = np.linalg.inv(system.dynamic_stiffness(s))
    reads = np.array([system.port(p) for p in ("tool_x", "tool_z", "base")])
    drives = np.array([system.port("tool_x" if p == "force" else p) for p in STRUCK])
    return np.einsum("oi,fij,pj->pof", reads, inverse, drives) * s**2


def test_each_record_is_predicted_at_its_own_input():
    (group,) = merged(on_the_machine(STRUCK))
    group = replace(group, block=np.full(4, np.inf))
    np.testing.assert_allclose(Prediction(MACHINE, group).data, dense(MACHINE, 2j * np.pi * LINES), rtol=1e-8)


@pytest.mark.parametrize("path", [("head", "k2"), ("rail", "parameters", "mass"), ("head", "c1")])
def test_derivatives_of_a_blow_on_the_rail(path):
    (group,) = merged(on_the_machine(STRUCK))
    value = value_at(MACHINE, path)
    here = Prediction(MACHINE, group)
    sides = [
        Prediction(with_values(MACHINE, {path: value * (1 + h)}), group, 0.0, here.circles).data for h in (1e-5, -1e-5)
    ]
    change = (sides[0] - sides[1]) / (2e-5 * value)
    assert np.abs(here.derivative(((path, 1.0),)) - change).max() < 1e-5 * np.abs(change).max()


def modification(place, name, machine=MACHINE):
    """A fault of a place in records of all inputs, and its lines."""
    (group,) = merged(on_the_machine(STRUCK))
    group = replace(group, block=np.full(4, np.inf))
    nothing = np.zeros(group.data.shape, dtype=complex)
    lines = Lines(machine, group, nothing, np.ones((4, 1, 1)))
    (variant,) = [v for v in variants(machine, CHANNELS) if (v.place, v.name) == (place, name)]
    return variant.at(lines, variant.starts[0] if variant.starts else 0.0), lines.s, group


@pytest.mark.parametrize(
    ("place", "name", "effect", "functions"),
    [
        ("head_base", "guide", GuideCompliance("head_base", 3e7, 200.0), lambda s: [1 / (3e7 + 200.0 * s)]),
        (
            "rail_ends", "supports", SupportCompliance("rail_ends", 2e7, 5e7, 100.0, 0.0),
            lambda s: [1 / (2e7 + 100.0 * s), 1 / (5e7 + 0 * s)],
        ),
        ("rail_ends", "slopes", EndFixity("rail_ends", 2e5, 4e5), lambda s: [2e5 + 0 * s, 4e5 + 0 * s]),
        ("tool", "tool_x", ToolContact("tool", 1e5, 20.0), lambda s: [1e5 + 20.0 * s]),
    ],
)  # fmt: skip
def test_faults_are_seen_from_every_input(place, name, effect, functions):
    m, s, group = modification(place, name)
    value = np.array(functions(s))[:, None]
    expected = Prediction(effect.apply(MACHINE), group).data
    np.testing.assert_allclose(m.shown(value), expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["relative mass", "relative stiffness"])
def test_a_rail_that_is_heavier_or_stiffer_is_seen_from_every_input(name):
    rail = MACHINE.rail.parameters
    # c = 2 ζ m ω follows the mass or the frequency, which the fault does not touch.
    factor = {"relative mass": (1.2, 1.2**-0.5, 1.2**-0.5), "relative stiffness": (1.0, 1.2**0.5, 1.2**-0.5)}[name]
    other = replace(
        rail, mass=rail.mass * factor[0], first_frequency=rail.first_frequency * factor[1],
        damping_ratio=rail.damping_ratio * factor[2],
    )  # fmt: skip
    m, s, group = modification("rail", name)
    value = np.full((1, 1, s.size), 0.2 + 0j)
    expected = Prediction(replace(MACHINE, rail=replace(MACHINE.rail, parameters=other)), group).data
    shown, slope = m.sloped(value)
    np.testing.assert_allclose(shown, expected, atol=1e-6 * np.abs(expected).max())
    change = (m.shown(value + 1e-6) - m.shown(value - 1e-6)) / 2e-6
    np.testing.assert_allclose(slope[0], change, atol=1e-5 * np.abs(change).max())


def test_a_law_is_simulated_under_a_blow_elsewhere():
    law = CubicStiffness("joint2", 4e9).apply(MACHINE)
    (group,) = merged(on_the_machine(STRUCK, 60.0), apart=True)
    shown = simulated(law, group)
    for row, name in enumerate(STRUCK):
        replay = group.entries[row][0].replay
        run = step(modal_form(law, 0.4, CHANNELS, input=name), np.stack(replay.forces), replay.fs, law.nonlinear)
        expected = replay.data(list(run.responses))
        assert np.abs(shown.data[row] - expected).max() < 1e-3 * np.abs(expected).max()
    plain = simulated(MACHINE, group).data
    apart = np.abs(plain - Prediction(MACHINE, group, 0.05).data).max(axis=(1, 2))
    assert (apart < 1e-2 * np.abs(plain).max(axis=(1, 2))).all()


def test_derivatives_of_a_simulated_law_under_blows_elsewhere():
    records = Records(tuple(on_the_machine(("force", "rail@0.25"), 60.0)))
    problem = SimulatedProblem(MACHINE, records.apart_groups(), Hypothesis((CubicStiffness("joint2", 4e9),)))
    x = problem.start()
    (p,), _, _ = problem.residuals(x)
    slopes = problem._slopes(x, p)
    moved = x.copy()
    k2 = next(i for i, (path, _) in enumerate(problem.tuning) if path[-1] == "k2")
    moved[k2] += 0.02
    (q,), _, _ = problem.residuals(moved)
    change = (q.data - p.data) / 0.02
    for row in range(2):
        along = np.vdot(change[row], slopes[k2][row]).real
        assert along > 0.95 * np.linalg.norm(change[row]) * np.linalg.norm(slopes[k2][row])


def test_a_place_moves_as_the_blow_elsewhere_moves_it():
    by_force, on_rail = (
        motions(MACHINE, Records(tuple(on_the_machine((name,), 60.0))))["joint2"] for name in STRUCK[:2]
    )
    assert by_force.high > 2 * on_rail.high > 0.0


def test_the_input_goes_from_the_file_to_the_fit(tmp_path):
    (tmp_path / "records").mkdir()
    h = dense(MACHINE, 2j * np.pi * LINES)
    for k in range(3):
        table = np.column_stack([LINES, *(part for row in h[k] for part in (row.real, row.imag))])
        head = ",".join(["freq [Hz]", *(f"{c} {part} [m/s^2/N]" for c in CHANNELS for part in ("re", "im"))])
        np.savetxt(tmp_path / f"records/{k}.csv", table, delimiter=",", header=head, comments="")
    records = "\n".join(
        f'[[record]]\nfile = "records/{k}.csv"\nkind = "frf"\nexcitation = "random"\nposition = 0.4\n'
        + ("" if name == "force" else f'input = "{name}"\n')
        for k, name in enumerate(STRUCK[:3])
    )
    (tmp_path / "campaign.toml").write_text(f'[campaign]\ntitle = "roving"\n{records}')
    campaign = read_campaign(tmp_path)
    assert campaign.records[1].frf.inputs == ("rail@0.25",)
    seen = observe(campaign, campaign.machine)
    assert [e.input for e in seen.entries] == list(STRUCK[:3])
    (group,) = merged(seen.entries)
    assert np.abs(Prediction(MACHINE, group).data - group.data).max() < 1e-6 * np.abs(group.data).max()
    assert group.inputs == STRUCK[:3]


def test_a_hammer_on_a_structure_that_is_shaken_is_refused():
    shaken = replace(structure(), input_quantity="acceleration")
    assert struck_port("p1", shaken, "record[1]") is None
    with pytest.raises(DataFormatError, match="acceleration of its base"):
        struck_port("p2", shaken, "record[1]")
