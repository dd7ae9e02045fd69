"""Damping of the rail: a ratio for each mode, and the strain-rate damping of Eq. 4."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cutvib_ss as cv
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.rail import Rail, natural_frequencies, rail
from cutvib_ss.parameters import RailParameters, recovered_rail
from cutvib_ss.results import ComplexArray


def upper_poles(p: RailParameters) -> ComplexArray:
    """Poles of the rail without the head, of positive imaginary part, ascending."""
    plant = rail(Rail(p), {"here": 0.3}).state_space({"force": "here"}, {"x": ("here", "displacement")})
    upper = plant.poles()[plant.poles().imag > 0]
    return np.asarray(upper[np.argsort(np.abs(upper))])


def test_each_mode_has_its_ratio() -> None:
    ratios = (0.01, 0.02, 0.005, 0.04)
    p = replace(recovered_rail(), damping_ratio=ratios)
    assert p.damping_ratios == pytest.approx(ratios)
    upper = upper_poles(p)
    assert -upper.real / np.abs(upper) == pytest.approx(ratios)
    # A common factor keeps their proportions; modes beyond the list are damped as its last.
    assert replace(p, damping_ratio=2 * p.damping_ratio).damping_ratios == pytest.approx(2 * np.array(ratios))
    assert replace(p, n_modes=6).damping_ratios == pytest.approx((*ratios, 0.04, 0.04))
    assert replace(recovered_rail(), damping_ratio=(0.02,) * 4).damping_profile == ()
    for wrong, message in (
        ((0.01, 0.02), "2 values"),
        ((0.01, 0.02, 0.03, 1.2), "below 1"),
        ((0.01, -0.1, 0, 0), "at least 0"),
    ):
        with pytest.raises(ParameterError, match=message):
            replace(recovered_rail(), damping_ratio=wrong)


def test_strain_rate_damping_is_that_of_eq_4() -> None:
    p = replace(recovered_rail(), damping_ratio=0.0, strain_damping=3e-5)
    # c_s I of Eq. 4, on the mode sin(rπy/L): c_s I (rπ/L)⁴ L/2 against its modal mass μL/2 and frequency ω_r.
    c_s_i = p.strain_damping * p.bending_stiffness
    r = np.arange(1, 5)
    rate = c_s_i * (r * np.pi / p.length) ** 4 * (p.length / 2) / (p.mass / 2)
    expected = rate / (2 * 2 * np.pi * p.first_frequency * r**2)
    upper = upper_poles(p)
    assert -upper.real / np.abs(upper) == pytest.approx(expected)
    assert expected[1] == pytest.approx(4 * expected[0])


def test_both_are_read_and_written(tmp_path: Path) -> None:
    file = tmp_path / "machine.toml"
    file.write_text("[rail]\ndamping_ratio = [0.01, 0.02, 0.005, 0.04]\nstrain_damping = 2e-5\n")
    machine = cv.read_machine(file)
    assert machine.rail.parameters.damping_ratios == pytest.approx((0.01, 0.02, 0.005, 0.04))
    cv.write_machine(machine, tmp_path / "again.toml")
    again = cv.read_machine(tmp_path / "again.toml").rail.parameters
    assert again.damping_ratios == pytest.approx((0.01, 0.02, 0.005, 0.04))
    assert again.strain_damping == 2e-5
    file.write_text("[rail]\ndamping_ratio = [0.01, 0.02]\n")
    with pytest.raises(ParameterError, match=r"machine.toml.*2 values"):
        cv.read_machine(file)
    # Scalars are written as they were.
    cv.write_machine(cv.published_machine(), file)
    assert "damping_ratio = 0.01\n" in file.read_text()
    assert "strain" not in file.read_text()


def test_measured_frequencies_are_read_and_written(tmp_path: Path) -> None:
    file = tmp_path / "machine.toml"
    file.write_text("[rail]\nfrequency_profile = [1.01, 0.98]\n")
    machine = cv.read_machine(file)
    plain = natural_frequencies(cv.published_machine().rail.parameters)
    np.testing.assert_allclose(natural_frequencies(machine.rail.parameters)[:3] / plain[:3], (1.01, 0.98, 1.0))
    cv.write_machine(machine, tmp_path / "again.toml")
    assert cv.read_machine(tmp_path / "again.toml").rail == machine.rail
    for wrong, told in (
        ("[1, 1, 1, 1, 1]", "5 values"),
        ("[1.0, 0.0]", "frequency_profile"),
        ("[nan]", "frequency_profile"),
    ):
        file.write_text(f"[rail]\nfrequency_profile = {wrong}\n")
        with pytest.raises(ParameterError, match=f"machine.toml.*{told}"):
            cv.read_machine(file)


def test_values_are_replaced_by_name() -> None:
    machine = cv.published_machine().replace(k2=9000.0, mass=80.0, n_modes=6, tolerance_k2=0.02)
    assert (machine.head.k2, machine.rail.parameters.mass, machine.tolerance.k2) == (9000.0, 80.0, 0.02)
    assert machine.plant(0.5).nstates == 16
    with pytest.raises(ParameterError, match=r"no value 'k3'; there are m1, .*tolerance_m1, .*guide"):
        machine.replace(k3=1.0)
    with pytest.raises(ParameterError, match=r"head\.k2"):
        machine.replace(k2=-1.0)
