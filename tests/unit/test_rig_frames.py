"""Structures that are no cutting machine: finite elements against textbook cases, campaigns against the package."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

pytest.importorskip("exudyn")

import cutvib_ss as cv
from cutvib_ss.validation.rig import draw_case, write_campaign
from cutvib_ss.validation.rig.assembly import assembled
from cutvib_ss.validation.rig.elements import beam_element, plate_element
from cutvib_ss.validation.rig.frames import TOLERANCES, draw_frame
from cutvib_ss.validation.rig.motion import frequency_response

LEVELS = {"levels": (50.0,), "blows": 1, "overloads": 0}


def test_a_clamped_beam_has_its_textbook_frequencies() -> None:
    n, length, mu = 12, 1.7, 5.0
    mass, stiffness = np.zeros((2 * n + 2,) * 2), np.zeros((2 * n + 2,) * 2)
    for i in range(n):
        m, k = beam_element(length / n, 300.0, mu)
        at = np.arange(2 * i, 2 * i + 4)
        mass[np.ix_(at, at)] += m
        stiffness[np.ix_(at, at)] += k
    omega = np.sqrt(eigh(stiffness[2:, 2:], mass[2:, 2:], eigvals_only=True)[:3])
    exact = np.array([1.875104, 4.694091, 7.854757]) ** 2 * np.sqrt(300.0 / mu) / length**2
    assert omega == pytest.approx(exact, rel=2e-4)


def test_a_simply_supported_plate_has_its_textbook_frequency() -> None:
    # ω = π² (1/a² + 1/b²) √(D/ρh); the element converges from below as its mesh is refined
    a, b, n, density = 1.2, 0.8, 8, 10.0
    m, k = plate_element(a / n, b / n, density, 0.3)
    size = 3 * (n + 1) ** 2
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    for i in range(n):
        for j in range(n):
            nodes = [i * (n + 1) + j, (i + 1) * (n + 1) + j, (i + 1) * (n + 1) + j + 1, i * (n + 1) + j + 1]
            at = np.array([3 * c + d for c in nodes for d in range(3)])
            mass[np.ix_(at, at)] += m
            stiffness[np.ix_(at, at)] += k
    held = []
    for i in range(n + 1):
        for j in range(n + 1):
            if i in (0, n) or j in (0, n):
                node = 3 * (i * (n + 1) + j)
                held += [node] + ([node + 1] if i in (0, n) else []) + ([node + 2] if j in (0, n) else [])
    kept = np.setdiff1d(np.arange(size), held)
    part = np.ix_(kept, kept)
    first = np.sqrt(eigh(stiffness[part], mass[part], eigvals_only=True, subset_by_index=(0, 0))[0])
    assert first == pytest.approx(np.pi**2 * (a**-2 + b**-2) / np.sqrt(density), rel=0.02)


def test_structures_are_of_every_kind_of_3_to_60_coordinates_and_sound() -> None:
    rng = np.random.default_rng(2)
    frames = [draw_frame(rng) for _ in range(60)]
    assert {f.kind for f in frames} == {"chain", "beam", "frame", "plate"}
    assert {c.order for f in frames for c in f.channels} == {0, 1, 2}
    for f in frames:
        assert 3 <= len(f.mass) <= 60
        assert np.linalg.eigvalsh(f.mass).min() > 0
        assert np.linalg.eigvalsh(f.stiffness).min() > -1e-6 * np.abs(f.stiffness).max()
        assert np.linalg.eigvalsh(f.damping).min() > -1e-6 * np.abs(f.damping).max()
        assert 2 <= len(f.channels) <= len(f.ports) <= 8
        rows = [row / np.linalg.norm(row) for row in f.ports.values()]
        assert np.abs(np.array(rows) @ np.array(rows).T - np.eye(len(rows))).max() < 1 - 1e-9, (
            "no two ports are one place"
        )
    for port, k in next(f for f in frames if f.kind == "chain" and f.springs).springs.items():
        assert k > 0, port


@pytest.mark.parametrize("seed", range(4))
def test_the_package_reads_the_structure_and_shows_the_same(seed: int, tmp_path: Path) -> None:
    case = draw_case(seed, "none", conditions=LEVELS, traits=("structure",))
    write_campaign(case, tmp_path)
    campaign = cv.read_campaign(tmp_path)
    freq, nominal = np.arange(15.0, 450.0, 5.0), case.nominal.frame
    mine = frequency_response(nominal, assembled(nominal, None), 2j * np.pi * freq)
    model = campaign.machine
    form = {0: "receptance", 1: "mobility", 2: "accelerance"}[nominal.channels[0].order]
    theirs = cv.frequency_response(model, None, freq, form=form).data[0, :, 0]
    assert mine == pytest.approx(theirs, rel=1e-6, abs=1e-9 * np.abs(theirs).max())
    assert model.tolerance.stiffness == TOLERANCES["stiffness"]
    assert len(campaign.records) == len(case.campaign.records)
    assert {r.session for r in campaign.records} == {str(s + 1) for s in case.campaign.sessions}
    assert set(campaign.records[0].channels) <= {c.name for c in nominal.channels}


def test_causes_at_a_port_name_it_and_laws_are_stepped_in_time() -> None:
    for cause in ("added_mass", "cubic_stiffness", "bilinear_stiffness"):
        case = draw_case(5, "single", cause, (1.0, 1.001), LEVELS, ("structure",))
        (fault,) = case.faults
        assert fault.place in case.nominal.frame.ports
        assert case.label["machine"] in ("chain", "beam", "frame", "plate")
        assert cause != "added_mass" or case.gap_sigma > 0.05
    shift = draw_case(5, "single", "parameter_shift", (1.0, 1.001), LEVELS, ("structure",)).faults[0]
    assert shift.place == "structure"


def test_a_cause_that_only_the_cutting_machine_has_stays_there() -> None:
    assert (
        draw_case(5, "single", "rail_torsion", conditions=LEVELS, traits=("structure",)).label["machine"]
        == "cutting_machine"
    )


def test_a_free_beam_moves_as_its_matrices_say_whatever_rounding_does() -> None:
    # a pole of zero that is double has residues by rounding in the first-order form: a direct term in the velocity
    frame = next(
        f for f in (draw_frame(np.random.default_rng(s)) for s in range(200)) if np.linalg.cond(f.stiffness) > 1e10
    )
    s = 2j * np.pi * np.array([2.0, 30.0, 200.0, 1000.0]) + 1.5
    for factor in (1.0, 0.9976, 0.9995, 1.0013, 1.03):
        moved = frame.scaled({"stiffness": factor, "damping": factor**2})
        rows = np.array([moved.ports[c.port] * 1.0 for c in moved.channels])
        drive = moved.ports[moved.drive]
        exact = [rows @ np.linalg.solve(x**2 * moved.mass + x * moved.damping + moved.stiffness, drive) for x in s]
        order = np.array([c.order for c in moved.channels])[:, None]
        expected = np.array(exact).T * s**order
        found = frequency_response(moved, moved.linearised(), s)
        assert np.abs(found - expected).max() < 2e-6 * np.abs(expected).max(axis=1).min()
