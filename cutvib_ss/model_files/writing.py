"""machine.toml, both kinds, with its absorbers and effects: written so that it reads back as the same model."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from math import degrees, inf, isclose, nextafter, radians
from pathlib import Path
from typing import Any

import numpy as np

from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.model.elements import SprungMass
from cutvib_ss.model.head import HEAD_PARAMETERS
from cutvib_ss.model.structure import Structure
from cutvib_ss.model_files.reading import ANGLES, model_of
from cutvib_ss.parameters import MATRICES

_RAIL = ("length", "mass", "first_frequency", "n_modes")
_ABSORBER = ("frequency", "damping_ratio", "mass")


def write_machine(model: Model, path: str | os.PathLike[str]) -> None:
    """
    Write a model as machine.toml: the bare values, its absorbers, then its effects.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    path : str or path-like
        The file; it is replaced only once the new one is complete.

    Raises
    ------
    ParameterError
        If the file would not read back as the same model, because something in it is neither an absorber nor an effect of
        the catalogue.
    DataFormatError
        If the file cannot be written.
    """
    file = Path(path)
    text = "\n".join(_lines(model)) + "\n"
    if not _same(model_of(tomllib.loads(text), str(file)).as_written, model.as_written):
        raise ParameterError(
            "the model holds more than its bare values, absorbers and effects, and machine.toml has no words for that; "
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
    if bare.rail is not None:
        yield from ["[model]", 'kind = "cutting_machine"', "", "[head]"]
        for name in HEAD_PARAMETERS:
            value = getattr(bare.head, name)
            yield f"{name}_deg = {_in_degrees(value)!r}" if name in ANGLES else f"{name} = {float(value)!r}"
        yield from ["", "[rail]"]
        rail = bare.rail.as_written.parameters
        yield from (_entry(name, getattr(rail, name)) for name in _RAIL)
        yield _entry("damping_ratio", rail.damping_ratios if rail.damping_profile else rail.damping_ratio)
        if rail.strain_damping:
            yield _entry("strain_damping", rail.strain_damping)
        if rail.frequency_profile:
            yield _entry("frequency_profile", rail.frequency_profile)
    else:
        yield from _structure_lines(bare)
    yield from ["", "[tolerance]"]
    stated = {f.name: getattr(bare.tolerance, f.name) for f in fields(bare.tolerance)}
    yield from (_entry(name, value) for name, value in stated.items() if value is not None)
    for attachment in bare.attachments:
        if isinstance(attachment.element, SprungMass):
            yield from ["", "[[absorber]]", _entry("port", attachment.port)]
            yield from (_entry(name, getattr(attachment.element, name)) for name in _ABSORBER)
    for effect in model.effects:
        assert isinstance(effect, Effect)
        yield from ["", "[[effect]]", _entry("effect", effect.effect)]
        # What it is not needs no word.
        values: dict[str, Any] = {f.name: getattr(effect, f.name) for f in fields(effect)}
        yield from (_entry(name, v) for name, v in values.items() if v is not None and v is not False)


def _structure_lines(bare: Structure) -> Iterator[str]:
    system = bare.scaled
    yield from ["[model]", 'kind = "second_order"', _entry("dofs", system.dofs)]
    yield from (_entry(name, getattr(system, name).tolist()) for name in MATRICES)
    yield from ["", "[ports]"]
    yield from (_entry(name, row.tolist()) for name, row in system.ports.items())
    yield from ["", "[channels]"]
    for name, channel in bare.channels.items():
        # Said where it is not the default, on a shaker, where alone it matters.
        unusual = bare.influence is not None and channel.absolute != (channel.quantity == "acceleration")
        more = f", absolute = {_value(bool(channel.absolute))}" if unusual else ""
        yield f"{_key(name)} = {{ port = {_value(channel.port)}, quantity = {_value(channel.quantity)}{more} }}"
    what = "force" if bare.input_quantity == "force" else "base_acceleration"
    yield from ["", "[input]", _entry(what, bare.input_port)]


def _entry(name: str, value: Any) -> str:
    return f"{_key(name)} = {_value(value)}"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
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
    """Whether two models, or parts of them, hold the same values; where they come from does not count."""
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
