"""Causes in several physical forms, and outside the catalogue: each is drawn, is labelled, and differs from the catalogue's own."""

import numpy as np
import pytest

pytest.importorskip("exudyn")

from cutvib_ss.validation.rig import CAUSES, OUTSIDE_KINDS, draw_case
from cutvib_ss.validation.rig.assembly import assembled
from cutvib_ss.validation.rig.causes import FORMS, FRAME_CAUSES
from cutvib_ss.validation.rig.fittings import Bob, Lossy, Skew, Tie, combination
from cutvib_ss.validation.rig.laws import KINDS, STATES, VALUES, advance, force
from cutvib_ss.validation.rig.motion import frequency_response
from cutvib_ss.validation.rig.multibody import attached, build, linearise
from cutvib_ss.validation.rig.outside import OUTSIDE
from cutvib_ss.validation.rig.structure import Rig

SMALL = {"positions": (0.2, 0.6), "levels": (50.0,), "blows": 1, "overloads": 0}
S = 2j * np.pi * np.arange(15.0, 450.0, 2.0)
EVERY = [(cause, form) for cause, forms in FORMS.items() for form in forms]


def test_every_cause_has_at_least_three_forms_of_which_the_catalogue_has_one() -> None:
    assert set(CAUSES) == {*FORMS, "modal_truncation"}
    for cause, forms in FORMS.items():
        assert len(forms) >= 3, cause
        assert [f.grade for f in forms].count(0) == 1, cause
        assert forms[0].grade == 0, cause
        assert len({f.name for f in forms}) == len(forms)
        assert max(f.grade for f in forms) >= 2, cause


def test_there_are_ten_kinds_outside_beyond_the_first_thirteen() -> None:
    assert len(OUTSIDE_KINDS) >= 23
    assert not set(OUTSIDE_KINDS) & set(CAUSES)


@pytest.mark.parametrize(("cause", "form"), EVERY, ids=lambda x: getattr(x, "name", x))
def test_every_form_is_drawn_labelled_and_changes_the_machine(cause: str, form: object) -> None:
    case = draw_case(11, "single", cause, (1.0, 1.001), SMALL, form=form.name)
    (fault,) = case.faults
    assert (fault.effect, fault.form, fault.grade) == (cause, form.name, form.grade)
    assert case.rig != case.plain
    assert all(isinstance(value, str) or np.isfinite(value) for value in fault.parameters.values())
    if case.rig.linear and case.rig.chain == case.plain.chain:
        change = shown(case.rig) - shown(case.plain)
        assert np.linalg.norm(change) > 0.004 * np.linalg.norm(shown(case.plain))


def shown(rig: Rig, position: float = 0.37) -> np.ndarray:
    return frequency_response(rig, assembled(rig, position), S)


def test_varied_cases_have_another_form_and_say_so() -> None:
    cases = [draw_case(seed, "single", traits=("varied",)) for seed in range(40)]
    grades = [case.faults[0].grade for case in cases if case.faults[0].effect != "modal_truncation"]
    assert min(grades) >= 1
    assert {1, 2} <= set(grades)
    assert all(case.faults[0].grade == 0 for case in (draw_case(seed, "single") for seed in range(10)))


def test_places_that_are_physically_the_same_are_in_the_label() -> None:
    label = draw_case(3, "outside", "eddy_brake", conditions=SMALL).label
    assert (label["place"], label["equivalent_places"]) == ("tool", ["head_base"])
    assert draw_case(3, "single", "tool_contact", conditions=SMALL).label["equivalent_places"] == []


# --- what the elements do ---------------------------------------------------------------------------------------------


def test_a_combination_of_ports_is_read() -> None:
    assert combination("tool_x-base_x") == {"tool_x": 1.0, "base_x": -1.0}
    assert combination("0.9*tool_x-0.4358*tool_z") == {"tool_x": 0.9, "tool_z": -0.4358}
    assert combination("rail@0.25") == {"rail@0.25": 1.0}


def test_ties_and_sprung_masses_are_what_arithmetic_on_receptances_makes_of_them() -> None:
    # an element z at a drive point: α' = α / (1 + α z)
    plain = shown(Rig())[0] / S**2
    tie = Tie("tool_x", 2e5, 30.0, 0.02)
    z = tie.stiffness + tie.damping * S + tie.mass * S**2
    assert shown(Rig().fitted(ties=(tie,)))[0] / S**2 == pytest.approx(plain / (1 + plain * z), rel=1e-6)
    bob, omega = Bob("tool_x", 0.05, 180.0, 0.03), 2 * np.pi * 180.0
    spring = bob.mass * (omega**2 + 2 * bob.damping_ratio * omega * S)
    z = spring * bob.mass * S**2 / (spring + bob.mass * S**2)
    assert shown(Rig().fitted(bobs=(bob,)))[0] / S**2 == pytest.approx(plain / (1 + plain * z), rel=1e-6)
    lossy = Lossy("tool_x", "maxwell", (3e5, 1e-3))
    assert shown(Rig().fitted(lossy=(lossy,)))[0] / S**2 == pytest.approx(
        plain / (1 + plain * 3e5 * S * 1e-3 / (1 + S * 1e-3)), rel=1e-6
    )


