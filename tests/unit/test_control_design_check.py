"""The check over positions and machines, families and reduction, files and commands."""

import json
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from PIL import Image

from cutvib_ss.cli import main
from cutvib_ss.control_design import (
    PROTOTYPES,
    ControllerCheck,
    Hardware,
    InertialActuator,
    Sampling,
    ScheduledController,
    Sensor,
    check_controller,
    check_positions,
    control_plant,
    controller_data,
    full_order,
    h2,
    hinf,
    in_common_coordinates,
    lqg,
    prototype,
    read_controller,
    reduced,
    resonant,
    schedule,
    smallest_controller,
)
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.errors import DataFormatError, DesignError, ParameterError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model_files import write_machine

MACHINE = published_machine()
KIT = PROTOTYPES["h2"].hardware("head_x", Sampling())
ON_TOOL = PROTOTYPES["h2"].hardware("tool_x", Sampling())
SUPPORT = SupportCompliance("rail_ends", k_left=1.3e7, k_right=3.0e7).apply(MACHINE)


def check(controller: Any, machines: Any = MACHINE, positions: Any = (0.5,), **options: Any) -> ControllerCheck:
    return check_controller(controller, machines, positions, freq=[200.0, 217.0, 240.0], **options)


def design(name: str, position: float, kit: Any = KIT) -> control.StateSpace:
    return PROTOTYPES[name].design(MACHINE, position, kit)


@pytest.mark.parametrize("name", list(PROTOTYPES))
def test_every_prototype_works_where_it_was_designed(name: str) -> None:
    kind = prototype(name)
    kit = kind.hardware(kind.port, Sampling())
    k = kind.design(MACHINE, 0.4, kit)
    assert tuple(k.input_labels) == kit.signals
    assert tuple(k.output_labels) == kit.commands
    worst = check(k, positions=[0.4], hardware=kit).worst()
    assert worst.stable == 1
    assert worst.attenuation < 0.5
    assert worst.disk_margin > 0.25
    assert 0.0 < worst.noise_command < np.inf


def test_the_check_finds_the_positions_that_a_controller_does_not_serve() -> None:
    found = check(design("h2", 0.5), positions=[0.3, 0.5], hardware=KIT)
    assert found.stable.tolist() == [[False, True]]
    worst = found.worst()
    assert (worst.stable, worst.positions, worst.attenuation_position) == (1, 2, 0.3)
    assert np.isnan(worst.attenuation)
    assert worst.disk_margin == 0.0
    assert np.isnan(found.attenuation[0, :, 0]).all()
    assert (found.attenuation[0, 0, 1]) < 0.2
    assert 150 < found.growth_freq[0, 0] < 300


def test_the_check_finds_spillover_to_modes_that_the_design_left_out() -> None:
    kit = PROTOTYPES["lqg"].hardware("base", Sampling())
    k = lqg(control_plant(MACHINE, 0.5, kit), noise=0.004)
    assert check(k, hardware=kit, n_modes=4).worst().stable == 1
    found = check(k, hardware=kit)
    assert found.worst().stable == 0
    # The rail's fifth mode, 25 times 31.7 Hz without the head, is the first that the design did not know.
    assert 760 < found.growth_freq[0, 0] < 850
    assert full_order(MACHINE).rail.parameters.n_modes == 20
    assert full_order(full_order(MACHINE), 6).rail.parameters.n_modes == 20


def test_attenuation_is_the_sensitivity_at_the_sensor() -> None:
    k = resonant(control_plant(MACHINE, 0.3, ON_TOOL))
    found = check(k, positions=[0.2, 0.3], hardware=ON_TOOL, n_modes=4)
    for i, y in enumerate(found.positions):
        plant = control_plant(MACHINE, float(y), ON_TOOL, delayed=True)["y_tool_x", "u_tool_x"]
        s = 2j * np.pi * 217.0
        # To the accuracy of the Padé delay and of the sampled controller.
        left = abs(1 / (1 - (k * plant)(s).item()))
        assert found.after[0, 0, i] / found.passive[0, 0, i] == pytest.approx(left, rel=0.02)
        assert abs(found.open[0].data[i, 0, 0, 1]) == pytest.approx(found.before[0, 0, i], rel=1e-12)
        assert abs(found.closed[0].data[i, 0, 0, 1]) == pytest.approx(found.after[0, 0, i], rel=1e-12)
    assert found.effort.shape == (1, 2)
    assert 0.5 < found.effort.min() <= found.effort.max() < 1.0


