"""Where the force of a record acted, if not at the model's input: a port, or a point of the rail; what the model answers there."""

from __future__ import annotations

import re
from collections.abc import Sequence

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.records import FORCE, MachineLike
from cutvib_ss.model.machine import CUTTING_SIGNALS
from cutvib_ss.model.protocol import Model
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import FloatArray, FrequencyResponse

_ON_RAIL = re.compile(r"^rail\s*(?:@|\()\s*([0-9.eE+-]+)\s*\)?$")


def struck_port(stated: str | None, machine: MachineLike, where: str) -> str | None:
    """``input`` of a record: None at the model's own, else a port's name or ``rail@`` with the fraction y / L."""
    if stated is None:
        return None
    point = _ON_RAIL.match(stated.strip())
    if point is not None and machine.has_position:
        try:
            fraction = float(point[1])
        except ValueError:
            fraction = float("nan")
        if not 0 < fraction < 1:
            raise DataFormatError(f"{where}.input = {stated!r}: y / L of the blow lies strictly inside (0, 1)")
        return f"rail@{fraction:.12g}"
    port = CUTTING_SIGNALS.get(stated, stated) if machine.has_position else stated
    if port in (FORCE, machine.input_port):
        return None
    if machine.input_quantity == "acceleration":
        raise DataFormatError(
            f"{where}.input = {stated!r}: the model's input is the acceleration of its base; put records of a hammer into a "
            "campaign whose machine.toml names the force's port under [input]"
        )
    ports = input_ports(machine)
    if port not in ports:
        rail = ", or rail@ and a fraction of its length" if machine.has_position else ""
        raise DataFormatError(f"{where}.input = {stated!r}: no port of the model; give one of {', '.join(ports)}{rail}")
    return port


def port_of(struck: str | None, machine: MachineLike) -> str:
    """The port at which a record's force acts, by the names that the responses are computed under."""
    if struck is None:
        return machine.input_port
    return f"rail({struck.removeprefix('rail@')})" if struck.startswith("rail@") else struck


def response_to(
    struck: str | None, model: Model, position: float | None, freq: FloatArray, outputs: str | Sequence[str]
) -> FrequencyResponse:
    """The model's responses to a record's force, in the channels' own quantities."""
    inputs = FORCE if struck is None else port_of(struck, model)
    places = None if position is None else [position]
    return frequency_response(model, places, freq, inputs=inputs, outputs=outputs)


def input_ports(machine: MachineLike) -> Sequence[str]:
    """Ports at which a force may act."""
    if isinstance(machine, Model):
        return machine.force_ports
    return list(dict.fromkeys([machine.input_port, *(str(channel.port) for channel in machine.channels.values())]))
