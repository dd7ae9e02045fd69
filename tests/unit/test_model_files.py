"""machine.toml: both kinds read, written and refused."""

import re
from dataclasses import fields, replace
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutvib_ss.effects.base import Effect, parameter_fields
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.errors import CutvibError, DataFormatError, ParameterError
from cutvib_ss.model.elements import Attachment, SpringDamperMass
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.paths import with_value
from cutvib_ss.model.structure import Structure
from cutvib_ss.model_files import read_machine, write_machine
from cutvib_ss.parameters import Tolerances, recovered_rail, table_3
from cutvib_ss.response.frequency import frequency_response

STRUCTURE = """
[model]
kind = "second_order"
dofs = ["x1", "x2"]
mass = [[1, 0], [0, 2.5]]
damping = [[1, -1], [-1, 1]]
stiffness = [[1e4, -1e4], [-1e4, 1e4]]
[ports]
drive = [1.0, 0.0]
"spring 12" = [1.0, -1.0]
[channels]
y = { port = "drive", quantity = "displacement" }
a = { port = "spring 12", quantity = "acceleration" }
[input]
force = "drive"
[tolerance]
damping = 0.3
"""


def put(folder: Path, text: str) -> Path:
    file = folder / "machine.toml"
    file.write_text(text, encoding="utf-8")
    return file


def a_value(effect: type[Effect], model: Machine | Structure, place: str) -> dict[str, Any]:
    """Plausible parameters of an effect."""
    values: dict[str, Any] = {}
    for f in parameter_fields(effect):
        r = f.metadata["range"]
        middle = (r.low * r.high) ** 0.5 if r.scale == "log" else 0.4 * r.low + 0.6 * r.high
        values[f.name] = middle
    for f in fields(effect):
        if f.name == "n_modes":
            values["n_modes"] = 3
        elif f.name == "channel":
            values["channel"] = next(iter(model.channels))
        elif f.name == "parameter":
            at = {"joint1": "k1", "joint2": "c2", "head": "l1", "tool": "l2", "rail": "mass"}
            values["parameter"] = at.get(place, "stiffness")
    return values


def every_effect(model: Machine | Structure) -> list[Effect]:
    found = []
    for cls in EFFECTS.values():
        for place in cls.places(model):
            values = a_value(cls, model, place)
            if isinstance(model, Structure):
                values.pop("angle", None)  # its ports have one direction
            if cls is EFFECTS["freeplay"] and model.spring_at(place) is None:
                values |= {"contact_stiffness": 1e4, "beside": True}
            found.append(cls(place=place, **values))
    return found


def test_an_empty_file_is_the_published_machine(tmp_path: Path) -> None:
    machine = read_machine(put(tmp_path, ""))
    assert machine == published_machine()


def test_values_left_out_are_the_published_ones(tmp_path: Path) -> None:
    machine = read_machine(
        put(tmp_path, "[head]\nm2 = 0.7\ntheta01_deg = 2\n[rail]\nn_modes = 20\n[tolerance]\nk1 = 0.05\n")
    )
    assert machine.head == replace(table_3(), m2=0.7, theta01=radians(2.0))
    assert machine.rail.parameters == replace(recovered_rail(), n_modes=20)
    assert machine.tolerance == Tolerances(k1=0.05)


def test_a_structure(tmp_path: Path) -> None:
    model = read_machine(put(tmp_path, STRUCTURE))
    assert isinstance(model, Structure)
    assert model.system.dofs == ("x1", "x2")
    assert np.array_equal(model.system.mass, [[1.0, 0.0], [0.0, 2.5]])
    assert np.array_equal(model.system.port("spring 12"), [1.0, -1.0])
    assert (model.input_port, model.input_quantity) == ("drive", "force")
    assert model.channels["a"].quantity == "acceleration"
    assert (model.tolerance.damping, model.tolerance.mass) == (0.3, 0.02)


def test_a_structure_on_a_shaker(tmp_path: Path) -> None:
    model = read_machine(put(tmp_path, STRUCTURE.replace("force =", "base_acceleration =")))
    assert model.input_quantity == "acceleration"


@pytest.mark.parametrize("kind", ["machine", "structure"])
def test_every_effect_is_written_and_read_back(tmp_path: Path, kind: str) -> None:
    bare = published_machine() if kind == "machine" else read_machine(put(tmp_path, STRUCTURE))
    for effect in every_effect(bare):
        model = effect.apply(bare)
        write_machine(model, tmp_path / "out.toml")
        again = read_machine(tmp_path / "out.toml")
        assert again.effects == (effect,)
        where = 0.3 if isinstance(model, Machine) else None
        one, other = (frequency_response(m, where, [40.0, 217.0]).data for m in (model, again))
        assert np.allclose(one, other, rtol=1e-12, atol=0.0), effect


