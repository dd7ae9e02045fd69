"""Columns told by node and direction, as universal files number them, and what to write under ``[dofs]``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TypeVar

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.raw import Layout, RawHistory, RawResponse, Signal
from cutvib_ss.measurement.formats.uff import dof_name
from cutvib_ss.measurement.layout import UNSTATED
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.measurement.schema import ChannelTable

ColumnT = TypeVar("ColumnT", Signal, RawResponse)
_AXES = {1: "X", 2: "Y", 3: "Z", None: ""}
_DOF = re.compile(r"^(?:.*[:\s])?(\d+)\s*:?\s*[+-]?\s*([XYZ])[+-]?$", re.IGNORECASE)


def parse_dof(text: str) -> tuple[int, int] | None:
    """Node and direction 1 to 3 of a name such as ``101:+Z``, ``101Z`` or ``tool:101:-X``."""
    match = _DOF.match(text.strip())
    return None if match is None else (int(match[1]), " XYZ".index(match[2].upper()))


def by_node(columns: Sequence[ColumnT], layout: Layout, where: str, required: bool) -> dict[str, int]:
    """Index of the column of each channel, by the nodes of ``[dofs]``; refused where none is found and one is required."""
    found: dict[str, int] = {}
    responses = bool(columns) and isinstance(columns[0], RawResponse)
    for k, column in enumerate(columns):
        if column.dof is None:
            continue
        if not responses and column.quantity == FORCE:
            if FORCE in found and not _at(column.dof, layout.nodes[FORCE]):
                continue
            channel: str | None = FORCE
        else:
            channel = _channel_at(column, layout)
        if channel is None:
            continue
        if channel in found and responses:
            raise DataFormatError(
                f"{where}: {columns[found[channel]].origin.replace('data set', 'data sets')} and "
                f"{column.origin.removeprefix('data set ')} are both FRFs of {channel!r}; one file holds one of each, "
                "so split it, one record a file"
            )
        if channel not in found or channel == FORCE:
            found[channel] = k
    if required and not set(found) - {FORCE}:
        what = "FRF" if responses else "time record"
        raise DataFormatError(
            f"{where}: no {what} at the node and direction of a channel {_places(layout)}; the file has "
            f"{', '.join(sorted({dof_name(c.dof) for c in columns if c.dof is not None}))}; "
            + _advice([c.dof for c in columns if c.dof is not None], layout)
        )
    return found


def driven(
    responses: Sequence[RawResponse],
    layout: Layout,
    channels: Mapping[str, ChannelTable],
    where: str,
    warnings: list[str],
) -> Sequence[RawResponse]:
    """Responses whose reference is the record's input; all of them where the format knows no references."""
    referred = [r for r in responses if r.ref is not None]
    if not referred:
        return responses
    name = channels[FORCE].name if FORCE in channels else None
    wanted = parse_dof(name) if isinstance(name, str) else None
    node, direction = layout.nodes[FORCE] if wanted is None else wanted
    references = sorted({(r.ref[0], abs(r.ref[1])) for r in referred if r.ref is not None})
    if node == UNSTATED:
        if len(references) > 1:
            raise DataFormatError(
                f"{where}: its FRFs refer to {_names(references)}, and nothing says which is this record's input; give "
                f"its node under [dofs], for instance with the port's name: head_x = {references[0][0]}"
            )
        return referred
    kept = [r for r in referred if r.ref is not None and _at(r.ref, (node, direction), any_direction=True)]
    if not kept:
        raise DataFormatError(
            f"{where}: no FRF refers to the force's node {node}; references are {_names(references)}, responses at "
            f"{', '.join(sorted({dof_name(r.dof) for r in referred if r.dof is not None}))}; "
            + _advice([r.dof for r in referred if r.dof is not None], layout, references)
        )
    others = {r.ref for r in referred} - {r.ref for r in kept}
    if others:
        warnings.append(
            f"{where}: FRFs that refer to {_names(sorted(o for o in others if o))} are of other inputs: not used"
        )
    return kept


def check_one_each(histories: Sequence[RawHistory], where: str) -> None:
    """Refuse blows of a file that numbers nodes where a channel has more records than another."""
    names = [{signal.name for signal in history.signals} for history in histories]
    if any(found != names[0] for found in names[1:]):
        counts = {name: sum(name in found for found in names) for name in sorted(set().union(*names))}
        if len(set(counts.values())) > 1:
            raise DataFormatError(
                f"{where}: channels have different numbers of time records {counts}; each blow needs one of every channel"
            )


def _channel_at(column: Signal | RawResponse, layout: Layout) -> str | None:
    """Response channel at a node and direction; a known quantity tells channels of one place apart."""
    if column.dof is None:
        return None
    there = [name for name, place in layout.nodes.items() if name != FORCE and _at(column.dof, place)]
    fitting = [name for name in there if column.quantity in (None, layout.quantities[name])]
    return next(iter(fitting or there), None)


def _at(dof: tuple[int, int], place: tuple[int, int | None], any_direction: bool = False) -> bool:
    node, direction = place
    return dof[0] == node and (direction is None or abs(dof[1]) == direction or (any_direction and dof[1] == 0))


def _places(layout: Layout) -> dict[str, str]:
    return {name: f"{node}{_AXES.get(direction, '')}" for name, (node, direction) in layout.nodes.items()}


def _names(references: Sequence[tuple[int, int]]) -> str:
    return ", ".join(dof_name(reference) for reference in references)


def _advice(dofs: Sequence[tuple[int, int]], layout: Layout, references: Sequence[tuple[int, int]] = ()) -> str:
    """The lines that would map the nodes found: the driving point's first, the others in their order."""
    nodes = list(dict.fromkeys([r[0] for r in references[:1]] + sorted({node for node, _ in dofs})))
    places = list(
        dict.fromkeys(name[:-2] if name[-2:] in ("_x", "_y", "_z") else name for name in layout.nodes if name != FORCE)
    )
    lines = [f"{place} = {node}" for place, node in zip(places, nodes, strict=False)]
    return (
        f"set the node numbers under [dofs], for instance: {', '.join(lines)} (a line each), or map channels by name "
        "under [channels]"
    )
