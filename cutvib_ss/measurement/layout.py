"""Where the channels of a model are found in formats that number nodes, and what they measure."""

from __future__ import annotations

from collections.abc import Mapping

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.raw import Layout
from cutvib_ss.measurement.inputs import input_ports
from cutvib_ss.measurement.records import FORCE, MachineLike

UNSTATED = -1
"""Node of a place that no [dofs] gives."""

DIRECTIONS = {"_x": 1, "_y": 2, "_z": 3}
"""Direction, as formats number it, behind the end of a channel's name."""
_CUTTING_MACHINE_NODES = {"tool": 1, "base": 2}


def layout_of(
    machine: MachineLike, dofs: Mapping[str, int] | None = None, where: str = "dofs", struck: str | None = None
) -> Layout:
    """Quantities of a model's channels, and the node and direction where each is in formats that number nodes."""
    ports = {name: str(channel.port) for name, channel in machine.channels.items()} | {FORCE: machine.input_port}
    if struck is not None:
        ports[FORCE] = struck
    quantities: dict[str, str] = {FORCE: machine.input_quantity}
    quantities |= {name: str(channel.quantity) for name, channel in machine.channels.items()}
    given = dict(dofs or {})
    places = {name: _places(name, port) for name, port in ports.items()}
    if struck is not None:  # a node given for `force` is that of the model's input
        places[FORCE] = [place for place in places[FORCE] if place != FORCE]
    known = {place for names in places.values() for place in names}
    known |= {place for port in input_ports(machine) for place in _places(FORCE, port)}
    for place in given:
        if place not in known and not place.startswith("rail@"):
            raise DataFormatError(f"{where}.{place}: not a place of the model; it has {', '.join(sorted(known))}")
    if machine.has_position:
        given = _CUTTING_MACHINE_NODES | given
    nodes: dict[str, tuple[int, int | None]] = {}
    for name, port in ports.items():
        stated = next((place for place in places[name] if place in given), None)
        if stated is None and name == FORCE and struck is not None:
            nodes[name] = (UNSTATED, 1 if machine.has_position else None)
            continue
        if stated is None:
            stated = places[name][-1]
            given[stated] = max(given.values(), default=0) + 1
        axis = DIRECTIONS.get(port[-2:], DIRECTIONS.get(name[-2:]))
        nodes[name] = (given[stated], 1 if axis is None and machine.has_position else axis)
    return Layout(quantities, nodes)


def _places(name: str, port: str) -> list[str]:
    """Names under which [dofs] may give a channel's node, the most particular first."""
    names = [name, port] if name != FORCE else [FORCE, port]
    return list(
        dict.fromkeys([*names, *(n[:-2] if n[-2:] in DIRECTIONS else n for n in reversed(names) if n != FORCE)])
    )
