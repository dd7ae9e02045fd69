"""One check for all controllers: on every machine and at every position, with the rail's modes that the design left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import control
import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.absorber import WORKING_FREQUENCY
from cutvib_ss.control_design.hardware import MOTIONS, Hardware, control_plant
from cutvib_ss.control_design.loop import Loop
from cutvib_ss.control_design.margins import Margins, margins
from cutvib_ss.control_design.result import ControllerCheck
from cutvib_ss.control_design.scheduling import ScheduledController
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.measurement_chain import MeasurementChain
from cutvib_ss.parameters import check_number
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import ComplexArray, FloatArray, FrequencyResponse

FULL_ORDER = 20
"""Modes of the rail on which controllers are checked: the last far above every bandwidth (12.7 kHz)."""


def check_positions(count: int = 25) -> FloatArray:
    """
    Positions over the whole rail.

    Parameters
    ----------
    count : int
        How many.

    Returns
    -------
    ndarray, shape (position,)
        y_b / L from 0.02 to 0.98, evenly.
    """
    return np.linspace(0.02, 0.98, count)


def full_order(machine: Machine, n_modes: int = FULL_ORDER) -> Machine:
    """
    A machine with at least so many modes of the rail.

    Parameters
    ----------
    machine : Machine
        The machine.
    n_modes : int
        Modes wanted.

    Returns
    -------
    Machine
        The same machine where it has as many already.
    """
    parameters = machine.rail.parameters
    if parameters.n_modes >= n_modes:
        return machine
    return replace(machine, rail=replace(machine.rail, parameters=replace(parameters, n_modes=n_modes)))


def check_controller(
    controller: control.StateSpace | ScheduledController,
    machines: Machine | Mapping[str, Machine],
    positions: ArrayLike | None = None,
    hardware: Hardware | None = None,
    name: str = "controller",
    n_modes: int = FULL_ORDER,
    freq: ArrayLike | None = None,
    working_frequency: float = WORKING_FREQUENCY,
) -> ControllerCheck:
    """
    What a controller does on machines over all positions.

    Parameters
    ----------
    controller : control.StateSpace or ScheduledController
        Sensors' signals to commands, u = K y; a continuous one is run at the hardware's sampling (`discretised`).
    machines : Machine or mapping of str to Machine
        What it is to work on: the nominal machine, corrected ones.
    positions : array_like, shape (position,), optional
        y_b / L; 25 from 0.02 to 0.98 by default.
    hardware : Hardware, optional
        Actuators, sensors and sampling that it was designed for.
    name : str
        What the controller is called.
    n_modes : int
        Modes of the rail in the plant that it is checked on, at least.
    freq : array_like, shape (frequency,), optional
        Frequencies of the responses [Hz]; 100 to 350 Hz by default, finely around the working frequency.
    working_frequency : float
        Frequency of the tool's force [Hz].

    Returns
    -------
    ControllerCheck
        Stability, margins, attenuation and effort.

    Raises
    ------
    ParameterError
        If controller and hardware do not fit, or a position is outside the rail.
    """
    kit = hardware or Hardware()
    named = dict(machines) if isinstance(machines, Mapping) else {"machine": machines}
    places = check_positions() if positions is None else np.atleast_1d(np.asarray(positions, dtype=float))
    check_number("working_frequency", working_frequency, 0.0, strict=True)
    fine = working_frequency + np.arange(-50, 51) / 5
    lines = np.union1d(np.arange(100.0, 350.5), fine) if freq is None else np.asarray(freq, dtype=float)
    full = [replace(full_order(m, n_modes), chain=MeasurementChain()) for m in named.values()]
    here = [[_visit(controller, m, float(y), kit, working_frequency, lines) for y in places] for m in full]
    table = {f.name: np.array([[getattr(visit, f.name) for visit in row] for row in here]) for f in fields(_Visit)}
    bare = [frequency_response(m, places, [working_frequency], form="accelerance", outputs=MOTIONS).data for m in full]
    over_band = table.pop("over_band")
    return ControllerCheck(
        name=name,
        machines=tuple(named),
        positions=places,
        working_frequency=working_frequency,
        outputs=MOTIONS,
        before=np.abs(np.array([b[:, :, 0, 0].T for b in bare])),
        passive=np.swapaxes(table.pop("passive"), 1, 2),
        after=np.swapaxes(table.pop("after"), 1, 2),
        open=tuple(frequency_response(m, places, lines, form="accelerance", outputs=MOTIONS[:1]) for m in full),
        closed=tuple(
            FrequencyResponse(data[:, None, None], lines, places, MOTIONS[:1], ("force",), ("acceleration",))
            for data in over_band
        ),
        **table,
    )


@dataclass(frozen=True)
class _Visit:
    """What is found at one position of one machine; the fields of a `ControllerCheck`, without their axes."""

    growth_rate: float
    growth_freq: float
    passive: FloatArray
    after: FloatArray
    effort: float
    noise_command: float
    disk_margin: float
    gain_margin: float
    phase_margin: float
    delay_margin: float
    over_band: ComplexArray


def _visit(
    controller: control.StateSpace | ScheduledController,
    machine: Machine,
    position: float,
    kit: Hardware,
    working_frequency: float,
    lines: FloatArray,
) -> _Visit:
    own = controller.at(position) if isinstance(controller, ScheduledController) else controller
    loop = Loop(control_plant(machine, position, kit, False, working_frequency), own, kit.sampling)
    slowest = loop.poles[np.argmax(loop.poles.real)]
    passive, active, command = loop.response(np.append(working_frequency, lines))
    stable = bool(slowest.real < 0.0)
    found = margins(loop.gain, loop.poles) if stable else Margins(0.0, 1.0, 1.0, 0.0, 0.0)
    return _Visit(
        growth_rate=float(slowest.real),
        growth_freq=float(abs(slowest.imag)) / (2 * np.pi),
        passive=np.abs(passive[: len(MOTIONS), 0]),
        # An unstable loop has no response; what the formula gives says nothing.
        after=np.abs(active[: len(MOTIONS), 0]) if stable else np.full(len(MOTIONS), np.nan),
        effort=float(np.linalg.norm(command[:, 0])) if stable else np.nan,
        noise_command=loop.command_noise([s.noise_density for s in kit.sensors]) if stable else np.nan,
        disk_margin=found.disk,
        gain_margin=found.gain,
        phase_margin=found.phase,
        delay_margin=found.delay,
        over_band=active[0, 1:] if stable else np.full(lines.size, np.nan, dtype=np.complex128),
    )
