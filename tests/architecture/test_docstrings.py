"""Docstrings of all public objects against numpydoc's rules, their parameters against the signatures."""

import enum
import functools
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from types import ModuleType
from typing import Any, NamedTuple

import pytest
from numpydoc.docscrape import get_doc_object
from numpydoc.validate import ERROR_MSGS, Validator, validate

import cutvib_ss

# The summary may be a noun phrase or start with a symbol, so may a description; examples, "see also" and an extended
# summary stand where they help; a single returned value may be named.
NOT_ASKED = {"SS02", "SS05", "ES01", "SA01", "SA02", "SA03", "SA04", "EX01", "PR06", "PR08", "RT02", "RT04"}
ASKED = set(ERROR_MSGS) - NOT_ASKED
# A command's docstring is its --help text; its parameters are described by typer's options.
ASKED_OF_COMMANDS = {"GL08", "SS01", "SS03"}


class PublicObject(NamedTuple):
    """A public object and the dotted name by which a reader finds it."""

    name: str
    value: Any


def _public_modules() -> Iterator[ModuleType]:
    names = sorted(module.name for module in pkgutil.walk_packages(cutvib_ss.__path__, "cutvib_ss."))
    for name in ["cutvib_ss", *names]:
        if not any(part.startswith("_") for part in name.split(".")):
            yield importlib.import_module(name)


def _is_function(value: Any) -> bool:
    """Whether the value is a function, also one that is cached or compiled."""
    return inspect.isfunction(inspect.unwrap(value)) if callable(value) else False


def _public_members(owner: type) -> Iterator[tuple[str, Any]]:
    for name, value in sorted(vars(owner).items()):
        member = value.__func__ if isinstance(value, staticmethod | classmethod) else value
        if name.startswith("_") or not (
            _is_function(member) or isinstance(member, property | functools.cached_property)
        ):
            continue
        # A method that keeps the docstring of the one it overrides has been judged there.
        if member.__doc__ or not inspect.getdoc(getattr(owner, name)):
            yield name, member


def _public_objects() -> Iterator[PublicObject]:
    for module in _public_modules():
        yield PublicObject(module.__name__, module)
        for name, value in sorted(vars(module).items()):
            if name.startswith("_") or getattr(value, "__module__", None) != module.__name__:
                continue
            path = f"{module.__name__}.{name}"
            if inspect.isclass(value):
                yield PublicObject(path, value)
                yield from (PublicObject(f"{path}.{member}", code) for member, code in _public_members(value))
            elif _is_function(value):
                yield PublicObject(path, value)


class _HouseValidator(Validator):  # type: ignore[misc]
    """numpydoc's rules, where a subclass need not repeat the parameters that its base documents."""

    @property
    def signature_parameters(self) -> tuple[str, ...]:
        parameters: tuple[str, ...] = super().signature_parameters
        if not inspect.isclass(self.obj):
            return parameters
        if issubclass(self.obj, enum.Enum | BaseException) and "__init__" not in vars(self.obj):
            return ()
        if getattr(self.obj, "_is_protocol", False):
            return ()
        inherited: set[str] = set()
        for base in self.obj.__mro__[1:]:
            if base.__module__.startswith("cutvib_ss"):
                inherited.update(Validator(get_doc_object(base)).doc_all_parameters)
        return tuple(name for name in parameters if name not in inherited or name in self.doc_all_parameters)


def _complaints(value: Any, asked: set[str] = ASKED) -> list[str]:
    found = validate("", validator_cls=lambda obj_name: _HouseValidator(get_doc_object(value)))["errors"]
    return [f"{code}: {message}" for code, message in found if code in asked]


OBJECTS = list(_public_objects())


@pytest.mark.parametrize("found", OBJECTS, ids=[found.name for found in OBJECTS])
def test_docstring_is_complete_and_matches_the_signature(found: PublicObject) -> None:
    if inspect.ismodule(found.value):
        assert found.value.__doc__, "a module says in one docstring what it is for"
        return
    is_command = found.name.startswith("cutvib_ss.cli")
    complaints = _complaints(found.value, ASKED_OF_COMMANDS if is_command else ASKED)
    assert not complaints, "\n".join(complaints)


def test_the_walk_finds_functions_classes_methods_and_properties() -> None:
    names = {found.name for found in OBJECTS}
    assert {
        "cutvib_ss.units.to_si",
        "cutvib_ss.results.FrequencyResponse",
        "cutvib_ss.results.FrequencyResponse.sel",
        "cutvib_ss.results.FrequencyResponse.omega",
    } <= names


def test_a_docstring_that_has_drifted_from_its_signature_is_found() -> None:
    def scaled(values: float, factor: float) -> float:
        """
        Product of two numbers.

        Parameters
        ----------
        values : float
            One number.
        scale : float
            The other.

        Returns
        -------
        float
            The product.
        """
        return values * factor

    codes = {complaint[:4] for complaint in _complaints(scaled)}
    assert codes == {"PR01", "PR02"}
