"""What importing the package and asking for help may load: no windows, no pyplot, nothing that takes a second."""

import json
import subprocess
import sys

import pytest

# Importing any of these opens a connection to a display, or tries to.
WINDOW_TOOLKITS = {"tkinter", "PyQt5", "PyQt6", "PySide2", "PySide6", "wx", "gi"}
# Each of these takes from a third of a second to a second to import.
SLOW_TO_IMPORT = {"control", "slycot", "numba", "matplotlib.pyplot", "nicegui"}

IMPORT_PACKAGE = "import cutvib_ss"
ASK_FOR_HELP = """
import sys
from cutvib_ss.cli import main
sys.argv = ["cutvib", "--help"]
try:
    status = main()
except SystemExit as end:
    status = end.code
assert not status, status
"""
IMPORT_EVERY_MODULE = """
import importlib, pkgutil, cutvib_ss
for module in pkgutil.walk_packages(cutvib_ss.__path__, "cutvib_ss."):
    if not module.name.endswith(".__main__"):
        importlib.import_module(module.name)
pyplot = sys.modules.get("matplotlib.pyplot")
assert pyplot is None or not pyplot.get_fignums(), "importing a module drew a figure"
"""


def _modules_after(code: str) -> set[str]:
    """Names of the modules that a fresh interpreter holds after running the code."""
    script = f"import sys\n{code}\nimport json\nprint('MODULES ' + json.dumps(sorted(sys.modules)))"
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=120)
    assert ended.returncode == 0, ended.stderr
    return set(json.loads(ended.stdout.rsplit("MODULES ", 1)[1]))


@pytest.mark.parametrize("code", [IMPORT_PACKAGE, ASK_FOR_HELP], ids=["import cutvib_ss", "cutvib --help"])
def test_starting_loads_nothing_slow_and_no_window(code: str) -> None:
    loaded = _modules_after(code)
    assert "cutvib_ss" in loaded
    assert not loaded & (SLOW_TO_IMPORT | WINDOW_TOOLKITS)


def test_no_module_opens_a_window_when_imported() -> None:
    # python-control itself imports pyplot, which by itself opens nothing: here only figures and toolkits count.
    loaded = _modules_after(IMPORT_EVERY_MODULE)
    assert not loaded & WINDOW_TOOLKITS
