"""The trial's machine shares no code with the package that diagnoses."""

import ast
from pathlib import Path

import pytest

RIG = Path(__file__).parents[2] / "cutvib_ss" / "blind" / "rig"


@pytest.mark.parametrize("path", sorted(RIG.glob("*.py")), ids=lambda path: path.stem)
def test_it_imports_nothing_of_the_package_but_itself(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    imported += [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    own = [name for name in imported if name.split(".")[0] == "cutvib_ss"]
    assert all(name.startswith("cutvib_ss.blind.rig") for name in own)
    assert not any(isinstance(node, ast.ImportFrom) and node.level for node in ast.walk(tree))