def test_a_controller_that_the_nominal_model_likes_and_the_corrected_one_does_not() -> None:
    positions = [0.06, 0.1]
    family = schedule(lambda y: design("hinf", y), positions)
    found = check(family, {"nominal": MACHINE, "corrected": SUPPORT}, positions, hardware=KIT)
    assert found.worst("nominal").stable == 2
    assert found.worst("nominal").attenuation < 0.15
    assert found.worst("nominal").disk_margin > 0.7
    assert found.worst("corrected").stable == 0
    # The corrected machine is controllable all the same, once it is known.
    again = schedule(lambda y: PROTOTYPES["hinf"].design(SUPPORT, y, KIT), positions)
    assert check(again, SUPPORT, positions, hardware=KIT).worst().attenuation < 0.2
    with pytest.raises(ParameterError, match="nominal, corrected"):
        found.worst("other")


def test_a_family_serves_where_no_single_controller_does() -> None:
    family = schedule(lambda y: design("resonant", y), check_positions(31)[:17])
    positions = [0.05, 0.18, 0.3, 0.42, 0.5]
    worst = check(family, positions=positions, hardware=KIT).worst()
    assert worst.stable == 5
    assert worst.attenuation < 0.35
    assert worst.disk_margin > 0.8
    for harmonic in (434.0, 651.0):
        assert check(family, positions=[0.3], hardware=KIT, working_frequency=harmonic).worst().attenuation < 0.3
    alone = check(design("resonant", 0.5), positions=positions, hardware=KIT).worst()
    assert alone.attenuation > 1.0


def test_interpolation_meets_the_family_and_stays_between() -> None:
    family = schedule(lambda y: design("h2", y), [0.2, 0.24, 0.28])
    s = 2j * np.pi * np.array([100.0, 217.0])
    assert np.allclose(family.at(0.24)(s), family.controllers[1](s), rtol=1e-12)
    assert family.at(0.1) is not None
    assert np.allclose(family.at(0.9)(s), family.controllers[-1](s), rtol=1e-12)
    between = family.at(0.22)
    assert np.allclose(between.A, (family.controllers[0].A + family.controllers[1].A) / 2)
    one = ScheduledController(np.array([0.5]), (family.controllers[0],))
    assert one.at(0.1) is family.controllers[0]
    for positions, controllers, says in (
        ([0.1, 0.2], family.controllers[:1], "need as many"),
        ([0.2, 0.1], family.controllers[:2], "ascend"),
        ([0.1, 0.2], (family.controllers[0], reduced(family.controllers[1], 4)), "share"),
    ):
        with pytest.raises(ParameterError, match=says):
            ScheduledController(np.array(positions), controllers)


def test_reduced_controllers_interpolate_in_common_coordinates_only() -> None:
    places = [0.22, 0.252]
    small = [reduced(design("h2", y), 6) for y in places]
    rng = np.random.default_rng(2)
    turned = []
    for k in small:
        t = rng.normal(size=(6, 6))
        turned.append(
            control.ss(
                np.linalg.solve(t, k.A @ t), np.linalg.solve(t, k.B), k.C @ t, k.D,
                inputs=k.input_labels, outputs=k.output_labels,
            )
        )  # fmt: skip
    aligned = in_common_coordinates(turned)
    s = 2j * np.pi * np.array([50.0, 217.0, 300.0])
    for k, same in zip(small, aligned, strict=True):
        assert np.allclose(same(s), k(s), rtol=1e-6)
    left = {
        name: check(ScheduledController(np.array(places), tuple(family)), positions=[0.236], hardware=KIT).worst()
        for name, family in (("as they are", turned), ("aligned", aligned))
    }
    assert left["aligned"].attenuation < 0.2
    assert left["aligned"].disk_margin > 0.25
    assert not left["as they are"].attenuation < 0.5
    with pytest.raises(ParameterError, match="cannot be followed"):
        in_common_coordinates([small[0], reduced(design("h2", 0.22), 5)])


