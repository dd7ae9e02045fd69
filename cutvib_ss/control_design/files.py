"""Controllers in a file: JSON with matrices, signal names and the hardware that they were designed for."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

import control
import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from cutvib_ss.control_design.hardware import ForceActuator, Hardware, InertialActuator, Sampling, Sensor
from cutvib_ss.control_design.scheduling import ScheduledController
from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.files import readable
from cutvib_ss.results import Quantity

SCHEMA = "cutvib-controller/1"


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _Actuator(_Part):
    kind: Literal["force", "inertial"]
    port: str
    bandwidth: float
    mass: float | None = None
    frequency: float | None = None
    damping_ratio: float | None = None

    def made(self) -> ForceActuator:
        own = self.model_dump(exclude={"kind"}, exclude_none=True)
        return InertialActuator(**own) if self.kind == "inertial" else ForceActuator(**own)


class _Sensor(_Part):
    port: str
    quantity: Quantity
    noise: float | None
    bandwidth: float


class _Sampling(_Part):
    rate: float
    computation: float


class _Hardware(_Part):
    actuators: list[_Actuator]
    sensors: list[_Sensor]
    sampling: _Sampling | None
    pade_order: int


class _StateSpace(_Part):
    A: list[list[float]]
    B: list[list[float]]
    C: list[list[float]]
    D: list[list[float]]


class _File(_Part):
    name: str
    sampling_period_s: float
    inputs: list[str]
    outputs: list[str]
    positions: list[float] | None
    controllers: list[_StateSpace]
    hardware: _Hardware


def controller_data(controller: control.StateSpace | ScheduledController, hardware: Hardware) -> dict[str, Any]:
    """
    A controller as the content of its file.

    Parameters
    ----------
    controller : control.StateSpace or ScheduledController
        The controller.
    hardware : Hardware
        What it was designed for.

    Returns
    -------
    dict
        Plain data, schema ``cutvib-controller/1``.
    """
    family = controller.controllers if isinstance(controller, ScheduledController) else (controller,)
    first = family[0]
    return {
        "schema": SCHEMA,
        "name": first.name,
        "sampling_period_s": float(first.dt or 0.0),
        "inputs": list(first.input_labels),
        "outputs": list(first.output_labels),
        "positions": controller.positions.tolist() if isinstance(controller, ScheduledController) else None,
        "controllers": [{m: getattr(k, m).tolist() for m in "ABCD"} for k in family],
        "hardware": asdict(hardware)
        | {
            "actuators": [
                {"kind": "inertial" if isinstance(a, InertialActuator) else "force", **asdict(a)}
                for a in hardware.actuators
            ]
        },
    }


def read_controller(path: str | os.PathLike[str]) -> tuple[control.StateSpace | ScheduledController, Hardware]:
    """
    The controller of a file.

    Parameters
    ----------
    path : str or path-like
        File that ``cutvib control design`` or `controller_data` made.

    Returns
    -------
    controller : control.StateSpace or ScheduledController
        The controller.
    hardware : Hardware
        What it was designed for.

    Raises
    ------
    DataFormatError
        If the file is missing, is no JSON, or not of this schema.
    ParameterError
        If a value is impossible.
    """
    file = Path(path)
    try:
        with readable(file, "give a controller's name or its JSON file"):
            content = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise DataFormatError(f"{file}: cannot be read as JSON ({error})") from error
    if not isinstance(content, dict) or content.pop("schema", None) != SCHEMA:
        raise DataFormatError(f"{file}: is no controller; `cutvib control design --out FILE.json` writes {SCHEMA}")
    try:
        tables = _File.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        raise DataFormatError(f"{file}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    try:
        return _controller(tables), _hardware(tables.hardware)
    except (ParameterError, ValueError) as error:
        raise ParameterError(f"{file}: {error}") from error


def _controller(tables: _File) -> control.StateSpace | ScheduledController:
    p, m = len(tables.inputs), len(tables.outputs)
    family = []
    for k in tables.controllers:
        n = len(k.A)
        shapes = {"A": (n, n), "B": (n, p), "C": (m, n), "D": (m, p)}
        matrices = [np.array(getattr(k, name), dtype=float).reshape(shape) for name, shape in shapes.items()]
        family.append(
            control.ss(
                *matrices, tables.sampling_period_s, inputs=tables.inputs, outputs=tables.outputs, name=tables.name
            )
        )
    if tables.positions is not None:
        return ScheduledController(np.array(tables.positions), tuple(family))
    if len(family) != 1:
        raise ParameterError(f"{len(family)} controllers need as many positions; there are none")
    return family[0]


def _hardware(tables: _Hardware) -> Hardware:
    return Hardware(
        tuple(a.made() for a in tables.actuators),
        tuple(Sensor(**s.model_dump()) for s in tables.sensors),
        None if tables.sampling is None else Sampling(**tables.sampling.model_dump()),
        tables.pade_order,
    )
