"""What importing the package and asking for help may load: no windows, no pyplot, nothing that takes a second."""

import json
import subprocess
import sys
from pathlib import Path

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


MISTYPED = [
    (["diagnose", "nowhere"], "nowhere: there is no such file; a campaign is a folder"),
    (["diagnose", "FOLDER"], "campaign.toml: there is no such file; `cutvib campaign init"),
    (["diagnose", "FOLDER/x.toml", "--report", "nowhere/x.html"], "there is no folder nowhere; make it first"),
    (["diagnose", "FOLDER/x.toml", "--machine", "nowhere.toml"], "nowhere.toml: there is no such file"),
    (["diagnose", "FOLDER/x.toml", "--band", "300:10"], "--band 300:10: needs 0 < LO < HI"),
    (["identify", "nowhere"], "nowhere: there is no such file"),
    (["campaign", "show", "nowhere"], "nowhere: there is no such file"),
    (["campaign", "init", "nowhere"], "nowhere: there is no such folder"),
    (["modes"], "--position is missing"),
    (["modes", "--position", "2"], "must lie strictly between 0 and 1"),
    (["frf", "--position", "0.5", "--freq", "1:2"], "--freq 1:2: give LO:HI:STEP"),
    (["bode", "--position", "0.5", "--out", "x.gif"], "x.gif: suffix '.gif' is no picture"),
    (["schedule", "--machine", "nowhere.toml"], "nowhere.toml: there is no such file"),
    (["simulate", "--position", "0.5", "--force", "nowhere.csv"], "nowhere.csv: there is no such file"),
    (["simulate"], "--position is missing"),
    (["simulate", "--position", "0.5", "--fs", "0"], "'--fs': 0 must be greater than 0"),
    (["simulate", "--position", "0.5", "--duration", "nan"], "'--duration': nan must be greater than 0"),
    (["absorber", "check", "--mass", "-1"], "'--mass': -1 must be greater than 0"),
    (["absorber", "check", "--damping-ratio", "-1"], "'--damping-ratio': Input should be greater than or equal to 0"),
    (["control", "design", "h2", "--rate", "-1"], "'--rate': Input should be greater than or equal to 0"),
    (["absorber", "check", "--plot", "x.bmp"], "x.bmp: suffix '.bmp' is no picture"),
    (["control", "check", "--corrected", "nowhere.toml"], "nowhere.toml: there is no such file"),
    (["plan"], "--position is missing"),
    (["plan", "--position", "0.5", "--level", "-3"], "--level, --block and --noise must be above zero"),
    (["campaign", "init", "EMPTY"], "is empty; give the folder with the .tdms"),
    (["blind", "score", "nowhere"], "nowhere: there is no such folder"),
    (["blind", "real", "nowhere"], "nowhere: there is no such folder"),
    (["fleet", "nowhere"], "nowhere: there is no such folder"),
    (["serve", "nowhere"], "nowhere: there is no such file"),
    (["figures", "--out", "FOLDER/x.toml/figures"], "x.toml/figures: cannot be made a folder"),
    (["figures", "--format", "gif"], "suffix '.gif' is no picture"),
]
RUN_THEM = """
import contextlib, io, json, sys
from cutvib_ss.cli import main
told = []
for arguments in json.loads(sys.argv[1]):
    with contextlib.redirect_stderr(io.StringIO()) as said:
        told.append([main(arguments), said.getvalue(), sorted({name.split(".")[0] for name in sys.modules})])
print(json.dumps(told))
"""


def _filled(part: str, named: dict[str, str]) -> str:
    for key, value in named.items():
        part = part.replace(key, value)
    return part


def test_simple_errors_are_told_before_anything_slow_is_imported(tmp_path: Path) -> None:
    """scipy and control take seconds to import: whoever mistypes a name waits for neither."""
    (tmp_path / "x.toml").touch()
    (tmp_path / "empty").mkdir()
    named = {"FOLDER": str(tmp_path), "EMPTY": str(tmp_path / "empty")}
    asked = [[_filled(part, named) for part in arguments] for arguments, _ in MISTYPED]
    ended = subprocess.run(
        [sys.executable, "-c", RUN_THEM, json.dumps(asked)], capture_output=True, text=True, check=True, timeout=120
    )
    for (arguments, words), (status, said, loaded) in zip(MISTYPED, json.loads(ended.stdout), strict=True):
        assert status == 2, (arguments, said)
        assert words in said
        assert len(said.splitlines()) == 1
        assert not {"scipy", "control", "matplotlib", "numba"} & set(loaded), arguments
