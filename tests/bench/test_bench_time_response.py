"""How fast responses in time are: against python-control on the same plant, and blows with a nonlinear joint."""

from dataclasses import replace
from time import perf_counter
from typing import Any

import control
import numpy as np
import pytest

from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.response.pulses import pulse_train
from cutvib_ss.response.stepping import modal_form, step
from cutvib_ss.response.time_response import time_response

LEAST_RATIO = 20.0


def with_modes(n: int) -> Machine:
    machine = published_machine()
    return replace(machine, rail=replace(machine.rail, parameters=replace(machine.rail.parameters, n_modes=n)))


@pytest.mark.benchmark(group="time response")
def test_ten_seconds_of_pulses_are_twenty_times_faster_than_forced_response(benchmark: Any) -> None:
    machine, fs = with_modes(18), 20_000.0  # with the head's two, twenty modes
    force = pulse_train(fs, 10.0, amplitude=100.0)
    ours = benchmark(lambda: time_response(machine, 0.3, force, fs))
    plant = machine.plant(0.3, outputs=list(machine.channels), quantity="acceleration")
    start = perf_counter()
    theirs = control.forced_response(plant, ours.time, force).outputs
    seconds = perf_counter() - start
    size = np.abs(theirs).max(axis=1)
    error = float((np.abs(ours.data - theirs).max(axis=1) / size).max())
    ratio = seconds / benchmark.stats.stats.min
    benchmark.extra_info["ratio to control.forced_response"] = round(ratio)
    print(f"\n10 s at 20 kHz, 20 modes, 3 outputs: {ratio:.0f} times control.forced_response, difference {error:.1e}")
    assert plant.nstates == 40
    assert error < 1e-9
    assert ratio >= LEAST_RATIO


@pytest.mark.benchmark(group="stepping")
@pytest.mark.parametrize("law", ["cubic_stiffness", "dry_friction"])
def test_blows_with_a_nonlinear_joint(benchmark: Any, law: str) -> None:
    parameters = {"stiffness3": 8e9} if law == "cubic_stiffness" else {"torque": 0.5}
    machine = replace(with_modes(21), nonlinear=(NonlinearElement("joint2", law, parameters),))
    fs = 8000.0
    t = np.arange(8000) / fs
    blows = np.linspace(20.0, 200.0, 54)[:, None] * np.exp(-(((t - 0.02) / 8e-4) ** 2))
    form = modal_form(machine, 0.4)
    got = benchmark(lambda: step(form, blows, fs, machine.nonlinear, oversample=4))
    assert got.responses.shape == (54, 3, 8000)
    print(f"\n54 blows of 8000 samples, 23 modes, {law}: {benchmark.stats.stats.min:.3f} s")
