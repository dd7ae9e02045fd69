"""A diagnosis made by hand, for tests of the pictures, the report and the commands: no diagnosing code runs."""

from dataclasses import replace

import numpy as np

from cutvib_ss.diagnosis.result import (
    Cause,
    Comparison,
    Diagnosis,
    ErrorFigure,
    FittedParameter,
    GapFigures,
    NextTest,
    Verdict,
    Where,
)
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.rail import EndSupports
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import MeasuredFrequencyResponse

POSITIONS = (0.06, 0.27, 0.46, 0.68, 0.9)


def softened(machine: Machine) -> Machine:
    """The machine on ends that give."""
    return replace(machine, rail=replace(machine.rail, supports=EndSupports(1.3e7, 3.0e7, 130.0, 300.0)))


def measured(machine: Machine | Structure, position: float | None, freq: np.ndarray) -> MeasuredFrequencyResponse:
    """The model's response with noise of a known variance."""
    frf = frequency_response(machine, None if position is None else [position], freq)
    noise = 0.004 * float(np.abs(frf.data).max())
    rng = np.random.default_rng(5)
    scatter = rng.standard_normal((2, *frf.data.shape)) * noise / np.sqrt(2)
    return MeasuredFrequencyResponse(
        frf.data + scatter[0] + 1j * scatter[1], frf.freq, frf.positions, frf.outputs, frf.inputs, frf.quantities,
        variance=np.full(frf.data.shape, noise**2), averages=3,
    )  # fmt: skip


def example_diagnosis(verdict: Verdict = "explained", lines: int = 900, records: int = 5) -> Diagnosis:
    """Ends that give, found on the published machine; figures are plausible, not computed."""
    nominal = published_machine()
    corrected = softened(nominal)
    tuned = replace(nominal, head=replace(nominal.head, k1=0.99 * nominal.head.k1))
    freq = np.linspace(15.0, 450.0, lines)
    comparisons = tuple(
        Comparison(
            f"records/p{k + 1}.tdms",
            measured(corrected, y, freq),
            *(frequency_response(m, [y], freq) for m in (nominal, tuned, corrected)),
        )
        for k, y in enumerate(POSITIONS[:records])
    )
    parameters = {
        "k_left": FittedParameter(1.31e7, 2.4e5, "N/m"),
        "k_right": FittedParameter(2.96e7, 9.1e5, "N/m"),
        "c_left": FittedParameter(131.0, 40.0, "N s/m"),
        "c_right": FittedParameter(288.0, 120.0, "N s/m"),
    }
    probable = {"explained": 0.981, "partly_explained": 0.95, "ambiguous": 0.61, "unknown": 0.3, "no_gap": 0.01}[
        verdict
    ]
    causes = [
        Cause("support_compliance", "rail_ends", probable, parameters, 0.00214, 0.93, 1.03),
        Cause("guide_compliance", "head_base", 0.985 - probable, {
            "stiffness": FittedParameter(4.2e7, 3e6, "N/m"), "damping": FittedParameter(310.0, float("nan"), "N s/m"),
        }, 0.0121, 0.58, 4.1),
        Cause("none", "none", 0.005, {}, 0.0190, 0.33, 11.2),
        Cause("unknown", "rail_ends", 0.006),
        Cause("parameter_shift", "joint2", 0.003, {"factor": FittedParameter(0.97, 0.01, "1")}, 0.0182, 0.36, 9.8),
        Cause("local_resonator", "head", 0.001, {}, 0.0175, 0.39, 9.0),
        Cause("added_mass", "tool", 0.0, {}, 0.0189, 0.33, 11.0),
    ]  # fmt: skip
    if verdict == "partly_explained":
        causes[0] = replace(causes[0], effect="support_compliance+unknown", place="rail_ends+joint2")
    if verdict == "no_gap":
        causes = [Cause("none", "none", 0.985, {}, 0.0020, 0.9, 1.0)] + [c for c in causes if c.effect != "none"]
    where = Where(
        place="none" if verdict == "no_gap" else "rail_ends",
        places=(("rail_ends", 0.985), ("head_base", 0.01), ("joint2", 0.005)),
        bands_hz=() if verdict == "no_gap" else ((18.0, 41.5), (80.0, 130.0), (190.0, 300.0)),
        by_position=tuple(ErrorFigure(y, e, 0.0019) for y, e in zip(POSITIONS, (0.031, 0.017, 0.012, 0.014, 0.022))),
        by_channel=tuple(
            ErrorFigure(c, e, 0.0019) for c, e in zip(("tool_x", "tool_z", "base_x"), (0.016, 0.028, 0.012))
        ),
        level_dependent=False,
    )
    next_test = NextTest("tells support_compliance from guide_compliance", 0.02, 60.0, "base_x")
    return Diagnosis(
        verdict=verdict,
        gap=GapFigures("g/N", 0.0286, 0.0190, 0.00214, 0.0019, (15.0, 450.0), 0.925, (0.91, 0.94)),
        where=where,
        causes=tuple(causes),
        ambiguity_set=(0, 1) if verdict == "ambiguous" else (0,),
        next_test=next_test if verdict == "ambiguous" else None,
        title="Example <campaign> & more",
        warnings=("records/p2.tdms: blow 2: double hit 14 ms after the first; left out",),
        nominal=nominal,
        corrected_machine=nominal if verdict == "no_gap" else corrected,
        comparisons=comparisons,
    )


def example_structure() -> Structure:
    """Two masses on springs, read as displacement and acceleration."""
    system = SecondOrder(
        mass=np.diag([2.0, 1.0]),
        damping=np.array([[3.0, -1.0], [-1.0, 1.0]]),
        stiffness=np.array([[3e5, -1e5], [-1e5, 1e5]]),
        dofs=("x1", "x2"),
        ports={"drive": np.array([1.0, 0.0]), "top": np.array([0.0, 1.0])},
    )
    return Structure(system, {"y": Channel("drive", "displacement"), "a": Channel("top", "acceleration")}, "drive")
