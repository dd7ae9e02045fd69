"""A structure on a shaker: relative and absolute motion, by all routes, against the transmissibility of one degree of freedom."""

from pathlib import Path

import control
import numpy as np
import pytest

import cutvib_ss as cv
from cutvib_ss.cli import main
from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.response.modal_form import base_motion, modal_form
from cutvib_ss.response.stepping import step

M, C, K = 2.0, 12.0, 5000.0
FREQ = np.array([1.0, 5.0, 7.96, 12.0, 40.0])
S = 2j * np.pi * FREQ
# By hand: m (x + b)'' + c x' + k x = 0, so that X/A = -m/(k + sc + s²m) and the absolute Y/B = (k + sc)/(k + sc + s²m).
RELATIVE = -M / (K + S * C + S**2 * M)
TRANSMISSIBILITY = (K + S * C) / (K + S * C + S**2 * M)
FILE = f"""
[model]
kind = "second_order"
dofs = ["x"]
mass = [[{M}]]
damping = [[{C}]]
stiffness = [[{K}]]
[ports]
base = [1.0]
[channels]
a = {{ port = "base", quantity = "acceleration" }}
a_rel = {{ port = "base", quantity = "acceleration", absolute = false }}
v = {{ port = "base", quantity = "velocity", absolute = true }}
x = {{ port = "base", quantity = "displacement" }}
x_abs = {{ port = "base", quantity = "displacement", absolute = true }}
[input]
base_acceleration = "base"
"""
EXPECTED = {
    "a": TRANSMISSIBILITY,
    "a_rel": S**2 * RELATIVE,
    "v": TRANSMISSIBILITY / S,
    "x": RELATIVE,
    "x_abs": TRANSMISSIBILITY / S**2,
}


@pytest.fixture
def shaken(tmp_path: Path) -> cv.Structure:
    file = tmp_path / "machine.toml"
    file.write_text(FILE)
    found = cv.read_machine(file)
    assert isinstance(found, cv.Structure)
    return found


def test_frequency_responses_are_those_by_hand(shaken: cv.Structure) -> None:
    frf = cv.frequency_response(shaken, None, FREQ)
    for name, expected in EXPECTED.items():
        assert frf.sel(output=name).data.ravel() == pytest.approx(expected, rel=1e-12), name
    # At rest and below any resonance the mass moves with the base.
    assert cv.frequency_response(shaken, None, [0.0], outputs=["a"]).data.item() == pytest.approx(1.0, abs=1e-9)


def test_a_window_decays_absolute_motion_too(shaken: cv.Structure) -> None:
    s = S + 3.0
    frf = cv.frequency_response(shaken, None, FREQ, outputs=["a", "v"], decay_rate=3.0)
    expected = (K + s * C) / (K + s * C + s**2 * M)
    assert frf.data[0, :, 0] == pytest.approx(np.array([expected, expected / s]), rel=1e-12)


def test_the_plant_has_the_absolute_acceleration_and_refuses_what_integrates(shaken: cv.Structure) -> None:
    plant = shaken.plant(outputs=["a", "a_rel", "x"])
    found = control.frequency_response(plant, 2 * np.pi * FREQ).frdata[:, 0]
    assert found == pytest.approx(np.array([EXPECTED[n] for n in ("a", "a_rel", "x")]), rel=1e-9)
    with pytest.raises(CouplingError, match="integrates"):
        shaken.plant(outputs=["v"])


# Steps take the acceleration as band-limited between its samples, the others as linear.
@pytest.mark.parametrize(("route", "tolerance"), [("time_response", 1e-8), ("step", 1e-3)])
def test_time_responses_are_those_of_the_transmissibility(shaken: cv.Structure, route: str, tolerance: float) -> None:
    # The absolute motion of a mass on a base is one force-driven oscillator: forced by k b + c b'.
    fs, t = 500.0, np.arange(2000) / 500.0
    a = np.sin(2 * np.pi * 3.0 * t) ** 3 * np.exp(-4.0 * t)
    if route == "step":
        shown = step(modal_form(shaken), a[None], fs).responses[0]
    else:
        shown = cv.time_response(shaken, None, a, fs).data
    own = control.ss([[0, 1], [-K / M, -C / M]], [[0], [-1.0]], [[1, 0]], [[0]])
    x = control.forced_response(own, t, a).outputs
    v, b = base_motion(a, fs, 1), base_motion(a, fs, 0)
    xdot = control.forced_response(control.ss(own.A, own.B, [[0, 1]], [[0]]), t, a).outputs
    expected = {
        "x": x,
        "x_abs": x + b,
        "v": xdot + v,
        "a": -(K * x + C * xdot) / M,
        "a_rel": -a - (K * x + C * xdot) / M,
    }
    for k, name in enumerate(shaken.channels):
        assert np.abs(shown[k] - expected[name]).max() < tolerance * np.abs(expected[name]).max(), name


def test_the_base_s_motion_is_the_integral_of_its_acceleration() -> None:
    fs, t = 2000.0, np.arange(4000) / 2000.0
    w = 2 * np.pi * 2.0
    assert base_motion(np.sin(w * t), fs, 1) == pytest.approx((1 - np.cos(w * t)) / w, abs=1e-6)
    assert base_motion(np.sin(w * t), fs, 0) == pytest.approx(t / w - np.sin(w * t) / w**2, abs=1e-6)
    one = np.sin(w * np.arange(1000) / fs)
    assert base_motion(one, fs, 0, periodic=True) == pytest.approx(-one / w**2, rel=1e-4, abs=1e-9)
    with pytest.raises(ParameterError, match="mean"):
        base_motion(one + 0.1, fs, 0, periodic=True)


def test_it_reads_back_with_its_choices(shaken: cv.Structure, tmp_path: Path) -> None:
    cv.write_machine(shaken, tmp_path / "again.toml")
    again = cv.read_machine(tmp_path / "again.toml")
    assert {n: c.absolute for n, c in again.channels.items()} == {
        "a": True, "a_rel": False, "v": True, "x": False, "x_abs": True,
    }  # fmt: skip
    assert again.input_quantity == "acceleration"
    one, other = (cv.frequency_response(m, None, FREQ).data for m in (shaken, again))
    assert np.array_equal(one, other)


def test_pulses_of_a_shaken_base_are_accelerations(
    shaken: cv.Structure, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cv.write_machine(shaken, tmp_path / "machine.toml")
    assert (
        main(["simulate", "--machine", str(tmp_path / "machine.toml"), "--duration", "0.05", "--amplitude", "3"]) == 0
    )
    assert "pulses of 3 m/s^2 at 217 Hz" in capsys.readouterr().out
