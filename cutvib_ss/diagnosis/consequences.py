"""
Consequences of a diagnosis: the vibration at the tool's frequency now and with the cause fixed, and a controller on both models.

Tuning and effect are drawn from the fit's covariance; each draw gives one machine as it is and one with the effect taken off, so
that what both share cancels in their ratio. A cause that depends on the level is taken at the motion that the records had.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cutvib_ss.absorber import WORKING_FREQUENCY
from cutvib_ss.diagnosis.consequence_result import Consequence, Consequences, Loop
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.linearity import motions
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.result import Verdict
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulation import unforced_problem
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.model.measurement_chain import MeasurementChain
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.harmonic_balance import sine_response
from cutvib_ss.results import FloatArray
from cutvib_ss.results.arrays import position_at, positions_given

CONTROLLER = "resonant"
"""The prototype that is designed on the nominal model."""


def consequences(
    nominal: Model, fit: Fit, records: Records, observed: Observations, verdict: Verdict, seed: int
) -> Consequences | None:
    """What the chosen cause means for the machine."""
    channel = "tool_x" if "tool_x" in nominal.channels else observed.channels[0]
    frequency = WORKING_FREQUENCY if nominal.has_position else _loudest(fit.model, channel, observed.band)
    problem = unforced_problem(nominal, records, fit.hypothesis)
    by_level = bool(fit.model.nonlinear)
    positions = _places(records, SETTINGS.consequence_positions_laws if by_level else SETTINGS.consequence_positions)
    warnings = _warnings(fit, records, observed, verdict, frequency)
    force = 0.0
    try:
        if by_level:
            force = _force(fit, records, positions, frequency)
            warnings.append(
                f"depends on the level: taken under a sine of {force:.3g} N, which moves the place as far as the middle record did"
            )
        draws = _draws(problem, fit, SETTINGS.consequence_draws_laws if by_level else SETTINGS.consequence_draws, seed)
        pairs = np.array([_pair(problem, x, positions, frequency, channel, force) for x in draws])
    except CutvibError as error:
        return Consequences(frequency, channel, observed.unit, (), warnings=(*warnings, str(error)))
    scale = 1.0 / observed.per_unit
    # Records of all levels are merged: no measure of what depends on the level.
    measured = [None] * positions.size if by_level else _measured(records, positions, frequency, channel)
    vibration = []
    for i, position in enumerate(positions):
        now, fixed = (scale * pairs[:, side, i] for side in (0, 1))
        vibration.append(
            Consequence(
                position=position_at(position),
                now=float(now[0]),
                now_interval=_interval(now[1:]),
                fixed=float(fixed[0]),
                fixed_interval=_interval(fixed[1:]),
                ratio_interval=_interval(fixed[1:] / now[1:]),
                measured=None if (value := measured[i]) is None else scale * value,
            )
        )
    loops, told = _loops(nominal, fit.model, positions)
    return Consequences(
        frequency=frequency,
        channel=channel,
        unit=observed.unit,
        vibration=tuple(vibration),
        controller=f"{CONTROLLER}, scheduled over the positions, designed on the nominal model" if loops else "",
        loops=loops,
        warnings=(*warnings, *told),
    )


def _loudest(model: Model, channel: str, band: tuple[float, float]) -> float:
    freq = np.linspace(*band, 2000)
    return float(freq[np.argmax(np.abs(frequency_response(model, None, freq, outputs=[channel]).data))])


def _places(records: Records, most: int) -> FloatArray:
    places = np.unique([e.position for e in records.entries if e.position is not None])
    if not places.size:
        return np.array([np.nan])
    few: FloatArray = places[np.unique(np.linspace(0, places.size - 1, min(most, places.size)).round().astype(int))]
    return few


def _warnings(fit: Fit, records: Records, observed: Observations, verdict: Verdict, frequency: float) -> list[str]:
    out = []
    if verdict == "unknown":
        out.append("the cause is not known: these figures are those of the best candidate")
    elif verdict == "ambiguous":
        out.append("several causes remain: these figures are those of the likeliest")
    low, high = observed.band
    if not low <= frequency <= high:
        out.append(f"{frequency:.4g} Hz lies outside the measured band of {low:.4g} to {high:.4g} Hz: extrapolated")
    places = _places(records, len(records.entries))
    if np.isfinite(places).all() and places.size < 3:
        out.append("fewer than three positions were measured: elsewhere on the rail the corrected model extrapolates")
    levels = {e.level for e in records.entries if e.level is not None}
    if fit.model.nonlinear and len(levels) < 2:
        out.append("one level was measured: at any other the corrected model extrapolates")
    if any(place == "measurement" for place in fit.hypothesis.place.split("+")):
        out.append("the fault lies in the measurement: fixing it changes the readings, not the vibration")
    return out


def _force(fit: Fit, records: Records, positions: FloatArray, frequency: float) -> float:
    """Amplitude of a sine at which the restoring force's port moves, by the linear model, as far as in the middle record."""
    port = fit.model.nonlinear[0].port
    plain = replace(fit.model, nonlinear=())
    moved = motions(plain, records).get(port)
    places = positions_given(positions)
    per_newton = np.abs(frequency_response(plain, places, [frequency], form="receptance", outputs=[port]).data).mean()
    return float(np.sqrt(moved.low * moved.high) / per_newton) if moved is not None else 1.0


