"""Results print as short tables, draw themselves, and become objects of other libraries; signals have their own units."""

import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import cutvib_ss as cv
from cutvib_ss.absorber import workspace_check
from cutvib_ss.identification import held_response
from cutvib_ss.plot.style import figure_of
from cutvib_ss.results.display import Displayed
from tests.unit.diagnosis_example import example_diagnosis

MACHINE = cv.published_machine()
FREQ = np.arange(20.0, 400.0, 1.0)


@pytest.fixture(scope="module")
def results() -> dict[str, Displayed]:
    force = cv.pulse_train(8000.0, 0.05)
    return {
        "frf": cv.frequency_response(MACHINE, [0.25, 0.5], FREQ),
        "modes": cv.modes(MACHINE, 0.5),
        "tracked": cv.track_modes(MACHINE, np.linspace(0.1, 0.9, 9)),
        "time": cv.time_response(MACHINE, 0.5, force, 8000.0, outputs="tool_x"),
        "absorber": cv.check_absorber(MACHINE, cv.AbsorberParameters(212.0, 0.04, 0.08)),
        "study": cv.parametric_study(MACHINE, tuning=[210.0, 212.0], damping_ratio=[0.01, 0.04]),
        "workspace": workspace_check(MACHINE, [cv.MountedAbsorber(cv.AbsorberParameters(212.0, 0.04, 0.08))]),
        "stabilisation": cv.stabilisation(cv.frequency_response(MACHINE, 0.5, FREQ)),
        "diagnosis": example_diagnosis(lines=60, records=1),
    }


@pytest.mark.parametrize(
    "name", ["frf", "modes", "tracked", "time", "absorber", "study", "workspace", "stabilisation", "diagnosis"]
)
def test_a_result_prints_short_shows_in_notebooks_and_draws_itself(results: dict[str, Displayed], name: str) -> None:
    result = results[name]
    text = str(result)
    assert text == repr(result)
    assert 2 <= len(text.splitlines()) <= 15
    assert max(map(len, text.splitlines())) <= 132
    assert "<table>" in result._repr_html_()
    figure = figure_of(result.plot())  # type: ignore[attr-defined]
    assert isinstance(figure, Figure)
    assert figure.axes
    pyplot = sys.modules.get("matplotlib.pyplot")
    assert pyplot is None or not pyplot.get_fignums()


def test_a_machine_a_family_and_a_campaign_print_short() -> None:
    campaign = str(cv.read_campaign(Path(cv.__file__).parent / "data" / "demo"))
    assert "5 records" in campaign
    assert "0.27" in campaign
    family = str(cv.schedule(MACHINE, [0.2, 0.4]))
    assert "2 positions (0.2 to 0.4), 12 states" in family
    assert "24.88, 0.6" in str(MACHINE)
    assert "head_x" not in str(MACHINE)
    assert len(str(MACHINE).splitlines()) < 14
    assert repr(MACHINE).startswith("Machine(head=HeadParameters(m1=24.88")


def test_rotations_and_modal_coordinates_have_their_own_units() -> None:
    frf = cv.frequency_response(MACHINE, 0.5, [50.0], form="receptance", outputs=["tool_x", "joint1", "eta1"])
    assert frf.units == ("m/N", "rad/N", "kg^0.5 m/N")
    assert frf.unit == "m/N, rad/N, kg^0.5 m/N"
    assert frf.to_form("accelerance").units == ("m/s^2/N", "rad/s^2/N", "kg^0.5 m/s^2/N")
    torque = cv.frequency_response(MACHINE, 0.5, [50.0], form="receptance", outputs="joint1", inputs=["joint2", "eta2"])
    assert torque.input_units == ("N m", "kg^-0.5 N")
    assert torque.unit_of("joint1", "joint2") == "rad/(N m)"
    assert torque.sel(input="eta2").unit == "rad/(kg^-0.5 N)"
    history = cv.time_response(MACHINE, 0.5, np.ones(8), 1000.0, outputs=["joint2", "eta1"], quantity="velocity")
    assert history.units == ("rad/s", "kg^0.5 m/s")


