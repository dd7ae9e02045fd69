"""The catalogue's causes, and which of their forms is drawn."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cutvib_ss.validation.rig.chain_forms import CHAIN_FORMS
from cutvib_ss.validation.rig.head_forms import HEAD_FORMS
from cutvib_ss.validation.rig.law_forms import LAW_FORMS
from cutvib_ss.validation.rig.rail_forms import RAIL_FORMS
from cutvib_ss.validation.rig.sites import Form

FORMS: Mapping[str, tuple[Form, ...]] = {**RAIL_FORMS, **HEAD_FORMS, **LAW_FORMS, **CHAIN_FORMS}
"""Forms of each cause, the catalogue's first. `modal_truncation`, which is no part, has one form only."""

FRAME_CAUSES = (
    "local_resonator", "added_mass", "tool_contact", "parameter_shift", "cubic_stiffness", "freeplay", "dry_friction", "joint_slip",
    "bilinear_stiffness", "quadratic_damping", "channel_delay", "calibration_error", "window_damping",
)  # fmt: skip
"""Causes that other structures have too."""

SPRUNG = ("freeplay", "bilinear_stiffness")
"""Those that sit at a spring."""

STORING, LOSING = (
    ("cubic_stiffness", "freeplay", "bilinear_stiffness"),
    ("dry_friction", "joint_slip", "quadratic_damping"),
)
"""Nonlinear forces that store energy, and those that lose it."""


def drawn_form(cause: str, varied: bool, rng: np.random.Generator) -> Form:
    """The catalogue's form of a cause, or one of the others."""
    forms = FORMS[cause]
    return forms[int(rng.integers(1, len(forms)))] if varied else forms[0]
