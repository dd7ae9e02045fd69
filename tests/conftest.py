"""What all tests share: no display, one hypothesis profile a run, and the real records where they are at hand."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# Through the environment, so that it reaches subprocesses too and matplotlib is imported only by tests that draw.
os.environ["MPLBACKEND"] = "Agg"

# `ci` draws the same examples every time: a gate must not fail by luck. `thorough` looks for new ones.
settings.register_profile(
    "ci", deadline=None, max_examples=15, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("thorough", deadline=None, max_examples=200, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of measured records beside the checkout; tests that need it are skipped where it is absent."""
    folder = ROOT.parent / "shared"
    if not folder.is_dir():
        pytest.skip(f"no measured records at {folder}")
    return folder