def test_several_actuators_and_sensors_go_the_same_way() -> None:
    kit = Hardware(
        (InertialActuator("tool_x", mass=0.08), InertialActuator("head_x")),
        (Sensor("tool_x"), Sensor("head_x", "velocity")),
    )
    for rule in (lqg, h2, hinf):
        k = rule(control_plant(MACHINE, 0.4, kit))
        assert (k.input_labels, k.output_labels) == (["y_tool_x", "y_head_x"], ["u_tool_x", "u_head_x"])
        worst = check(k, positions=[0.4], hardware=kit).worst()
        assert worst.stable == 1
        assert worst.attenuation < 0.15
        # All loops at once bear no more than each alone.
        alpha = worst.disk_margin
        assert 0.0 < 20 * np.log10((2 + alpha) / (2 - alpha)) <= worst.gain_margin
        assert 2 * np.degrees(np.arctan(alpha / 2)) <= worst.phase_margin
    (aligned,) = in_common_coordinates([reduced(k, 8)])
    s = 2j * np.pi * np.array([30.0, 217.0])
    assert np.allclose(aligned(s), reduced(k, 8)(s), rtol=1e-6)


def test_the_error_of_a_reduction_keeps_its_bound() -> None:
    plant = control_plant(MACHINE, 0.3, ON_TOOL)["y_tool_x", "u_tool_x"]
    rate = 1e3  # Hankel singular values do not depend on the unit of time; SLICOT's accuracy does
    scaled = control.ss(plant.A / rate, plant.B / rate**0.5, plant.C / rate**0.5, plant.D)
    sizes = control.hankel_singular_values(scaled)
    for order in (4, 8):
        small = reduced(plant, order)
        assert small.nstates == order
        assert small.input_labels == ["u_tool_x"]
        assert control.linfnorm(plant - small)[0] <= 2 * sizes[order:].sum() * (1 + 1e-6)
    static = reduced(plant, 6, match_dc=True)
    assert static(0.0).item() == pytest.approx(plant(0.0).item(), abs=1e-9)
    assert reduced(plant, 99) is plant
    with pytest.raises(DesignError, match="sampled"):
        reduced(control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1), 1)


def test_the_smallest_controller_closes_nearly_the_same_loop() -> None:
    plant = control_plant(MACHINE, 0.5, ON_TOOL)
    k = design("h2", 0.5, ON_TOOL)
    small = smallest_controller(k, plant, loss=0.1)
    assert small.nstates < 8 < k.nstates
    whole, part = plant.lft(k, 1, 1)[0, 0], plant.lft(small, 1, 1)[0, 0]
    assert control.linfnorm(whole - part)[0] <= 0.1 * control.linfnorm(whole)[0]
    assert smallest_controller(k, plant, loss=0.0) is k


