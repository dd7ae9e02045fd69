"""
Docstrings: of the public API by numpydoc's rules, parameters against signatures; of everything else that there is one.

What only its own module uses, by its name, has one line: reasons stand as comments where the code needs them.
"""

import ast
import enum
import functools
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from pathlib import Path
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


def _api() -> set[int]:
    """
    Identities of what a reader of the API meets: the names in ``__all__`` of the package and of the packages in it.

    A package deeper down is a part of one of these and gathers names for it alone.
    """
    offered = set()
    for module in _public_modules():
        if hasattr(module, "__path__") and module.__name__.count(".") < 2:
            values = [getattr(module, name) for name in getattr(module, "__all__", ())]
            offered.update(map(id, values))
            # What a class of the API inherits is met there too.
            bases = (base for value in values if inspect.isclass(value) for base in value.__mro__)
            offered.update(id(base) for base in bases if base.__module__.startswith("cutvib_ss.model."))
    return offered


def _objects() -> Iterator[tuple[PublicObject, bool]]:
    """All objects without an underscore, and whether they are of the public API."""
    offered = _api()
    for module in _public_modules():
        yield PublicObject(module.__name__, module), False
        for name, value in sorted(vars(module).items()):
            if name.startswith("_") or getattr(value, "__module__", None) != module.__name__:
                continue
            path, public = f"{module.__name__}.{name}", id(value) in offered
            if inspect.isclass(value):
                yield PublicObject(path, value), public
                for member, code in _public_members(value):
                    yield PublicObject(f"{path}.{member}", code), public
            elif _is_function(value):
                yield PublicObject(path, value), public


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


def _complaints(value: Any) -> list[str]:
    found = validate("", validator_cls=lambda obj_name: _HouseValidator(get_doc_object(value)))["errors"]
    return [f"{code}: {message}" for code, message in found if code in ASKED]


OBJECTS = list(_objects())
API = [found for found, public in OBJECTS if public]


@pytest.mark.parametrize("found", API, ids=[found.name for found in API])
def test_docstring_of_the_api_is_complete_and_matches_the_signature(found: PublicObject) -> None:
    complaints = _complaints(found.value)
    assert not complaints, "\n".join(complaints)


def test_everything_else_says_what_it_is() -> None:
    silent = [found.name for found, public in OBJECTS if not public and not (inspect.getdoc(found.value) or "").strip()]
    assert silent == []


def _longer_than_a_line(node: ast.AST, private: bool = False) -> Iterator[ast.AST]:
    """Functions, methods and classes below a node that are private, or inside such, whose docstring is longer than one line."""
    for child in ast.iter_child_nodes(node):
        here = private
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            here = private or child.name.startswith("_")
            if here and "\n" in (ast.get_docstring(child, clean=False) or ""):
                yield child
        yield from _longer_than_a_line(child, here)


def test_docstrings_of_what_is_private_are_one_line() -> None:
    folder = Path(cutvib_ss.__file__).parent
    long = [
        f"{file.relative_to(folder.parent)}:{found.lineno} {found.name}"  # type: ignore[attr-defined]
        for file in sorted(folder.rglob("*.py"))
        for found in _longer_than_a_line(ast.parse(file.read_text(encoding="utf-8")))
    ]
    assert not long, (
        f"say the rest in a comment where the code needs it, or in the module's docstring: {', '.join(long)}"
    )


def test_a_long_private_docstring_is_found() -> None:
    two = '"""One.\nTwo."""'
    source = f"""
def _f():
    {two}
class _C:
    def method(self):
        {two}
class C:
    def __init__(self):
        {two}
    def method(self):
        {two}
if True:
    def _g():
        {two}
def _short():
    'One.'
"""
    found = list(_longer_than_a_line(ast.parse(source)))
    assert [node.name for node in found] == ["_f", "method", "__init__", "_g"]  # type: ignore[attr-defined]


def test_the_walk_finds_the_api_and_what_is_not() -> None:
    names = {found.name for found in API}
    assert {"cutvib_ss.results.frequency.FrequencyResponse.sel", "cutvib_ss.model.base.BaseModel.plant"} <= names
    others = {found.name for found, public in OBJECTS if not public}
    assert {"cutvib_ss.units.to_si", "cutvib_ss.model.coupling.Coupling.matrices"} <= others
    assert "cutvib_ss.model.restoring_forces.base.RestoringForce" in others


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
