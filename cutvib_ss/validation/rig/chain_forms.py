"""Causes in the measurement, each in the forms in which instruments err."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cutvib_ss.validation.rig.sites import AnyMachine, Form, Made, about, either
from cutvib_ss.validation.rig.structure import Filter, Window


def _channels(machine: AnyMachine, rng: np.random.Generator) -> tuple[str, tuple[str, ...]]:
    """A channel, or all."""
    names = tuple(c.name for c in machine.channels)
    name = str(rng.choice([*names, "all", "all"]))
    return name, names if name == "all" else (name,)


def _delay(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Responses late against the force."""
    name, channels = _channels(machine, rng)
    delay = either(rng) * about(rng, 1.6e-4) * severity
    return machine.measured(delays=dict.fromkeys(channels, delay)), "measurement", {"delay": delay, "channel": name}


def _filter_delay(kind: str, machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A filter in the responses' amplifier alone; low down its delay is constant."""
    name, channels = _channels(machine, rng)
    corner = 1 / (2 * np.pi * about(rng, 1.6e-4) * severity)
    filters = {channel: (Filter(kind, corner),) for channel in channels}
    return machine.measured(filters=filters), "measurement", {"frequency": corner, "channel": name}


def _multiplexed(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """One converter for all channels, one after the other."""
    step = about(rng, 0.8e-4) * severity
    delays = {c.name: step * (i + 1) for i, c in enumerate(machine.channels)}
    return machine.measured(delays=delays), "measurement", {"delay": step, "channel": "all"}


def _gain(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A sensitivity that is wrong."""
    name, channels = _channels(machine, rng)
    gain = float(np.exp(either(rng) * about(rng, 0.18) * severity))
    return machine.measured(gains=dict.fromkeys(channels, gain)), "measurement", {"channel": name, "gain": gain}


def _sloping_gain(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A sensitivity that is wrong, and more so the higher the frequency."""
    name, channels = _channels(machine, rng)
    size = either(rng) * about(rng, 0.18) * severity
    slope = Filter("slope", 150.0, size * float(rng.uniform(0.2, 0.6)))
    chain = machine.measured(
        gains=dict.fromkeys(channels, float(np.exp(size))), filters=dict.fromkeys(channels, (slope,))
    )
    return chain, "measurement", {"channel": name, "gain": float(np.exp(size)), "slope": slope.value}


def _charge_gain(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A charge amplifier with the wrong range and a short time constant."""
    name, channels = _channels(machine, rng)
    gain = float(np.exp(either(rng) * about(rng, 0.18) * severity))
    corner = Filter("highpass", float(rng.uniform(1.0, 5.0)) * min(severity, 1.5))
    chain = machine.measured(gains=dict.fromkeys(channels, gain), filters=dict.fromkeys(channels, (corner,)))
    return chain, "measurement", {"channel": name, "gain": gain, "corner": corner.freq}


def _cross_axis(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """X leaks into Z."""
    fraction = either(rng) * about(rng, 0.22) * severity
    return machine.measured(cross_axis=fraction), "measurement", {"fraction": fraction}


def _tilted(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A sensor block that is tilted: X leaks into Z, Z into X, and both lose the cosine."""
    fraction = float(np.clip(either(rng) * about(rng, 0.22) * severity, -0.9, 0.9))
    cosine = float(np.sqrt(1 - fraction**2))
    leaks = (("tool_z", "tool_x", fraction / cosine, 0.0), ("tool_x", "tool_z", -fraction / cosine, 0.0))
    chain = machine.measured(tilts=leaks, gains={"tool_x": cosine, "tool_z": cosine})
    return chain, "measurement", {"fraction": fraction}


def _growing_leak(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A leak that grows with frequency: the mount rocks."""
    fraction, corner = either(rng) * about(rng, 0.22) * severity, float(rng.uniform(120.0, 300.0))
    leaks = (("tool_z", "tool_x", 0.5 * fraction, 0.0), ("tool_z", "tool_x", 0.7 * fraction, corner))
    return machine.measured(tilts=leaks), "measurement", {"fraction": fraction, "corner": corner}


def _window(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """An exponential window that nobody took out."""
    rate = about(rng, 14.0) * severity
    return machine.measured(window=Window("exponential", rate)), "measurement", {"decay_rate": rate}


def _late_window(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """An exponential window on the responses alone, from the trigger on."""
    rate = about(rng, 14.0) * severity
    return machine.measured(window=Window("late", rate, 0.04)), "measurement", {"decay_rate": rate}


def _taper(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A window that fades out as half a cosine."""
    rate = about(rng, 5.0, 0.2) * severity
    return machine.measured(window=Window("taper", rate, 0.055)), "measurement", {"rate": rate}


def _cut(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A record that was cut off and filled with zeros."""
    start = float(np.clip(about(rng, 0.16, 0.2) / severity, 0.08, 0.6))
    return machine.measured(window=Window("cut", 0.0, start)), "measurement", {"start": start}


CHAIN_FORMS: Mapping[str, tuple[Form, ...]] = {
    "channel_delay": (
        Form("delay", 0, _delay), Form("multiplexed", 1, _multiplexed),
        Form("bessel", 1, lambda m, s, r: _filter_delay("bessel", m, s, r)),
        Form("lowpass", 2, lambda m, s, r: _filter_delay("lowpass", m, s, r)),
    ),
    "calibration_error": (
        Form("gain", 0, _gain), Form("sloping", 1, _sloping_gain), Form("charge_amplifier", 2, _charge_gain),
    ),
    "cross_axis": (Form("leak", 0, _cross_axis), Form("tilted", 1, _tilted), Form("rocking", 2, _growing_leak)),
    "window_damping": (
        Form("exponential", 0, _window), Form("responses_alone", 1, _late_window), Form("taper", 2, _taper), Form("cut", 3, _cut),
    ),
}  # fmt: skip
"""Forms of each cause in the measurement, the catalogue's first."""
