"""The numbers inside a model by their paths: read, and changed in a copy that is checked as any model is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass, replace
from typing import Any, TypeAlias, TypeVar

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.measurement_chain import ChannelChain

Path: TypeAlias = tuple[str | int, ...]
ModelT = TypeVar("ModelT")


def value_at(model: Any, path: Path) -> float:
    """
    The number that a path names.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    path : tuple of str and int
        Attribute names and indices, for instance ``("head", "k2")`` or ``("chain", "channels", "tool_x", "gain")``.

    Returns
    -------
    float
        The value.

    Raises
    ------
    ParameterError
        If the path leads nowhere.
    """
    node = model
    for step in path:
        node = _child(node, step, path)
    return float(node)


def with_value(model: ModelT, path: Path, value: float) -> ModelT:
    """
    A copy of a model with one number changed.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    path : tuple of str and int
        As in `value_at`.
    value : float
        The new value.

    Returns
    -------
    Machine or Structure
        The new model, checked as any is.

    Raises
    ------
    ParameterError
        If the path leads nowhere, or the value is impossible.
    """
    return with_values(model, {path: value})


def with_values(model: ModelT, values: Mapping[Path, float]) -> ModelT:
    """
    A copy of a model with several numbers changed at once.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    values : mapping of path to float
        The new values.

    Returns
    -------
    Machine or Structure
        The new model, checked as any is.

    Raises
    ------
    ParameterError
        If a path leads nowhere, or a value is impossible.
    """
    rebuilt: ModelT = _rebuilt(model, {path: (path, value) for path, value in values.items()})
    return rebuilt


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
