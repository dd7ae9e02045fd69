"""A restoring force that is a linear element wherever anything moves is none."""

from types import SimpleNamespace

import pytest

from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.ranking import acts_linearly
from cutvib_ss.effects.base import Effect
from cutvib_ss.effects.bilinear_stiffness import BilinearStiffness
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.joint_slip import JointSlip
from cutvib_ss.effects.quadratic_damping import QuadraticDamping
from cutvib_ss.model.machine import published_machine

MACHINE = published_machine()


@pytest.mark.parametrize(
    ("effect", "linear"),
    [
        # Sliding begins at a thousand times what the contacts bear at 0.1 mrad
        (JointSlip("joint2", 3000.0, 300.0, 0.5), True),
        # With a spread of one the weakest slides at once, but hardly any of them does
        (JointSlip("joint2", 3000.0, 300.0, 1.0, 0.9), True),
        (JointSlip("joint2", 3000.0, 0.2, 0.5), False),
        (CubicStiffness("joint2", 1e9), False),
        (QuadraticDamping("joint2", 0.5), False),
        # It is alike at all amplitudes, but not in both directions
        (BilinearStiffness("joint2", 0.2), False),
    ],
)
def test_only_what_changes_with_the_amplitude_is_a_restoring_force(effect: Effect, linear: bool) -> None:
    made = SimpleNamespace(model=effect.apply(MACHINE), hypothesis=Hypothesis((effect,), {"joint2": 1e-4}))
    assert acts_linearly(made) is linear


def test_without_a_known_motion_it_stays() -> None:
    effect = JointSlip("joint2", 3000.0, 300.0, 0.5)
    assert not acts_linearly(SimpleNamespace(model=effect.apply(MACHINE), hypothesis=Hypothesis((effect,))))
