"""The page of the interface lists every public name, where it is documented."""

import re
from inspect import isclass, isroutine
from pathlib import Path

import cutvib_ss
import cutvib_ss.control_design
import cutvib_ss.interchange
import cutvib_ss.plot

PAGE = (Path(__file__).parents[2] / "docs" / "api.md").read_text(encoding="utf-8")
LISTED = re.findall(r"^   (cutvib_ss\.[\w.]+)$", PAGE, flags=re.MULTILINE)


def _public() -> set[str]:
    found = set()
    for package in (cutvib_ss, cutvib_ss.control_design, cutvib_ss.interchange, cutvib_ss.plot):
        for name in package.__all__:
            obj = getattr(package, name)
            if isclass(obj) or isroutine(obj):
                found.add(f"{obj.__module__}.{obj.__qualname__}")
    return found


def test_every_public_name_is_listed_where_it_is_documented() -> None:
    public = _public()
    assert len(public) > 100
    assert public - set(LISTED) == set()
    assert set(LISTED) - public == set()