def _draws(problem: Problem, fit: Fit, count: int, seed: int) -> FloatArray:
    """The fit's unknowns, then others within their bounds, from the covariance widened by the fit's reduced χ²."""
    low, high = problem.bounds()
    # Without the forces of single records, which say nothing of the machine.
    kept = np.r_[: problem.first_effect, fit.first_effect : fit.x.size]
    spread = fit.covariance[np.ix_(kept, kept)] * max(fit.chi2 / max(fit.count, 1), 1.0)
    values, vectors = np.linalg.eigh((spread + spread.T) / 2)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    normal = np.vstack([np.zeros(kept.size), np.random.default_rng(seed).standard_normal((count, kept.size))])
    draws: FloatArray = np.clip(fit.x[kept] + normal @ root.T, low, high)
    return draws


def _pair(
    problem: Problem, x: FloatArray, positions: FloatArray, frequency: float, channel: str, force: float
) -> FloatArray:
    """Modulus at the working frequency now and with the effects taken off, shape (2, position); no sensor's fault in either."""
    out = []
    places = positions_given(positions)
    for model in (problem.applied(x), problem.tuned(x)):
        bare = replace(model, chain=MeasurementChain())
        if bare.nonlinear:
            frf = sine_response(bare, places, [frequency], force, outputs=[channel], viscous_at=frequency)
        else:
            frf = frequency_response(bare, places, [frequency], outputs=[channel])
        out.append(np.abs(frf.data[:, 0, 0, 0]))
    return np.array(out)


def _interval(values: FloatArray) -> tuple[float, float]:
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)


def _measured(records: Records, positions: FloatArray, frequency: float, channel: str) -> list[float | None]:
    """Modulus at the nearest line, where the position was measured and the band holds it."""
    out: list[float | None] = []
    for position in positions:
        found = None
        for g in records.merged:
            own = np.array([name == FORCE for name in g.inputs])
            here = np.flatnonzero(own & ((g.positions == position) | (np.isnan(g.positions) & np.isnan(position))))
            step = float(np.median(np.diff(g.freq)))
            if here.size and channel in g.channels and g.freq[0] - step <= frequency <= g.freq[-1] + step:
                line = int(np.argmin(np.abs(g.freq - frequency)))
                found = float(np.abs(g.data[here[0], g.channels.index(channel), line]))
        out.append(found)
    return out


def _loops(nominal: Model, corrected: Model, positions: FloatArray) -> tuple[tuple[Loop, ...], Sequence[str]]:
    """The prototype on both machines; none for other structures."""
    if nominal.rail is None or corrected.rail is None:
        return (), ()
    # Late: python-control takes long to load, and without a rail there is no controller.
    from cutvib_ss.control_design import check_controller, prototype, schedule

    kind = prototype(CONTROLLER)
    hardware = kind.hardware(kind.port, None)
    try:
        made = schedule(lambda y: kind.design(nominal, y, hardware), positions)
        machines = {"nominal": nominal, "corrected": replace(corrected, nonlinear=())}
        # Over the band nothing is shown.
        lines, modes = [WORKING_FREQUENCY], SETTINGS.consequence_modes
        check = check_controller(made, machines, positions, hardware, CONTROLLER, modes, lines)
    except CutvibError as error:
        return (), (f"no controller was checked: {error}",)
    told = ["the controller was checked without the nonlinear force"] if corrected.nonlinear else []
    quieter = 20 * np.log10(check.before[:, 0] / check.after[:, 0])
    loops = [
        Loop(
            position=float(y),
            stable=bool(check.growth_rate[1, i] < 0.0),
            nominal_margin=float(check.disk_margin[0, i]),
            corrected_margin=float(check.disk_margin[1, i]),
            nominal_attenuation_db=float(quieter[0, i]),
            corrected_attenuation_db=float(quieter[1, i]),
        )
        for i, y in enumerate(positions)
    ]
    return tuple(loops), told
