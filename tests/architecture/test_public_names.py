"""The names that the package offers: those listed exist, and say what they are."""

import inspect

import pytest

import cutvib_ss

LISTED: list[str] = list(getattr(cutvib_ss, "__all__", ()))


@pytest.mark.parametrize("name", LISTED)
def test_public_name_exists_and_is_documented(name: str) -> None:
    value = getattr(cutvib_ss, name)
    assert name in dir(cutvib_ss)
    if inspect.isclass(value) or inspect.isroutine(value):
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
