"""Models are told apart inside `cutvib_ss.model` alone: everything else asks what both kinds answer."""

import ast
from collections.abc import Iterator
from pathlib import Path

import cutvib_ss
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.protocol import Model
from cutvib_ss.model.structure import Structure
from tests.conformance.cases import three_masses

PACKAGE = Path(cutvib_ss.__file__).parent
KINDS = {"Machine", "Structure"}


def _told_apart(tree: ast.AST) -> Iterator[int]:
    """Lines that ask for the class of a model."""
    for node in ast.walk(tree):
        call = isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("isinstance", "issubclass")
        compared = isinstance(node, ast.Compare) and "type" in _names(node)
        if (call or compared or isinstance(node, ast.MatchClass)) and KINDS & _names(node):
            yield node.lineno  # type: ignore[attr-defined]


def _names(node: ast.AST) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)} | {
        n.attr for n in ast.walk(node) if isinstance(n, ast.Attribute)
    }


def test_no_module_outside_the_model_asks_which_kind_it_has() -> None:
    found = [
        f"{file.relative_to(PACKAGE.parent)}:{line}"
        for file in PACKAGE.rglob("*.py")
        if file.relative_to(PACKAGE).parts[0] != "model"
        for line in _told_apart(ast.parse(file.read_text(encoding="utf-8")))
    ]
    assert not found, f"ask the model (cutvib_ss/model/protocol.py) instead of its class: {', '.join(found)}"


def test_the_check_sees_what_it_forbids() -> None:
    seen = "isinstance(m, Machine)\nisinstance(m, (Machine, cv.Structure))\ntype(m) is Machine\nisinstance(m, int)"
    assert sorted(_told_apart(ast.parse(seen))) == [1, 2, 3]


def test_both_kinds_answer_the_whole_protocol() -> None:
    for model in (published_machine(), three_masses()):
        assert isinstance(model, Model)
    asked = [name for name in vars(Model) if not name.startswith("_")]
    for name in asked:
        for kind in (Machine, Structure):
            stated = kind.__dataclass_fields__.keys() | {n for c in kind.__mro__ for n in vars(c)}
            assert name in stated, f"{kind.__name__} has no {name}"