def test_a_modal_coordinate_s_unit_is_that_of_mass_normalised_shapes() -> None:
    # A rail a hundred times as heavy and as stiff moves a hundredth; its modal coordinates, ∝ √mass, a tenth.
    from dataclasses import replace

    heavy = replace(MACHINE.rail.parameters, mass=100 * MACHINE.rail.parameters.mass)
    freq = np.array([1.0])
    light = cv.frequency_response(MACHINE, 0.3, freq, form="receptance", outputs="eta1")
    other = replace(MACHINE, rail=replace(MACHINE.rail, parameters=heavy))
    static = cv.frequency_response(other, 0.3, freq, form="receptance", outputs="eta1")
    assert abs(static.data.item() / light.data.item()) == pytest.approx(0.1, rel=0.02)


def test_a_string_is_one_name_and_a_point_of_the_rail_may_be_written_as_in_a_campaign() -> None:
    frf = cv.frequency_response(MACHINE, 0.5, FREQ, inputs="rail@0.25", outputs="tool_x")
    other = cv.frequency_response(MACHINE, 0.5, FREQ, inputs=["rail(0.25)"], outputs=["tool_x"])
    assert frf.inputs == ("rail@0.25",)
    assert np.array_equal(frf.data, other.data)
    assert MACHINE.plant(0.5, inputs="head_x", outputs="tool_x").output_labels == ["tool_x"]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda: cv.frequency_response(MACHINE, 0.5, FREQ, form="accel"), "receptance, mobility, accelerance"),
        (lambda: MACHINE.plant(0.5, quantity="accel"), "displacement, velocity, acceleration"),
        (lambda: cv.frequency_response(MACHINE, 0.5, FREQ, outputs="tool"), "tool_x"),
        (lambda: MACHINE.plant(0.5, inputs="t"), "tool_x"),
        (lambda: cv.modes(MACHINE, 0.5).sel(output="eta9"), "eta1, eta2"),
        (lambda: cv.identify(held_response(MACHINE.head, FREQ), base="free"), "held, rail"),
        (lambda: cv.identify(held_response(MACHINE.head, FREQ), weighting="none"), "paper, variance"),
        (lambda: cv.modes(MACHINE, 0.5).sel(input="force"), "no inputs"),
        (lambda: cv.schedule(MACHINE, [0.2, 0.4], quantity="accel"), "displacement, velocity, acceleration"),
        (lambda: cv.time_response(MACHINE, 0.5, np.ones(9), 1e3, quantity="accel"), "displacement, velocity"),
        (lambda: cv.frequency_response(MACHINE, 0.5, FREQ).sel(position=0.4), "0.5"),
    ],
)
def test_a_wrong_choice_is_answered_by_the_choices(wrong, said: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(cv.ParameterError, match=said):
        wrong()


def test_sel_takes_the_same_labels_on_every_result(results: dict[str, Displayed]) -> None:
    for result, position, output in (
        (results["frf"], 0.5, "tool_x"), (results["modes"], 0.5, "theta1"), (results["tracked"], 0.5, "eta1"),
        (results["time"], 0.5, "tool_x"), (results["absorber"], 0.5, "tool_x"), (results["workspace"], 0.5, "tool_x"),
    ):  # fmt: skip
        part = result.sel(position=position, output=output)  # type: ignore[attr-defined]
        assert type(part) is type(result)
        with pytest.raises(cv.ParameterError):
            result.sel(position=0.123)  # type: ignore[attr-defined]


def test_tables_of_pandas_and_xarray_hold_the_same_numbers(results: dict[str, Displayed]) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    frf = results["frf"]
    assert isinstance(frf, cv.FrequencyResponse)
    table = frf.to_dataframe()
    assert table.loc[(0.5, 217.0), ("tool_x", "force", "m/s^2/N")] == frf.sel(position=0.5).data[0, 0, 0, 197]
    data = frf.to_xarray()
    assert (
        data["response"].sel(position=0.5, output="base_x", input="force", freq=217.0).item() == frf.data[1, 2, 0, 197]
    )
    modes, tracked, history = results["modes"], results["tracked"], results["time"]
    assert modes.to_dataframe().loc[1, "natural_freq [Hz]"] == modes.natural_freq[0]  # type: ignore[attr-defined]
    assert tracked.to_xarray()["natural_freq"].sel(position=0.5, mode=2).item() == tracked.natural_freq[4, 1]  # type: ignore[attr-defined]
    assert history.to_dataframe()["tool_x [m/s^2]"].iloc[3] == history.data[0, 3]  # type: ignore[attr-defined]


def test_a_missing_library_is_named_with_how_to_install_it(
    results: dict[str, Displayed], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(cv.CutvibError, match=r"pip install 'cutvib_ss\[data\]'"):
        results["frf"].to_dataframe()  # type: ignore[attr-defined]