def test_effects_are_applied_in_their_order(tmp_path: Path) -> None:
    tables = (
        '[[effect]]\neffect = "added_mass"\nplace = "tool"\nmass = 0.2\n'
        '[[effect]]\neffect = "parameter_shift"\nplace = "joint2"\nparameter = "k2"\nfactor = 0.5\n'
    )
    machine = read_machine(put(tmp_path, tables))
    assert [e.effect for e in machine.effects] == ["added_mass", "parameter_shift"]
    assert machine.head.k2 == pytest.approx(0.5 * table_3().k2)
    assert machine.bare == published_machine()
    write_machine(machine, tmp_path / "again.toml")
    assert read_machine(tmp_path / "again.toml") == machine


def test_written_values_are_exact(tmp_path: Path) -> None:
    head = replace(table_3(), k2=10442.123456789012, theta02=1.2345678901234567, c1=1e-17)
    write_machine(replace(published_machine(), head=head), tmp_path / "m.toml")
    again = read_machine(tmp_path / "m.toml").head
    assert (again.k2, again.c1) == (head.k2, head.c1)
    assert again.theta02 == pytest.approx(head.theta02, rel=3e-16)
    assert "theta02_deg = 110.0\n" in _text(published_machine(), tmp_path)


def _text(model: Machine | Structure, folder: Path) -> str:
    write_machine(model, folder / "text.toml")
    return (folder / "text.toml").read_text(encoding="utf-8")


def test_the_factors_of_a_tuned_structure_go_into_its_matrices(tmp_path: Path) -> None:
    model = with_value(read_machine(put(tmp_path, STRUCTURE)), ("scales", 2), 1.1)
    write_machine(model, tmp_path / "out.toml")
    assert np.allclose(read_machine(tmp_path / "out.toml").system.stiffness, model.scaled.stiffness)


def test_what_no_effect_explains_is_not_written_away(tmp_path: Path) -> None:
    odd = replace(published_machine(), attachments=(Attachment("tool_x", SpringDamperMass(1e4)),))
    with pytest.raises(ParameterError, match="no words for that"):
        write_machine(odd, tmp_path / "out.toml")
    assert list(tmp_path.iterdir()) == []


