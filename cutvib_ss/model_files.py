"""machine.toml, both kinds, with its effects: read with checks, written so that it reads back as the same model."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass, replace
from math import degrees, inf, isclose, nextafter, radians
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from cutvib_ss.effects import catalogue
from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.machine import Machine
from cutvib_ss.mechanical import Channel, SecondOrder
from cutvib_ss.parameters import StructureTolerances, Tolerances, recovered_rail, table_3
from cutvib_ss.results import Quantity
from cutvib_ss.structure import Structure
from cutvib_ss.subsystems.head import HEAD_PARAMETERS
from cutvib_ss.subsystems.rail import Rail

_ANGLES = ("theta01", "theta02")
_RAIL = ("length", "mass", "first_frequency", "damping_ratio", "n_modes")
_MATRICES = ("mass", "damping", "stiffness")


class _Table(BaseModel):
    # Strict: a number in quotes is a slip of the pen. Whether a value makes sense is for the parameter sets to say.
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def given(self) -> dict[str, Any]:
        return self.model_dump(exclude_unset=True)


class _HeadTable(_Table):
    m1: float = 0.0
    m2: float = 0.0
    l1: float = 0.0
    l2: float = 0.0
    theta01_deg: float = 0.0
    theta02_deg: float = 0.0
    k1: float = 0.0
    k2: float = 0.0
    c1: float = 0.0
    c2: float = 0.0


class _RailTable(_Table):
    length: float = 0.0
    mass: float = 0.0
    first_frequency: float = 0.0
    damping_ratio: float = 0.0
    n_modes: int = 0


class _ToleranceTable(_Table):
    m1: float = 0.0
    m2: float = 0.0
    l1: float = 0.0
    l2: float = 0.0
    k1: float = 0.0
    k2: float = 0.0
    c1: float = 0.0
    c2: float = 0.0
    mass: float = 0.0
    first_frequency: float = 0.0
    damping_ratio: float = 0.0
    calibration: float = 0.0


class _StructureToleranceTable(_Table):
    mass: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0
    calibration: float = 0.0


class _MachineKind(_Table):
    kind: Literal["cutting_machine"] = "cutting_machine"


class _StructureKind(_Table):
    kind: Literal["second_order"]
    dofs: list[str]
    mass: list[list[float]]
    damping: list[list[float]]
    stiffness: list[list[float]]


class _ChannelTable(_Table):
    port: str
    quantity: Quantity


class _InputTable(_Table):
    force: str | None = None
    base_acceleration: str | None = None


class _MachineFile(_Table):
    model: _MachineKind = _MachineKind()
    head: _HeadTable = _HeadTable()
    rail: _RailTable = _RailTable()
    tolerance: _ToleranceTable = _ToleranceTable()
    effect: list[dict[str, Any]] = []


class _StructureFile(_Table):
    model: _StructureKind
    ports: dict[str, list[float]]
    channels: dict[str, _ChannelTable]
    input: _InputTable
    tolerance: _StructureToleranceTable = _StructureToleranceTable()
    effect: list[dict[str, Any]] = []


# --- reading ----------------------------------------------------------------------------------------------------------


def read_machine(path: str | os.PathLike[str]) -> Model:
    """
    The model of a machine.toml, with its effects applied in their order.

    Parameters
    ----------
    path : str or path-like
        The file.

    Returns
    -------
    Machine or Structure
        By ``model.kind``: a cutting machine (left out values are Table 3 and the recovered rail), or another structure.

    Raises
    ------
    DataFormatError
        If the file is missing or not TOML, or a key is unknown, missing or of the wrong type; the message names it.
    ParameterError
        If a value is impossible, such as a negative mass; the message names file and key.
    """
    file = Path(path)
    try:
        with file.open("rb") as stream:
            content = tomllib.load(stream)
    except FileNotFoundError:
        raise DataFormatError(f"{file}: there is no such file; give the path of a machine.toml") from None
    except OSError as error:
        raise DataFormatError(
            f"{file}: cannot be read ({error.strerror}); check the path and its permissions"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataFormatError(f"{file}: not valid TOML ({error}); correct that line") from error
    try:
        return _model(content, str(file))
    except ValidationError as error:
        more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
        raise DataFormatError(f"{file}: {_say(error.errors()[0])}{more}") from None
    except ParameterError as error:
        raise ParameterError(f"{file}: {error}") from error


def _model(content: dict[str, Any], source: str) -> Model:
    table = content.get("model", {})
    kind = table.get("kind", "cutting_machine") if isinstance(table, dict) else "cutting_machine"
    if kind not in ("cutting_machine", "second_order"):
        raise ParameterError(f'model.kind = {kind!r} must be "cutting_machine" or "second_order"')
    if kind == "cutting_machine":
        tables = _MachineFile.model_validate(content)
        return _with_effects(_machine(tables, source), tables.effect)
    structure = _StructureFile.model_validate(content)
    return _with_effects(_structure(structure), structure.effect)


def _machine(tables: _MachineFile, source: str) -> Machine:
    head = tables.head.given()
    for name in _ANGLES:
        if f"{name}_deg" in head:
            head[name] = radians(head.pop(f"{name}_deg"))
    if head:
        head |= {"source": source, "caveat": ""}
    rail = tables.rail.given()
    if rail:
        rail |= {"source": source, "caveat": ""}
    return Machine(
        head=replace(table_3(), **head),
        rail=Rail(replace(recovered_rail(), **rail)),
        tolerance=Tolerances(**tables.tolerance.given()),
    )


def _structure(tables: _StructureFile) -> Structure:
    n = len(tables.model.dofs)
    if n == 0 or len(set(tables.model.dofs)) < n:
        raise ParameterError("model.dofs must name every degree of freedom once, and at least one")
    matrices = {name: _square(f"model.{name}", getattr(tables.model, name), n) for name in _MATRICES}
    if not tables.ports:
        raise ParameterError("[ports] is empty; give at least the port at which the force acts")
    if not tables.channels:
        raise ParameterError("[channels] is empty; say which port and quantity each response channel reads")
    for table, names in (("ports", tables.ports), ("channels", tables.channels)):
        if "force" in names:
            raise ParameterError(f"{table}.force: this name is kept for the measured force; choose another")
    for name, row in tables.ports.items():
        if len(row) != n:
            raise ParameterError(f"ports.{name} has {len(row)} entries; there are {n} degrees of freedom")
        if not any(row):
            raise ParameterError(f"ports.{name} is zero throughout; a port must move with some degree of freedom")
    drive = {
        k: v for k, v in (("force", tables.input.force), ("base", tables.input.base_acceleration)) if v is not None
    }
    if len(drive) != 1:
        raise ParameterError("[input] needs either force = <port> or base_acceleration = <port>, and only one of them")
    [(what, port)] = drive.items()
    if port not in tables.ports:
        raise ParameterError(f"input names port {port!r}; under [ports] there are {', '.join(tables.ports)}")
    lowest, highest = np.linalg.eigvalsh(matrices["stiffness"])[[0, -1]]
    if lowest < -1e-6 * max(highest, -lowest):
        raise ParameterError("model.stiffness has a negative eigenvalue: the structure would run away; check its signs")
    try:
        system = SecondOrder(**matrices, dofs=tuple(tables.model.dofs), ports=tables.ports)  # type: ignore[arg-type]
    except ParameterError as error:
        raise ParameterError(f"model.{error}") from error
    return Structure(
        system=system,
        channels={name: Channel(c.port, c.quantity) for name, c in tables.channels.items()},
        input_port=port,
        input_quantity="force" if what == "force" else "acceleration",
        tolerance=StructureTolerances(**tables.tolerance.given()),
    )


def _square(name: str, rows: list[list[float]], n: int) -> np.ndarray:
    if len(rows) != n or any(len(row) != n for row in rows):
        raise ParameterError(f"{name} must have {n} rows of {n} values, one for each of model.dofs")
    matrix = np.array(rows, dtype=float)
    if not np.isfinite(matrix).all():
        raise ParameterError(f"{name} holds a value that is not finite")
    return matrix


def _with_effects(model: Model, tables: Sequence[Mapping[str, Any]]) -> Model:
    for number, table in enumerate(tables, start=1):
        where = f"effect[{number}]"
        name = table.get("effect")
        if not isinstance(name, str) or name not in catalogue.EFFECTS:
            known = ", ".join(catalogue.EFFECTS)
            raise ParameterError(f"{where}.effect = {name!r} is not in the catalogue; there are {known}")
        kind = catalogue.EFFECTS[name]
        known_fields = {f.name: f for f in fields(kind)}
        values = {k: v for k, v in table.items() if k != "effect"}
        for key in values:
            if key not in known_fields:
                raise ParameterError(f"{where}.{key}: unknown key; {name} has {', '.join(known_fields)}")
        for key, f in known_fields.items():
            if key not in values and f.default is MISSING and f.default_factory is MISSING:
                raise ParameterError(f"{where}.{key}: missing; add it")
        try:
            model = kind(**values).apply(model)
        except ParameterError as error:
            raise ParameterError(f"{where}: {error}") from error
    return model


def _say(error: Any) -> str:
    where = ""
    for part in error["loc"]:
        where += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if where else str(part)
    if error["type"] == "extra_forbidden":
        return f"{where}: unknown key; remove it or correct its spelling"
    if error["type"] == "missing":
        return f"{where}: missing; add it"
    if error["type"] == "model_type":
        return f"{where} = {error['input']!r}: must be a table"
    return f"{where} = {error['input']!r}: {error['msg'][0].lower()}{error['msg'][1:]}"


# --- writing ----------------------------------------------------------------------------------------------------------


def write_machine(model: Model, path: str | os.PathLike[str]) -> None:
    """
    Write a model as machine.toml: the bare values, then its effects.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    path : str or path-like
        The file; it is replaced only once the new one is complete.

    Raises
    ------
    ParameterError
        If the file would not read back as the same model, because something in it is no effect of the catalogue.
    DataFormatError
        If the file cannot be written.
    """
    file = Path(path)
    text = "\n".join(_lines(model)) + "\n"
    if not _same(_model(tomllib.loads(text), str(file)), model):
        raise ParameterError(
            "the model holds more than its bare values and its effects, and machine.toml has no words for that; "
            "fill its slots with effects of the catalogue"
        )
    draft = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        draft.write_text(text, encoding="utf-8")
        draft.replace(file)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise DataFormatError(f"{file}: cannot be written ({error.strerror}); check the folder") from error


def _lines(model: Model) -> Iterator[str]:
    bare = model if model.bare is None else model.bare
    if isinstance(bare, Machine):
        yield from ["[model]", 'kind = "cutting_machine"', "", "[head]"]
        for name in HEAD_PARAMETERS:
            value = getattr(bare.head, name)
            yield f"{name}_deg = {_in_degrees(value)!r}" if name in _ANGLES else f"{name} = {float(value)!r}"
        yield from ["", "[rail]"]
        yield from (_entry(name, getattr(bare.rail.parameters, name)) for name in _RAIL)
    else:
        yield from _structure_lines(bare)
    yield from ["", "[tolerance]"]
    yield from (_entry(f.name, getattr(bare.tolerance, f.name)) for f in fields(bare.tolerance))
    for effect in model.effects:
        assert isinstance(effect, Effect)
        yield from ["", "[[effect]]", _entry("effect", effect.effect)]
        yield from (_entry(f.name, getattr(effect, f.name)) for f in fields(effect))


def _structure_lines(bare: Structure) -> Iterator[str]:
    system = bare.scaled
    yield from ["[model]", 'kind = "second_order"', _entry("dofs", system.dofs)]
    yield from (_entry(name, getattr(system, name).tolist()) for name in _MATRICES)
    yield from ["", "[ports]"]
    yield from (_entry(name, row.tolist()) for name, row in system.ports.items())
    yield from ["", "[channels]"]
    for name, channel in bare.channels.items():
        yield f"{_key(name)} = {{ port = {_value(channel.port)}, quantity = {_value(channel.quantity)} }}"
    what = "force" if bare.input_quantity == "force" else "base_acceleration"
    yield from ["", "[input]", _entry(what, bare.input_port)]


def _entry(name: str, value: Any) -> str:
    return f"{_key(name)} = {_value(value)}"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value) if isinstance(value, int) else repr(float(value))


def _in_degrees(angle: float) -> float:
    """The shortest number of degrees that reads back as the same angle."""
    exact = degrees(angle)
    for candidate in (float(f"{exact:.12g}"), exact, nextafter(exact, inf), nextafter(exact, -inf)):
        if radians(candidate) == angle:
            return candidate
    return exact


def _same(one: Any, other: Any) -> bool:
    """Whether two models hold the same values; where they come from does not count."""
    if isinstance(one, Structure) and isinstance(other, Structure):
        # The factors of a tuned structure are written into its matrices.
        one, other = (replace(m, system=m.scaled, scales=(1.0, 1.0, 1.0)) for m in (one, other))
    if is_dataclass(one) and type(one) is type(other):
        names = [f.name for f in fields(one) if f.name not in ("effects", "bare", "source", "caveat")]
        return all(_same(getattr(one, name), getattr(other, name)) for name in names)
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_same(one[k], other[k]) for k in one)
    if isinstance(one, np.ndarray):
        return bool(np.allclose(one, other, rtol=1e-9, atol=1e-12 * max(1e-300, float(np.abs(one).max(initial=0.0)))))
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, float | int) and isinstance(other, float | int):
        return isclose(one, other, rel_tol=1e-9)
    return bool(one == other)
