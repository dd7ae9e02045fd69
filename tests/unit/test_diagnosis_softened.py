"""Slip in a joint whose model was fitted to a quiet machine: its spring holds the contacts that stick."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis import ranking
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypotheses import Candidate, considered, nonlinear_candidates
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Motion
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.joint_slip import JointSlip
from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure, StructureTolerances
from cutvib_ss.model_files import read_machine, write_machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.harmonic_balance import sine_response
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
    for beside in (DryFriction("joint", TORQUE, STICKING), JointSlip("joint", STICKING, TORQUE, 0.3)):
        within = replace(beside, within=True)
        assert scan.as_it_stands(within).gain > scan.as_it_stands(beside).gain + 0.5 * abs(scan.leaves)


def test_its_stiffness_costs_the_spring_nothing() -> None:
    """Four tolerances of the spring that was fitted: known is their sum."""
    records = Records(observe(rig(), QUIET).entries)
    found = fit(
        QUIET, records, Hypothesis((JointSlip("joint", 0.03 * SPRING, 0.2, 0.2, within=True),), {"joint": 2e-4})
    )
    (slip,) = found.corrected.hypothesis.effects
    assert isinstance(slip, JointSlip)
    assert found.reduced < 1.2
    assert slip.stiffness == pytest.approx(STICKING, rel=0.05)
    assert slip.slip_torque == pytest.approx(TORQUE, rel=0.05)
    assert np.abs(found.x[: found.n_tuning]).max() < 2.0


def test_a_model_with_a_contact_within_its_spring_is_that_spring_at_rest() -> None:
    model = DryFriction("joint", TORQUE, STICKING, within=True).apply(QUIET)
    freq, force = NATURAL / (2 * np.pi) * np.linspace(0.96, 1.03, 30), 1e-4
    still = sine_response(model, None, freq, force).data[0, 0, 0]
    assert still == pytest.approx(frequency_response(QUIET, None, freq).data[0, 0, 0], rel=1e-3)
    loud = sine_response(model, None, freq, 1.0).data[0, 0, 0]
    # Three harmonics and more, where the closed form has one.
    assert np.abs(loud - swept(1.0, freq)).max() < 0.02 * np.abs(loud).max()


def test_both_forms_of_a_cause_are_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few lines may favour the wrong one: they count as one among the best."""
    fitted: list[Hypothesis] = []

    def counted(nominal: Structure, records: Records, hypothesis: Hypothesis, *args: object, **keys: object) -> None:
        fitted.append(hypothesis)

    monkeypatch.setattr(ranking, "refit", counted)
    slip = JointSlip("joint", STICKING, TORQUE, 0.3)
    causes = (slip, replace(slip, within=True), DryFriction("joint", TORQUE))
    records = Records(observe(rig(), QUIET).entries).coarse(SETTINGS.search_coarse_lines, 0.1)
    one_step = [fit(QUIET, records, Hypothesis((e,), {"joint": 2e-4}), None, 1) for e in causes]
    rough = [
        (Candidate(str(k), (e,)), replace(f, log_evidence=-float(k)))
        for k, (e, f) in enumerate(zip(causes, one_step, strict=True))
    ]
    with Workers(1) as workers:
        ranking.on_all_lines(QUIET, records, rough, 1, (100.0, 0.0), workers, most=1)
    assert [type(h.effects[0]) for h in fitted] == [JointSlip, JointSlip]


def test_forms_of_a_force_count_as_one_and_channels_do_not() -> None:
    slip, gain = JointSlip("joint", STICKING, TORQUE, 0.3), CalibrationError("measurement", "y", 1.1)
    within, other = replace(slip, within=True), replace(gain, channel="z")
    assert ranking.numbered([Hypothesis((e,)) for e in (slip, gain, within, other)]) == [0, 1, 0, 2]
    # Nor do they beside a restoring force.
    assert ranking.numbered([Hypothesis((slip, e)) for e in (gain, other)]) == [0, 1]
    assert ranking.numbered([Hypothesis((gain, e)) for e in (slip, within)]) == [0, 0]


def test_a_model_with_a_contact_within_its_spring_is_written_and_read(tmp_path: Path) -> None:
    machine = JointSlip("joint2", 500.0, 0.5, 0.3, within=True).apply(published_machine())
    beside = JointSlip("joint2", 500.0, 0.5, 0.3).apply(published_machine())
    for model, said in ((machine, 1), (beside, 0)):
        write_machine(model, tmp_path / "machine.toml")
        assert (tmp_path / "machine.toml").read_text(encoding="utf-8").count("within = true") == said
        assert read_machine(tmp_path / "machine.toml") == model
    with pytest.raises(ParameterError, match="neither true nor false"):
        JointSlip("joint2", 500.0, 0.5, within=1)  # type: ignore[arg-type]


def test_a_contact_is_within_a_spring() -> None:
    free = replace(QUIET, system=replace(QUIET.system, stiffness=np.zeros((1, 1))))
    for model, sticking in ((free, STICKING), (QUIET, np.inf)):
        with pytest.raises(ParameterError, match="at 'joint' is within no spring"):
            DryFriction("joint", TORQUE, sticking, within=True).apply(model)
    motion = {"joint": Motion(1e-5, 2e-4, 0.1, 1.0)}
    starts = {c.name: c.starts for c in nonlinear_candidates(QUIET, motion)}
    for name in ("dry_friction joint within", "joint_slip joint within"):
        for e in starts[name]:
            assert isinstance(e, DryFriction | JointSlip)
            assert e.apply(QUIET).attachments[0].element.stiffness > -SPRING
    assert considered(QUIET, (10.0, 100.0), ("y",))["joint_slip", "joint"] == 2
    assert considered(free, (10.0, 100.0), ("y",))["joint_slip", "joint"] == 1