def test_a_point_under_the_head_is_the_base() -> None:
    at_point = shown(Rig().fitted(ties=(Tie("rail@0.37", mass=5.0),)))
    at_base = shown(Rig().fitted(ties=(Tie("base_x", mass=5.0),)))
    assert at_point == pytest.approx(at_base, rel=1e-6)
    elsewhere = shown(Rig().fitted(ties=(Tie("rail@0.60", mass=5.0),)))
    assert np.linalg.norm(elsewhere - at_base) > 0.02 * np.linalg.norm(at_base)


def test_a_rotor_couples_two_directions_and_does_no_work() -> None:
    machine = linearise(build(Rig(), 0.37))
    spun = attached(machine, Rig().fitted(skews=(Skew("tool_x", "tool_z", 400.0),)).fittings)
    gyroscopic = spun.damping - machine.damping
    assert gyroscopic == pytest.approx(-gyroscopic.T)
    assert np.abs(gyroscopic).max() > 0


def test_hysteresis_has_its_loss_and_storage_where_it_says() -> None:
    at = np.array([2j * np.pi * 80.0])
    order = 2 / np.pi * np.arctan(0.1)
    causal = Lossy("joint1", "storage", (5e5, 2 * np.pi * 80.0, order)).stiffness(at)[0]
    assert causal == pytest.approx(5e5 * 0.1j, abs=1e-6)
    logarithmic = Lossy("joint1", "log", (5e4, 2 * np.pi * 80.0)).stiffness(at)[0]
    assert logarithmic == pytest.approx(5e4j, abs=1e-6)
    assert Lossy("joint1", "constant", (5e4,)).stiffness(at)[0] == 5e4j


def pushed(kind: str, values: tuple[float, ...], path: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Force of an element that is led along a path."""
    v, state = np.zeros(VALUES), np.zeros(STATES)
    v[: len(values)] = values
    out, last = [], 0.0
    for i, y in enumerate(path):
        rate = (y - last) / step
        out.append(force(KINDS[kind], v, y, rate, state, i * step, step))
        advance(KINDS[kind], v, y, rate, state, step)
        last = y
    return np.array(out)


CYCLE = 1e-3 * np.sin(np.linspace(0.0, 6 * np.pi, 30001))


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("jenkins", (0.3, 5e3)),
        ("iwan", (2e3, 6e-4, -0.5)),
        ("dahl", (0.3, 5e3)),
        ("lugre", (0.3, 0.45, 0.5, 2e4, 0.0)),
        ("tanh_friction", (0.3, 0.02)),
    ],
)
def test_friction_loses_energy_in_every_cycle_and_the_same_in_each(kind: str, values: tuple[float, ...]) -> None:
    f = pushed(kind, values, CYCLE)
    work = [-np.trapezoid(f[part], CYCLE[part]) for part in (slice(10000, 20001), slice(20000, 30001))]
    assert work[0] > 1e-4
    assert work[1] == pytest.approx(work[0], rel=1e-3)


def test_limit_cases_of_the_laws() -> None:
    one_way = np.linspace(0.0, 5e-3, 5001)
    assert pushed("dahl", (0.3, 5e3), one_way)[-1] == pytest.approx(-0.3, rel=1e-6), "Dahl's limit"
    assert pushed("dahl", (0.3, 5e3), one_way)[1] == pytest.approx(-5e3 * 1e-6, rel=0.01), "Dahl's first stiffness"
    iwan = pushed("iwan", (2e3, 6e-4, -0.5), one_way)
    assert iwan[1] == pytest.approx(-2e3 * 1e-6, rel=0.05), "before any slider slides"
    assert iwan[-1] == pytest.approx(-2e3 * 6e-4 / 3, rel=0.01), (
        "all slide: k times the mean reach, 1/3 of the last at -0.5"
    )
    slow = pushed("lugre", (0.3, 0.45, 0.5, 2e4, 0.0), one_way, step=1e-2)
    fast = pushed("lugre", (0.3, 0.45, 0.5, 2e4, 0.0), one_way, step=1e-7)
    assert slow[-1] == pytest.approx(-0.45, rel=0.01), "static friction when slow"
    assert fast[-1] == pytest.approx(-0.3, rel=0.01), "kinetic friction when fast"
    y = np.linspace(-1e-3, 1e-3, 101)
    smooth, sharp = (pushed("rounded_freeplay", (2e-4, 1e3, r), y) for r in (1e-9, 1e-4))
    assert smooth == pytest.approx(pushed("freeplay", (2e-4, 1e3), y), abs=1e-5)
    assert np.abs(sharp - smooth).max() > 0.01
    hertz = pushed("preloaded_hertz", (1e6, 1e-5), 1e-9 * y)
    assert np.abs(hertz).max() < 1e-6 * 1e6 * 1e-12 / 1e-5 * 1e6, "no change of slope at rest"
    assert pushed("one_sided", (5e-4, 1e4, 0.0), y)[[0, -1]] == pytest.approx([0.0, -5.0])


def test_structures_can_have_what_the_list_says() -> None:
    assert set(FRAME_CAUSES) <= set(CAUSES)
    assert sum(kind.frames for kind in OUTSIDE.values()) >= 8
