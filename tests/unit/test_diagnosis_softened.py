"""Slip in a joint whose model was fitted to a quiet machine: its spring holds the contacts that stick."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.joint_slip import JointSlip
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure, StructureTolerances
from cutvib_ss.results import ComplexArray, FloatArray, MeasuredFrequencyResponse

MASS, LOSS, SPRING = 2.0, 0.008, 2.8e5
STICKING, TORQUE = 0.02 * SPRING, 0.3
NATURAL = float(np.sqrt(SPRING / MASS))
QUIET = Structure(
    SecondOrder(
        np.array([[MASS]]), np.array([[LOSS * SPRING / NATURAL]]), np.array([[SPRING]]), ("x",), {"joint": np.ones(1)}
    ),
    {"y": Channel("joint", "acceleration")},
    "joint",
    tolerance=StructureTolerances(0.02, 0.1, 0.005, 0.02),
)


def jenkins(amplitude: float) -> complex:
    """Describing function of an elastic contact that slides: closed form, by the angle at which it does."""
    if amplitude * STICKING <= TORQUE:
        return complex(STICKING)
    angle = float(np.arccos(1.0 - 2.0 * TORQUE / (STICKING * amplitude)))
    return STICKING / np.pi * (angle - 0.5 * np.sin(2 * angle) + 1j * np.sin(angle) ** 2)


def swept(force: float, freq: FloatArray) -> ComplexArray:
    """Accelerance of a mass on a spring and such a contact, which together are the model's spring at rest."""
    out = np.empty(freq.size, dtype=np.complex128)
    amplitude = force / (LOSS * SPRING)
    for i, s in enumerate(2j * np.pi * freq):
        for _ in range(500):
            z = MASS * s**2 + LOSS * SPRING / NATURAL * s + SPRING - STICKING + jenkins(amplitude)
            amplitude += 0.2 * (force / abs(z) - amplitude)
        out[i] = s**2 / z
    return out


def rig() -> Campaign:
    """Stepped sines of four levels, with noise of half a percent."""
    rng, records = np.random.default_rng(2), []
    freq = NATURAL / (2 * np.pi) * np.linspace(0.965, 1.02, 45)
    for force in (0.1, 0.4, 1.0, 2.0):
        data = swept(force, freq)
        data *= 1 + 0.005 * (rng.standard_normal(freq.size) + 1j * rng.standard_normal(freq.size)) / np.sqrt(2)
        shape = (1, 1, 1, freq.size)
        frf = MeasuredFrequencyResponse(
            data=data.reshape(shape), freq=freq, positions=np.array([np.nan]), outputs=("y",), inputs=("force",),
            quantities=("acceleration",), input_unit="N", variance=(0.005 * np.abs(data.reshape(shape))) ** 2,
            coherence=np.full(shape, np.nan), averages=1,
        )  # fmt: skip
        records.append(
            Record(f"r{force}", "frf", None, force, None, ("y",), ("acceleration",), (), frf=frf, excitation="sine")
        )
    return Campaign("", Path(), QUIET, tuple(records), ())


def test_a_contact_that_sticks_is_a_part_of_the_spring_that_was_fitted() -> None:
    outlook = Records(observe(rig(), QUIET).entries).for_laws(
        SETTINGS.search_coarse_lines, SETTINGS.search_coarse_error
    )
    assert outlook is not None
    scan = Scan(QUIET, outlook, Hypothesis(), None, {"joint": 2e-4}, apart=True)
    for start in (DryFriction("joint", TORQUE, STICKING), JointSlip("joint", STICKING, TORQUE, 0.3)):
        beside, within = scan.as_it_stands(start), scan.softened(start)
        assert within.gain > beside.gain + 0.5 * abs(scan.leaves)
        # The stiffness begins lower by as much: in tolerances, ln(1 - 0.02)/0.005.
        assert within.warm is not None
        assert within.warm.min() == pytest.approx(np.log(0.98) / 0.005)
        assert scan.promise([start]).warm is not None
        assert scan.refined(within).warm is within.warm


def test_what_no_tolerance_holds_is_not_tried() -> None:
    outlook = Records(observe(rig(), QUIET).entries).for_laws(
        SETTINGS.search_coarse_lines, SETTINGS.search_coarse_error
    )
    assert outlook is not None
    scan = Scan(QUIET, outlook, Hypothesis(), None, {"joint": 2e-4}, apart=True)
    for stiffness in (0.2 * SPRING, 2.0 * SPRING):
        assert scan.softened(DryFriction("joint", TORQUE, stiffness)).gain == -np.inf
    assert DryFriction("joint", TORQUE).stiffness_at_rest == 0.0
