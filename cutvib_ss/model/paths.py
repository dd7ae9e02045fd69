"""The numbers inside a model by their paths: read, and changed in a copy that is checked as any model is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeAlias, TypeVar, cast

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.measurement_chain import ChannelChain

Path: TypeAlias = tuple[str | int, ...]
ModelT = TypeVar("ModelT")


def value_at(model: Any, path: Path) -> float:
    """The number that a path names."""
    return float(part_at(model, path))


def part_at(model: Any, path: Path) -> Any:
    """What a path names: a number, or a part that holds some."""
    node = model
    for step in path:
        node = _child(node, step, path)
    return node


def with_value(model: ModelT, path: Path, value: float) -> ModelT:
    """A copy of a model with one number changed."""
    return with_values(model, {path: value})


def with_values(model: ModelT, values: Mapping[Path, Any]) -> ModelT:
    """A copy of a model with several numbers, or whole parts, changed at once."""
    rebuilt: ModelT = _rebuilt(model, {path: (path, value) for path, value in values.items()})
    return rebuilt


def with_slots(model: ModelT, **slots: Any) -> ModelT:
    """A copy of a model of any kind with whole slots replaced."""
    changed: Any = model
    return cast(ModelT, replace(changed, **slots))


def moved_values(one: tuple[float, Any], other: tuple[float, Any]) -> tuple[tuple[Path, float], ...]:
    """Numbers of a model that move with a parameter, each with its slope, from two values with their models."""
    (low, below), (high, above) = one, other
    before, after = dict(_numbers(below)), dict(_numbers(above))
    if before.keys() != after.keys():
        raise ParameterError("a parameter changes what the model is made of; say in `moves` which values it moves")
    slopes = ((path, (after[path] - value) / (high - low)) for path, value in before.items())
    return tuple((path, slope) for path, slope in slopes if slope != 0.0)


def _numbers(node: Any, path: Path = ()) -> Iterator[tuple[Path, float]]:
    """Every number of a model that is not part of a matrix; effects and where values come from are left out."""
    if isinstance(node, float | int) and not isinstance(node, bool):
        yield path, float(node)
    elif isinstance(node, Mapping):
        for name, item in node.items():
            yield from _numbers(item, (*path, name))
    elif isinstance(node, tuple):
        for i, item in enumerate(node):
            yield from _numbers(item, (*path, i))
    elif is_dataclass(node) and not isinstance(node, type):
        for f in fields(node):
            if f.name not in ("effects", "bare", "tolerance"):
                yield from _numbers(getattr(node, f.name), (*path, f.name))


def _child(node: Any, step: str | int, path: Path) -> Any:
    if isinstance(node, Mapping):
        return node.get(step, ChannelChain())
    try:
        return node[int(step)] if isinstance(node, tuple) else getattr(node, str(step))
    except (AttributeError, IndexError, ValueError):
        raise ParameterError(f"the model has no value at {'.'.join(map(str, path))}") from None


def _rebuilt(node: Any, changes: Mapping[Path, tuple[Path, float]]) -> Any:
    """A node with changes below it: the rest of each path, to the whole path (for messages) and the value."""
    if () in changes:
        return changes[()][1]
    below: dict[str | int, dict[Path, tuple[Path, float]]] = {}
    for (step, *rest), change in changes.items():
        below.setdefault(step, {})[tuple(rest)] = change
    whole = next(iter(changes.values()))[0]
    inner = {step: _rebuilt(_child(node, step, whole), own) for step, own in below.items()}
    if isinstance(node, Mapping):
        return {**node, **inner}
    if isinstance(node, tuple):
        return tuple(inner.get(i, item) for i, item in enumerate(node))
    if not is_dataclass(node) or isinstance(node, type):
        raise ParameterError(f"the model has no value at {'.'.join(map(str, whole))}")
    return replace(node, **{str(step): value for step, value in inner.items()})


def replaced(model: ModelT, values: Mapping[str, Any], homes: Mapping[str, Path]) -> ModelT:
    """
    A copy of a model with values changed by their names.

    ``homes`` are the paths of the parameter sets whose fields go by their own names; those of ``tolerance`` are
    ``tolerance_<name>``, and the model's own fields replace whole slots.
    """
    homes = {**homes, "tolerance": ("tolerance",)}
    sets = {name: _at(model, path) for name, path in homes.items()}
    slots = [f.name for f in fields(model) if f.name not in ("effects", "bare")]  # type: ignore[arg-type]
    known: dict[str, tuple[str, str]] = {}
    for name, node in sets.items():
        for f in fields(node):
            if f.compare:
                known[f"tolerance_{f.name}" if name == "tolerance" else f.name] = (name, f.name)
    for name in values:
        if name not in known and name not in slots:
            raise ParameterError(f"there is no value {name!r}; there are {', '.join([*known, *slots])}")
    # Of a corrected model the nominal values change, and its effects are applied anew.
    changed: Any = model if model.bare is None else model.bare  # type: ignore[attr-defined]
    changed = replace(changed, **{n: v for n, v in values.items() if n in slots})
    for home, path in homes.items():
        own = {known[n][1]: v for n, v in values.items() if n not in slots and known[n][0] == home}
        if own:
            changed = _with_node(changed, path, replace(_at(changed, path), **own))
    for effect in model.effects:  # type: ignore[attr-defined]
        changed = effect.apply(changed)
    return cast(ModelT, changed)


def _at(node: Any, path: Path) -> Any:
    for step in path:
        node = getattr(node, str(step))
    return node


def _with_node(node: Any, path: Path, value: Any) -> Any:
    if not path:
        return value
    step = str(path[0])
    return replace(node, **{step: _with_node(getattr(node, step), path[1:], value)})
