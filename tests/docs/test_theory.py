"""What the theory page says of the code is so: modules that it names exist, its describing functions are those of the laws."""

import re
from pathlib import Path

import numpy as np
import pytest

import cutvib_ss
from cutvib_ss.model.restoring_forces import base
from cutvib_ss.model.restoring_forces.bilinear_stiffness import BilinearStiffness
from cutvib_ss.model.restoring_forces.cubic_stiffness import CubicStiffness
from cutvib_ss.model.restoring_forces.dry_friction import DryFriction
from cutvib_ss.model.restoring_forces.freeplay import Freeplay
from cutvib_ss.model.restoring_forces.quadratic_damping import QuadraticDamping

ROOT = Path(cutvib_ss.__file__).parent
PAGE = (ROOT.parent / "docs" / "theory.md").read_text(encoding="utf-8")
FOLDERS = "model|response|measurement|identification|diagnosis|absorber|control_design|effects"


def test_every_module_that_is_named_exists() -> None:
    named = set(re.findall(rf"`((?:{FOLDERS})\.\w+)", PAGE))
    assert len(named) > 30
    missing = [n for n in named if not (ROOT / f"{n.replace('.', '/')}.py").is_file() and not _is_package(n)]
    assert not missing


def _is_package(name: str) -> bool:
    return (ROOT / name.replace(".", "/") / "__init__.py").is_file()


A, W = 0.013, 700.0
RHO = 0.004 / A
REACH = min(3.0 / (900.0 * A), 1.0)
ANGLE = np.arccos(1 - 2 * REACH)


@pytest.mark.parametrize(
    ("law", "written"),
    [
        (CubicStiffness(2e5), 0.75 * 2e5 * A**2),
        (Freeplay(0.004, 800.0, 1000.0), 200.0 - 1000.0 * 2 / np.pi * (np.arcsin(RHO) + RHO * np.sqrt(1 - RHO**2))),
        (BilinearStiffness(0.3, 800.0), 0.0),
        (QuadraticDamping(0.4), 8j / (3 * np.pi) * 0.4 * W**2 * A),
        (DryFriction(3.0), 4j * 3.0 / (np.pi * A)),
        (
            DryFriction(3.0, 900.0),
            900.0 / np.pi * (ANGLE - 0.5 * np.sin(2 * ANGLE)) + 4j * 900.0 / np.pi * REACH * (1 - REACH),
        ),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_describing_functions_are_those_of_the_force(law: base.RestoringForce, written: complex) -> None:
    """The written formula, the law's own, and the fundamental of its force along a cosine, second period."""
    t = np.linspace(0.0, 4 * np.pi, 200_001)
    force = law.force(A * np.cos(t), -A * W * np.sin(t))[100_000:-1]
    fundamental = 2 * np.mean(force * np.exp(-1j * t[100_000:-1])) / A
    assert law.describing_function(A, W) == pytest.approx(written, rel=1e-9, abs=1e-9)
    assert fundamental == pytest.approx(written, rel=2e-4, abs=1e-2)
