"""The absorber: Sherman-Morrison and the attached subsystem are one."""

from pathlib import Path

import control
import numpy as np
import pytest

from cutvib_ss.absorber import (
    MountedAbsorber,
    absorbed_response,
    attach_absorber,
    attach_absorbers,
    check_absorber,
    dynamic_stiffness,
    sherman_morrison,
)
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model_files import read_machine, write_machine
from cutvib_ss.parameters import AbsorberParameters, table_7
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import ComplexArray
from tests.unit.diagnosis_example import example_structure

FREQ = np.arange(2.0, 600.0, 1.5)
MACHINE = published_machine()
PORTS = ("tool_x", "tool_z", "base", "joint2")
TOLERANCE = 1e-9


def differ(one: ComplexArray, other: ComplexArray) -> float:
    return float(np.abs(one - other).max() / np.abs(other).max())


@pytest.mark.parametrize("port", ["tool_x", "base"])
def test_eq_23_and_the_attached_subsystem_agree(port: str) -> None:
    before, after = (
        frequency_response(m, [0.1, 1 / 3, 0.5], FREQ, form="receptance", inputs=PORTS, outputs=PORTS)
        for m in (MACHINE, attach_absorber(MACHINE, table_7(), port))
    )
    modified = sherman_morrison(before.data, PORTS.index(port), dynamic_stiffness(table_7(), FREQ))
    assert differ(modified, after.data) < TOLERANCE
    assert differ(before.data, after.data) > 1e-3


def test_the_augmented_plant_agrees_too() -> None:
    plant = attach_absorber(MACHINE, table_7()).plant(0.5, outputs=["tool_x", "tool_z", "base_x"])
    assert plant.nstates == MACHINE.plant(0.5).nstates + 2
    by_control = control.frequency_response(plant, 2 * np.pi * FREQ).frdata
    before = frequency_response(MACHINE, 0.5, FREQ, form="receptance")
    assert differ(absorbed_response(before, table_7()).data[0], by_control) < TOLERANCE


def test_it_is_eq_23_as_printed() -> None:
    a = frequency_response(MACHINE, 0.4, FREQ, form="receptance", inputs=PORTS, outputs=PORTS).data[0]
    z, r = dynamic_stiffness(table_7(), FREQ), 0
    bracket = a[r, r] * a - a[:, r, None] * a[None, r, :]
    assert differ((a + z * bracket) / (1 + z * a[r, r]), sherman_morrison(a, r, z)) < TOLERANCE


def test_eq_24_as_printed() -> None:
    w, a = 2 * np.pi * FREQ, table_7()
    k, c, m = a.stiffness, a.damping, a.mass
    printed = (-(w**2) * m * k - 1j * w**3 * m * c) / (k - w**2 * m + 1j * w * c)
    assert differ(dynamic_stiffness(a, FREQ), printed) < 1e-12
    # Well below its tuning the absorber is its mass, and no spring to ground.
    assert dynamic_stiffness(a, [1.0])[0] == pytest.approx(-((2 * np.pi) ** 2) * m, rel=1e-3)


@pytest.mark.parametrize("form", ["receptance", "mobility", "accelerance"])
def test_every_form_keeps_its_form(form: str) -> None:
    before, after = (
        frequency_response(m, [0.2, 0.5], FREQ, form=form) for m in (MACHINE, attach_absorber(MACHINE, table_7()))
    )
    modified = absorbed_response(before, table_7())
    assert modified.quantities == before.quantities
    assert differ(modified.data, after.data) < TOLERANCE


def test_under_an_exponential_window() -> None:
    before, after = (
        frequency_response(m, 0.5, FREQ, decay_rate=6.0) for m in (MACHINE, attach_absorber(MACHINE, table_7()))
    )
    assert differ(absorbed_response(before, table_7()).data, after.data) < TOLERANCE


def test_a_massless_absorber_would_change_nothing() -> None:
    before = frequency_response(MACHINE, 0.5, FREQ)
    light = absorbed_response(before, AbsorberParameters(212.0, 0.04, 1e-12))
    assert differ(light.data, before.data) < 1e-9


def test_absorbers_are_written_and_read_back_below_the_effects(tmp_path: Path) -> None:
    mounted = (MountedAbsorber(table_7()), MountedAbsorber(AbsorberParameters(434.0, 0.02, 0.03), "head_z"))
    corrected = LocalResonator("head", 0.5, 180.0, 0.03).apply(MACHINE)
    for model in (attach_absorbers(MACHINE, mounted), attach_absorbers(corrected, mounted)):
        write_machine(model, tmp_path / "machine.toml")
        text = (tmp_path / "machine.toml").read_text()
        assert text.count("[[absorber]]") == 2
        back = read_machine(tmp_path / "machine.toml")
        assert [a.port for a in back.attachments][:2] == ["tool_x", "head_z"]
        assert len(back.effects) == len(model.effects)
        one, other = (frequency_response(m, [0.3], FREQ).data for m in (model, back))
        assert np.array_equal(one, other)
        known = back if back.bare is None else back.bare
        assert len(known.attachments) == 2


def test_a_structure_keeps_its_absorber_too(tmp_path: Path) -> None:
    structure = example_structure()
    port = next(iter(structure.system.ports))
    write_machine(attach_absorber(structure, table_7(), port), tmp_path / "two.toml")
    assert read_machine(tmp_path / "two.toml").attachments == attach_absorber(structure, table_7(), port).attachments


def test_what_is_not_a_square_matrix_is_refused() -> None:
    with pytest.raises(ParameterError, match="square"):
        sherman_morrison(np.ones((2, 3, 4)), 0, np.ones(4))
    with pytest.raises(ParameterError, match="coordinate = 2"):
        sherman_morrison(np.ones((2, 2, 4)), 2, np.ones(4))
    with pytest.raises(ParameterError, match="no output"):
        absorbed_response(frequency_response(MACHINE, 0.5, FREQ, outputs=("tool_z",)), table_7())


def test_the_check_finds_the_worst_position() -> None:
    check = check_absorber(MACHINE, table_7(), np.linspace(0.05, 0.95, 19))
    where, left = check.worst
    assert left == check.after.max()
    assert where in check.positions
    assert check.frf_after.data.shape == check.frf_before.data.shape == (19, 1, 1, 601)
    with pytest.raises(ValueError, match="read-only"):
        check.after[0] = 0.0
