"""machine.toml, both kinds, with its absorbers and effects: read with checks."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, replace
from math import radians
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from cutvib_ss.effects import catalogue
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.files import read_toml
from cutvib_ss.model.elements import Attachment, SprungMass
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.rail import Rail
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.parameters import MATRICES, AbsorberParameters, StructureTolerances, Tolerances, recovered_rail, table_3
from cutvib_ss.results import Quantity

ANGLES = ("theta01", "theta02")
"""Values that the file gives in degrees."""


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
    damping_ratio: float | list[float] = 0.0
    n_modes: int = 0
    strain_damping: float = 0.0
    frequency_profile: list[float] = []


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
    drift: float | None = None


class _StructureToleranceTable(_Table):
    mass: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0
    calibration: float = 0.0
    drift: float | None = None


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
    absolute: bool | None = None


class _InputTable(_Table):
    force: str | None = None
    base_acceleration: str | None = None


class _AbsorberTable(_Table):
    port: str = "tool_x"
    frequency: float
    damping_ratio: float
    mass: float


class _MachineFile(_Table):
    model: _MachineKind = _MachineKind()
    head: _HeadTable = _HeadTable()
    rail: _RailTable = _RailTable()
    tolerance: _ToleranceTable = _ToleranceTable()
    absorber: list[_AbsorberTable] = []
    effect: list[dict[str, Any]] = []


class _StructureFile(_Table):
    model: _StructureKind
    ports: dict[str, list[float]]
    channels: dict[str, _ChannelTable]
    input: _InputTable
    tolerance: _StructureToleranceTable = _StructureToleranceTable()
    absorber: list[_AbsorberTable] = []
    effect: list[dict[str, Any]] = []


def read_machine(path: str | os.PathLike[str]) -> Model:
    """
    The model of a machine.toml, with its absorbers, and its effects applied in their order.

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
    content = read_toml(file, "give the path of a machine.toml")
    try:
        return model_of(content, str(file))
    except ValidationError as error:
        more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
        raise DataFormatError(f"{file}: {_say(error.errors()[0])}{more}") from None
    except (ParameterError, DataFormatError) as error:
        raise type(error)(f"{file}: {error}") from error


def model_of(content: dict[str, Any], source: str) -> Model:
    """The model of a machine.toml's content."""
    table = content.get("model", {})
    kind = table.get("kind", "cutting_machine") if isinstance(table, dict) else "cutting_machine"
    if kind not in ("cutting_machine", "second_order"):
        raise ParameterError(f'model.kind = {kind!r} must be "cutting_machine" or "second_order"')
    if kind == "cutting_machine":
        tables = _MachineFile.model_validate(content)
        return _with_effects(_with_absorbers(_machine(tables, source), tables.absorber), tables.effect)
    structure = _StructureFile.model_validate(content)
    return _with_effects(_with_absorbers(_structure(structure), structure.absorber), structure.effect)


def _machine(tables: _MachineFile, source: str) -> Machine:
    head = tables.head.given()
    for name in ANGLES:
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
    matrices = {name: _square(f"model.{name}", getattr(tables.model, name), n) for name in MATRICES}
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
        channels={name: Channel(c.port, c.quantity, c.absolute) for name, c in tables.channels.items()},
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


def _with_absorbers(model: Model, tables: Sequence[_AbsorberTable]) -> Model:
    for number, table in enumerate(tables, start=1):
        try:
            checked = AbsorberParameters(table.frequency, table.damping_ratio, table.mass)
            (model.head_system() if model.rail is not None else model.system).port(table.port)
        except ParameterError as error:
            raise ParameterError(f"absorber[{number}]: {error}") from error
        element = SprungMass(checked.mass, checked.frequency, checked.damping_ratio)
        model = replace(model, attachments=(*model.attachments, Attachment(table.port, element)))
    return model


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
        for key in kind.retired.keys() & values.keys():
            same, now = kind.retired[key]
            value = values.pop(key)
            if same is not None and value != same:
                raise DataFormatError(f"{where}.{key} = {value!r}: this key is no longer read: {now}")
            warnings.warn(f"{where}.{key} = {value!r} is ignored: {now}", UserWarning, stacklevel=2)
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