def test_an_earlier_file_survives_a_failed_write(tmp_path: Path) -> None:
    file = put(tmp_path, STRUCTURE)
    odd = replace(published_machine(), attachments=(Attachment("tool_x", SpringDamperMass(1e4)),))
    with pytest.raises(ParameterError):
        write_machine(odd, file)
    assert file.read_text(encoding="utf-8") == STRUCTURE
    with pytest.raises(DataFormatError, match="cannot be written"):
        write_machine(published_machine(), tmp_path / "no_folder" / "m.toml")


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("[head]\nm1 = -1", r"head\.m1 = -1"),
        ("[head]\nm1 = 0", r"head\.m1"),
        ("[head]\nm1 = nan", r"head\.m1 = nan"),
        ('[head]\nm1 = "24"', r"head\.m1 = '24'"),
        ("[head]\nm1 = true", r"head\.m1 = True"),
        ("[head]\nm3 = 1", r"head\.m3: unknown key"),
        ("[head]\ntheta01 = 1", r"head\.theta01: unknown key"),
        ("[rail]\nn_modes = 2.5", r"rail\.n_modes = 2\.5"),
        ("[rail]\nn_modes = 0", r"rail\.n_modes = 0"),
        ("[rail]\ndamping_ratio = 1.5", r"rail\.damping_ratio"),
        ("[tolerance]\nm1 = 1.0", r"tolerance\.m1"),
        ("[tolerance]\nm1 = -0.1", r"tolerance\.m1"),
        ("[ports]\na = [1]", "ports: unknown key"),
        ("speed = 1", "speed: unknown key"),
        ("model = 3", "model = 3"),
        ('[model]\nkind = "finite_element"', "finite_element"),
        ("[head", "not valid TOML"),
        ("effect = 3", "effect = 3"),
        ('[[effect]]\nplace = "tool"', r"effect\[1\]\.effect = None"),
        ('[[effect]]\neffect = "gremlins"\nplace = "tool"', r"effect\[1\]\.effect = 'gremlins'"),
        ('[[effect]]\neffect = "added_mass"\nmass = 1', r"effect\[1\]\.place: missing"),
        ('[[effect]]\neffect = "added_mass"\nplace = "tool"', r"effect\[1\]\.mass: missing"),
        ('[[effect]]\neffect = "added_mass"\nplace = "rail"\nmass = 1', r"effect\[1\].*'rail'"),
        ('[[effect]]\neffect = "added_mass"\nplace = "tool"\nmass = -1', r"effect\[1\].*head\.m2 = -0\.4"),
        ('[[effect]]\neffect = "added_mass"\nplace = "tool"\nmass = "1"', r"effect\[1\].*mass = '1'"),
        ('[[effect]]\neffect = "added_mass"\nplace = "tool"\nmass = 1\nm = 2', r"effect\[1\]\.m: unknown key"),
        ("[[absorber]]\nfrequency = 212\nmass = 0.08", r"absorber\[1\]\.damping_ratio: missing"),
        ("[[absorber]]\nfrequency = 212\ndamping_ratio = 0.04\nmass = 0", r"absorber\[1\].*mass = 0"),
        ('[[absorber]]\nport = "t"\nfrequency = 212\ndamping_ratio = 0.04\nmass = 1', r"absorber\[1\].*no port 't'"),
    ],
)
def test_a_bad_machine_is_refused_with_its_key(tmp_path: Path, text: str, key: str) -> None:
    _refused(put(tmp_path, text), key)


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("[[1, 0], [0, 2.5]]", "[[1, 0], [0, -2.5]]", "mass matrix is not positive definite"),
        ("[[1, 0], [0, 2.5]]", "[[1, 0], [0, 0]]", "mass matrix is not positive definite"),
        ("[[1, 0], [0, 2.5]]", "[[1, 0], [0.2, 2.5]]", r"model\.mass is not symmetric"),
        ("[[1, 0], [0, 2.5]]", "[[1, 0], [0]]", r"model\.mass must have 2 rows of 2"),
        ("[[1, 0], [0, 2.5]]", "[[1, 0], [0, inf]]", r"model\.mass holds a value that is not finite"),
        ("[[1, 0], [0, 2.5]]", "3", r"model\.mass = 3"),
        ("stiffness = [[1e4", "stiffness = [[-1e4", r"model\.stiffness has a negative eigenvalue"),
        ('dofs = ["x1", "x2"]', 'dofs = ["x1", "x1"]', r"model\.dofs"),
        ('dofs = ["x1", "x2"]', "", r"model\.dofs: missing"),
        ("drive = [1.0, 0.0]", "drive = [1.0]", r"ports\.drive has 1 entries"),
        ("drive = [1.0, 0.0]", "drive = [0.0, 0.0]", r"ports\.drive is zero"),
        ("drive = [1.0, 0.0]", "force = [1.0, 0.0]", r"ports\.force"),
        ('port = "drive", quantity', 'port = "tool", quantity', "'tool'"),
        ('"displacement"', '"force"', r"channels\.y\.quantity = 'force'"),
        ('force = "drive"', 'force = "tool"', "'tool'"),
        ('force = "drive"', "", r"\[input\] needs either"),
        ('force = "drive"', 'force = "drive"\nbase_acceleration = "drive"', "only one"),
        ("damping = 0.3", "damping = 3", r"tolerance\.damping"),
        ("damping = 0.3", "k1 = 0.3", r"tolerance\.k1: unknown key"),
    ],
)
def test_a_bad_structure_is_refused_with_its_key(tmp_path: Path, old: str, new: str, key: str) -> None:
    assert old in STRUCTURE
    _refused(put(tmp_path, STRUCTURE.replace(old, new, 1)), key)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    _refused(tmp_path / "none.toml", "no such file")
    _refused(tmp_path, "cannot be read")


def _refused(file: Path, message: str) -> None:
    with pytest.raises(CutvibError) as caught:
        read_machine(file)
    said = str(caught.value)
    assert said.startswith(str(file))
    assert "\n" not in said
    assert re.search(message, said), said


def test_keys_of_older_files_are_ignored_with_a_warning_or_refused(tmp_path: Path) -> None:
    twist = '[[effect]]\neffect = "rail_torsion"\nplace = "rail"\neccentricity = 0.05\ninertia = 1.0\n'
    twist += "torsion_frequency = 120.0\ndamping_ratio = 0.02\n"
    with pytest.warns(UserWarning, match=r"effect\[1\].elements = 40 is ignored"):
        assert read_machine(put(tmp_path, twist + "elements = 40\n")) == read_machine(put(tmp_path, twist))
    ends = '[[effect]]\neffect = "support_compliance"\nplace = "rail_ends"\nk_left = 1e7\nk_right = 2e7\n'
    with pytest.warns(UserWarning, match="rigid_damping = 0.0 is ignored"):
        assert read_machine(put(tmp_path, ends + "rigid_damping = 0.0\n")) == read_machine(put(tmp_path, ends))
    with pytest.raises(DataFormatError, match=r"effect\[1\].rigid_damping = 1.0: this key is no longer read"):
        read_machine(put(tmp_path, ends + "rigid_damping = 1.0\n"))
