"""
What the windowed blocks of a continuous recording make of a small change of a model, without another simulation.

A change dH of a response has the poles of the model, simple and double, beside what is smooth over frequency. The estimator (H1
over Welch's blocks) is linear in the response, so it makes of dH what it makes of its parts: each pole's response to the recorded
force is estimated once, for all values of the model and all channels, and what is smooth does not leak.
"""

from __future__ import annotations

import numpy as np
from scipy import signal

from cutvib_ss.diagnosis.prediction import light_poles
from cutvib_ss.diagnosis.records import Group
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.measurement.replay import Replay
from cutvib_ss.results import ComplexArray, FloatArray


class Leakage:
    """How changes of one record's responses leak, for a linear model."""

    def __init__(self, model: Model, position: float, replay: Replay, freq: FloatArray) -> None:
        (poles,) = light_poles(model, np.array([position]))
        # Poles beyond the band are smooth in it.
        poles = poles[np.abs(poles) < 2 * np.pi * SETTINGS.leakage_poles * float(freq[-1])]
        step, turn = 1.0 / replay.fs, np.exp(-2j * np.pi * freq / replay.fs)[:, None]
        (force,) = replay.forces
        steps = np.exp(poles * step)
        rung = [step * signal.lfilter([1.0], [1.0, -p], force) for p in steps]
        rung += [step**2 * p * signal.lfilter([0.0, 1.0], [1.0, -2 * p, p * p], force) for p in steps]
        shown = replay.data([np.array([part for x in rung for part in (x.real, x.imag)]).reshape(-1, force.size)])
        found = (shown[::2] + 1j * shown[1::2]).T
        # The mirror images of the poles are smooth in the band.
        simple = 1.0 / (1.0 - steps * turn)
        without = np.concatenate([step * simple, step**2 * steps * turn * simple**2], axis=1)
        at = freq / freq[-1]
        smooth = np.stack([at**power for power in (-2.0, -1.0, 0.0, 1.0, 2.0)], axis=1)
        basis = np.concatenate([without, smooth], axis=1)
        size = np.linalg.norm(basis, axis=0)
        self._parts = np.linalg.pinv(basis / size, rcond=SETTINGS.leakage_alike)[: without.shape[1]]
        self._added = (found - without) / size[: without.shape[1]]

    def of(self, change: ComplexArray) -> ComplexArray:
        """What leakage adds to changes of the responses, shape (..., frequency)."""
        return np.asarray((change @ self._parts.T) @ self._added.T)


def wanders(model: Model, group: Group) -> bool:
    """Whether records show a motion that has no oscillating pole: not of accelerations, which stay."""
    at = group.positions[:1]
    return any(q != "acceleration" for q in group.quantities) and (
        light_poles(model, at)[0].size < len(model.matrices(at, viscous_at=30.0).dofs)
    )
