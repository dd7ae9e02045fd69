"""The trial's machine shares no code with the package that diagnoses."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

RIG = Path(__file__).parents[2] / "cutvib_ss" / "validation" / "rig"


@pytest.mark.parametrize("path", sorted(RIG.glob("*.py")), ids=lambda path: path.stem)
def test_it_imports_nothing_of_the_package_but_itself(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    imported += [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    own = [name for name in imported if name.split(".")[0] == "cutvib_ss"]
    assert all(name.startswith("cutvib_ss.validation.rig") for name in own)
    assert not any(isinstance(node, ast.ImportFrom) and node.level for node in ast.walk(tree))


def test_a_campaign_is_drawn_and_written_without_loading_anything_that_models_or_fits(tmp_path: Path) -> None:
    pytest.importorskip("exudyn")
    program = """
import sys
from pathlib import Path
from cutvib_ss.validation.draw import main
request = {"seed": 3, "kind": "single", "cause": "tool_contact", "severity": [1.0, 1.1], "small": True, "traits": ["drifting"]}
main(request, Path(sys.argv[1]))
print(sorted({name.split(".")[1] for name in sys.modules if name.startswith("cutvib_ss.")}))
"""
    ended = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=True, cwd=RIG.parents[2]
    )
    assert ended.stdout.strip() == "['errors', 'validation']"
    assert (tmp_path / "campaign" / "campaign.toml").is_file()
    assert (tmp_path / "fresh" / "campaign.toml").is_file()
