"""The names that the package offers: those listed exist, and say what they are."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

import cutvib_ss

LISTED: list[str] = list(getattr(cutvib_ss, "__all__", ()))


@pytest.mark.parametrize("name", LISTED)
def test_public_name_exists_and_is_documented(name: str) -> None:
    value = getattr(cutvib_ss, name)
    assert name in dir(cutvib_ss)
    if inspect.isclass(value) or callable(value):
        assert value.__doc__, f"{name} has no docstring of its own"
        # A dataclass without a docstring is given its signature for one.
        assert not value.__doc__.startswith(f"{name}(")
    else:
        assert inspect.ismodule(value) or name == "__version__", f"{name} is a {type(value).__name__}"


def test_no_public_name_is_listed_twice() -> None:
    assert len(LISTED) == len(set(LISTED))


@pytest.mark.parametrize(
    "name",
    ["published_machine", "read_machine", "modes", "frequency_response", "read_campaign", "diagnose"],
)
def test_names_that_outside_programs_use_are_public(name: str) -> None:
    assert name in LISTED


def test_dir_shows_the_public_names_and_nothing_else() -> None:
    assert dir(cutvib_ss) == sorted(LISTED)


def test_the_stub_names_the_same_and_where_they_come_from() -> None:
    stub = ast.parse(Path(cutvib_ss.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    named = {a.name: node.module for node in stub.body if isinstance(node, ast.ImportFrom) for a in node.names}
    assert sorted(named) == sorted(LISTED)
    for name, home in named.items():
        assert home is not None
        assert getattr(importlib.import_module(home), name) is getattr(cutvib_ss, name)