@pytest.mark.parametrize("scheduled", [False, True])
def test_controllers_are_written_and_read_back(tmp_path: Path, scheduled: bool) -> None:
    kind = prototype("active-absorber" if scheduled else "resonant")
    kit = kind.hardware(kind.port, Sampling(8000.0, 5e-5))
    made = schedule(lambda y: kind.design(MACHINE, y, kit), [0.3, 0.6]) if scheduled else kind.design(MACHINE, 0.5, kit)
    (tmp_path / "k.json").write_text(json.dumps(controller_data(made, kit)))
    back, hardware = read_controller(tmp_path / "k.json")
    assert hardware == kit
    for one, other in zip(getattr(made, "controllers", [made]), getattr(back, "controllers", [back]), strict=True):
        assert all(np.array_equal(getattr(one, m), getattr(other, m)) for m in "ABCD")
        assert (one.input_labels, one.output_labels) == (other.input_labels, other.output_labels)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d.update(schema="other/1"), "is no controller"),
        (lambda d: d.pop("inputs"), "inputs"),
        (lambda d: d["controllers"][0].update(A=[[1.0, 2.0]]), "reshape"),
        (lambda d: d["hardware"]["sensors"][0].update(quantity="jerk"), "quantity"),
        (lambda d: d["hardware"]["actuators"][0].update(mass=-1.0), "mass"),
        (lambda d: d["controllers"].append(d["controllers"][0]), "positions"),
    ],
)
def test_a_file_that_is_no_controller_is_refused(tmp_path: Path, change: Any, says: str) -> None:
    data = controller_data(design("resonant", 0.5), KIT)
    change(data)
    (tmp_path / "k.json").write_text(json.dumps(data))
    with pytest.raises((DataFormatError, ParameterError), match=says):
        read_controller(tmp_path / "k.json")


def test_the_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    write_machine(SUPPORT, "soft.toml")
    assert main(["control", "design", "resonant", "--actuator", "tool_x", "--position", "0.3", "--out", "k.json"]) == 0
    said = capsys.readouterr()
    assert "y_tool_x to u_tool_x, 6 states" in said.out
    assert said.err == ""
    arguments = ["k.json", "active-absorber", "--corrected", "soft.toml", "--positions", "3"]
    drawn = ["--plot", "rail.png", "--responses", "responses.svg", "--json", "check.json"]
    assert main(["control", "check", *arguments, *drawn]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[:3] for line in lines if line[:1] in (["k"], ["active-absorber"])] == [
        [name, machine, "3/3"] for name in ("k", "active-absorber") for machine in ("nominal", "soft")
    ]
    data = json.loads((tmp_path / "check.json").read_text(), parse_constant=pytest.fail)
    assert data["schema"] == "cutvib-control-check/1"
    one, other = (c["machines"][0] for c in data["checks"])
    assert one["stable"] == [True] * 3
    assert one["worst"]["attenuation"] == pytest.approx(
        max(a / b for a, b in zip(one["after_m_per_s2_per_n"]["tool_x"], one["before_m_per_s2_per_n"]["tool_x"]))
    )
    assert other["worst"]["delay_margin"] is None
    assert Image.open("rail.png").size[0] > 600
    assert "soft" in Path("responses.svg").read_text()


def test_the_check_follows_a_nonlinear_element_over_amplitude(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_machine(CubicStiffness("joint2", stiffness3=8e9).apply(MACHINE), "cubic.toml")
    assert (
        main(["control", "check", "lqg@0.5", "--corrected", "cubic.toml", "--positions", "2", "--json", "c.json"]) == 0
    )
    assert "describing functions" in capsys.readouterr().out
    (row,) = json.loads(Path("c.json").read_text())["over_amplitude"]
    assert (row["machine"], row["port"]) == ("cubic", "joint2")
    steps = row["amplitudes"]
    assert steps == pytest.approx([steps[0] * f for f in (1, 10, 100, 1000)])
    assert np.shape(row["disk_margin"]) == (4, len(row["positions"]))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["design", "pid"], "no controller 'pid'; there are lqg"),
        (["design", "h2@2"], "h2@2"),
        (["design", "h2", "--rate", "-1"], "'--rate'"),
        (["design", "h2", "--actuator", "nowhere"], "no port 'nowhere'"),
        (["check", "missing.json"], "missing.json: there is no such file"),
        (["check", "ppf", "--plot", "rail.txt"], "is no picture"),
        (["check", "ppf", "--corrected", "none.toml"], "none.toml"),
        (["check", "ppf", "--corrected", "nominal.toml"], "is called nominal already"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    arguments: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_machine(MACHINE, "nominal.toml")
    assert main(["control", *arguments]) == 2
    said = capsys.readouterr()
    assert says in said.err
    assert said.err.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["nominal.toml"]
