"""Results print as short tables, draw themselves, and become objects of other libraries; signals have their own units."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import cutvib_ss as cv
from cutvib_ss.absorber import workspace_check
from cutvib_ss.identification import held_response
from cutvib_ss.plot.style import figure_of
from cutvib_ss.response.travel import standing
from cutvib_ss.results.display import Displayed
from tests.unit.diagnosis_example import example_diagnosis

MACHINE = cv.published_machine()
FREQ = np.arange(20.0, 400.0, 1.0)


ABSORBER = cv.AbsorberParameters(212.0, 0.04, 0.08)
PLACES = [0.1, 0.3, 0.5]

SHOWN = {"_repr_html_", "plot"}
TABLE = {*SHOWN, "to_dataframe"}
ARRAY = {*TABLE, "to_xarray", "sel"}
METHODS = {
    "AbsorberCheck": ARRAY,
    "AbsorberDesign": TABLE,
    "AbsorberStudy": ARRAY,
    "Diagnosis": TABLE,
    "FrequencyResponse": ARRAY,
    "IdentificationResult": TABLE,
    "MeasuredFrequencyResponse": ARRAY,
    "Modes": ARRAY,
    "MovingResponse": ARRAY,
    "Plan": {"_repr_html_", "to_dataframe"},
    "PlantSchedule": {"_repr_html_", "sel"},
    "Stabilisation": TABLE,
    "TimeResponse": ARRAY,
    "TrackedModes": ARRAY,
    "WorkspaceCheck": ARRAY,
}
INPUTS = {"Campaign", "Machine", "Structure"}
"""What prints short too, but is given and not computed."""


@pytest.fixture(scope="module")
def results() -> dict[str, Displayed]:
    force = cv.pulse_train(8000.0, 0.05)
    campaign = cv.read_campaign(Path(cv.__file__).parent / "data" / "demo")
    made: list[Displayed] = [
        cv.frequency_response(MACHINE, [0.25, 0.5], FREQ),
        cv.estimate(campaign.records[0]),
        cv.modes(MACHINE, 0.5),
        cv.track_modes(MACHINE, np.linspace(0.1, 0.9, 9)),
        cv.time_response(MACHINE, 0.5, force, 8000.0, outputs="tool_x"),
        cv.moving_response(MACHINE, standing(0.5), force, 8000.0, outputs="tool_x"),
        cv.check_absorber(MACHINE, ABSORBER),
        cv.parametric_study(MACHINE, tuning=[210.0, 212.0], damping_ratio=[0.01, 0.04]),
        workspace_check(MACHINE, [cv.MountedAbsorber(ABSORBER)]),
        cv.design_absorbers(MACHINE, 0.08, positions=PLACES),
        cv.stabilisation(cv.frequency_response(MACHINE, 0.5, FREQ)),
        cv.identify(held_response(MACHINE.head, FREQ)),
        cv.schedule(MACHINE, PLACES, outputs=["tool_x", "base_x"]),
        cv.plan(MACHINE, cv.PlannedCampaign((0.4,), band=(150.0, 300.0)), laws=False),
        example_diagnosis(lines=60, records=1),
    ]
    return {type(result).__name__: result for result in made}


@pytest.mark.parametrize("name", sorted(METHODS))
def test_a_result_has_the_methods_of_its_kind(results: dict[str, Displayed], name: str) -> None:
    """
    Every result prints short and shows in notebooks; what else it has depends on what it holds.

    `sel` is of arrays over positions, outputs or inputs: absorbers of a design, parameters, causes and poles have none, and
    the responses among them (`IdentificationResult.measured`, `Diagnosis.comparisons`) are cut themselves.
    `to_xarray` is of arrays with axes: the same ones lack it, for a table is all they are.
    `PlantSchedule` holds matrices to be evaluated at a position, no numbers over an axis: `state_matrices` gives them, and its
    `frequency_response` has tables, labels and a picture. A plan is a table without a picture.
    """
    result = results[name]
    text = str(result)
    assert text == repr(result)
    assert 2 <= len(text.splitlines()) <= 15
    assert max(map(len, text.splitlines())) <= 132
    offered = {
        method for method in ("_repr_html_", "plot", "sel", "to_dataframe", "to_xarray") if hasattr(result, method)
    }
    assert offered == METHODS[name]
    assert "<table>" in result._repr_html_()
    if "plot" in offered:
        figure = figure_of(result.plot())  # type: ignore[attr-defined]
        assert isinstance(figure, Figure)
        assert figure.axes
        pyplot = sys.modules.get("matplotlib.pyplot")
        assert pyplot is None or not pyplot.get_fignums()
    if "sel" in offered:
        assert type(result.sel()) is type(result)  # type: ignore[attr-defined]
        for wrong in ({"position": 0.123}, {"output": "nowhere"}, {"input": "nowhere"}):
            with pytest.raises(cv.ParameterError):
                result.sel(**wrong)  # type: ignore[attr-defined]
    if "to_dataframe" in offered:
        pandas = pytest.importorskip("pandas")
        table = result.to_dataframe()  # type: ignore[attr-defined]
        assert isinstance(table, pandas.DataFrame)
        assert not table.empty
    if "to_xarray" in offered:
        xarray = pytest.importorskip("xarray")
        data = result.to_xarray()  # type: ignore[attr-defined]
        assert isinstance(data, xarray.Dataset)
        assert data.data_vars


def test_no_result_is_left_out() -> None:
    public = {n for n in cv.__all__ if isinstance(c := getattr(cv, n), type) and issubclass(c, Displayed)}
    assert public - INPUTS == set(METHODS)


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
        (results["FrequencyResponse"], 0.5, "tool_x"), (results["Modes"], 0.5, "theta1"), (results["TrackedModes"], 0.5, "eta1"),
        (results["TimeResponse"], 0.5, "tool_x"), (results["AbsorberCheck"], 0.5, "tool_x"),
        (results["WorkspaceCheck"], 0.5, "tool_x"), (results["AbsorberStudy"], [1 / 3, 0.5], "tool_x"),
        (results["PlantSchedule"], [0.1, 0.5], "base_x"),
    ):  # fmt: skip
        part = result.sel(position=position, output=output)  # type: ignore[attr-defined]
        assert type(part) is type(result)
        with pytest.raises(cv.ParameterError):
            result.sel(position=0.123)  # type: ignore[attr-defined]


def test_tables_of_pandas_and_xarray_hold_the_same_numbers(results: dict[str, Displayed]) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    frf = results["FrequencyResponse"]
    assert isinstance(frf, cv.FrequencyResponse)
    table = frf.to_dataframe()
    assert table.loc[(0.5, 217.0), ("tool_x", "force", "m/s^2/N")] == frf.sel(position=0.5).data[0, 0, 0, 197]
    data = frf.to_xarray()
    assert (
        data["response"].sel(position=0.5, output="base_x", input="force", freq=217.0).item() == frf.data[1, 2, 0, 197]
    )
    modes, tracked, history = results["Modes"], results["TrackedModes"], results["TimeResponse"]
    assert modes.to_dataframe().loc[1, "natural_freq [Hz]"] == modes.natural_freq[0]  # type: ignore[attr-defined]
    assert tracked.to_xarray()["natural_freq"].sel(position=0.5, mode=2).item() == tracked.natural_freq[4, 1]  # type: ignore[attr-defined]
    assert history.to_dataframe()["tool_x [m/s^2]"].iloc[3] == history.data[0, 3]  # type: ignore[attr-defined]


def test_tables_of_absorbers_parameters_and_causes_hold_the_same_numbers(results: dict[str, Displayed]) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    check, study, over = (results[name] for name in ("AbsorberCheck", "AbsorberStudy", "WorkspaceCheck"))
    assert isinstance(check, cv.AbsorberCheck)
    assert check.to_dataframe().loc[0.5, "after [m/s^2/N]"] == check.after[1]
    assert check.to_xarray()["before"].sel(position=0.5).item() == check.before[1]
    assert isinstance(study, cv.AbsorberStudy)
    assert study.to_dataframe().loc[(210.0, 0.04), "worst [m/s^2/N]"] == study.worst[0, 1]
    assert study.to_xarray()["worst"].sel(tuning=212.0, damping_ratio=0.01).item() == study.worst[1, 0]
    assert isinstance(over, cv.WorkspaceCheck)
    assert over.to_dataframe().loc[0.5, "toleranced [m/s^2]"] == over.toleranced[49]
    assert over.to_xarray()["exact"].sel(position=0.5).item() == over.exact[49]
    design, found, plan = (results[name] for name in ("AbsorberDesign", "IdentificationResult", "Plan"))
    assert isinstance(design, cv.AbsorberDesign)
    assert design.to_dataframe().loc[1, "tuning [Hz]"] == design.mounted[0].absorber.frequency
    assert isinstance(found, cv.IdentificationResult)
    parameters = found.to_dataframe()
    for e in found.determination.parameters:
        assert parameters.loc[e.name, ["value", "unit", "status"]].tolist() == [e.value, e.unit, e.status]
        low_high = parameters.loc[e.name, ["lower", "upper"]].tolist()
        assert np.isnan(low_high).all() if e.interval is None else tuple(low_high) == e.interval
    assert isinstance(plan, cv.Plan)
    causes = plan.to_dataframe()
    assert list(causes.index) == [c.name for c in plan.causes]
    unseen = [c.seen is None for c in plan.causes]
    assert causes["seen"].isna().tolist() == unseen
    stable = results["Stabilisation"]
    assert isinstance(stable, cv.Stabilisation)
    assert stable.to_dataframe()["natural_freq [Hz]"].iloc[-1] == stable.natural_freq[-1]


def test_a_part_of_a_study_names_its_own_best(results: dict[str, Displayed]) -> None:
    study = results["AbsorberStudy"]
    assert isinstance(study, cv.AbsorberStudy)
    part = study.sel(tuning=212.0, damping_ratio=[0.04, 0.01])
    assert part.worst.tolist() == [[study.worst[1, 1], study.worst[1, 0]]]
    k = int(part.worst.argmin())
    assert (part.best.frequency, part.best.damping_ratio) == (212.0, part.damping_ratio[k])
    assert part.best.mass == study.best.mass
    assert study.sel().best == study.best
    with pytest.raises(cv.ParameterError, match="together"):
        study.sel(position=0.5)
    with pytest.raises(cv.ParameterError, match="no tuning 211"):
        study.sel(tuning=211.0)


def test_a_part_of_a_family_has_the_same_plants_in_the_same_states(results: dict[str, Displayed]) -> None:
    family = results["PlantSchedule"]
    assert isinstance(family, cv.PlantSchedule)
    part = family.sel(position=[0.5, 0.1], output="base_x", input="force")
    assert part.positions.tolist() == [0.1, 0.5]
    assert part.outputs == ("base_x",)
    whole, cut = family.exact(0.1), part.exact(0.1)
    assert np.array_equal(cut.A, whole.A)
    assert np.array_equal(cut.B, whole.B)
    assert np.array_equal(cut.C, whole.C[1:])
    with pytest.raises(cv.ParameterError, match="exact"):
        family.sel(position=0.5)


def test_a_family_s_part_keeps_what_leaks_into_its_outputs() -> None:
    chain = replace(MACHINE.chain, cross_axis=0.05)
    family = cv.schedule(replace(MACHINE, chain=chain), PLACES, outputs=["base_x", "tool_z"])
    both = family.frequency_response(0.3, [100.0]).data
    # Matrices of another size are multiplied in another order: rounding apart.
    alone = family.sel(output="tool_z").frequency_response(0.3, [100.0]).data
    np.testing.assert_allclose(alone, both[:, 1:], rtol=1e-12)
    assert np.array_equal(family.sel(output="tool_z").exact(0.3).C, family.exact(0.3).C[1:])


def test_a_missing_library_is_named_with_how_to_install_it(
    results: dict[str, Displayed], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(cv.CutvibError, match=r"pip install 'cutvib_ss\[data\]'"):
        results["FrequencyResponse"].to_dataframe()  # type: ignore[attr-defined]
