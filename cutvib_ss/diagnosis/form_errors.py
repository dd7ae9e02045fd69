"""
Errors of a restoring force's form: what it would have to be beside a known one over displacement and rate.

    δf(q, v) = Σ_k K(a_k) [ h_k q g(ln q/a_k) + d_k v/ω g(ln v/ωa_k) ],   h_k, d_k ~ N(0, size²), g a Gaussian

and the same for q and v of the other sign, by itself. K(a) is the force over the motion, both root mean square, at an amplitude:
the error is relative to that, and smooth over the logarithm of the amplitude, as a Gaussian process. A force that errs so rings on
differently as its response decays, and has other harmonics, which no error of its equivalent stiffness has. What small errors do to
records is found by simulation, each by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.results import ComplexArray

if TYPE_CHECKING:
    from cutvib_ss.diagnosis.records import Group
    from cutvib_ss.diagnosis.simulated import Simulated


_SAMPLES = 128
"""Of a period, by which the size of a force is found."""

Form = tuple[NonlinearElement, ...]


def form_of(predictions: Sequence[Simulated]) -> Form:
    """The elements that are errors of the form of each restoring force, as large as it is, over what its port moves by."""
    runs = [run for p in predictions for run in p.runs.values()]
    if not runs:
        return ()
    found = []
    for k, element in enumerate(predictions[0].model.nonlinear):
        moved = [run.motions[:, k] for run in runs]
        highest = max(float(np.abs(q).max()) for q in moved)
        fastest = max(
            float(np.abs(np.diff(q, axis=-1)).max()) * run.replay.fs for q, run in zip(moved, runs, strict=True)
        )
        if not (0.0 < highest < np.inf and 0.0 < fastest < np.inf):
            continue
        omega = fastest / highest
        # Spaced so that together they err by as much at each amplitude.
        below = np.sqrt(np.pi) * (0.25 + np.arange(SETTINGS.discrepancy_amplitudes))
        for amplitude in (highest * np.exp(-below)).tolist():
            size = _stiffness(element, amplitude, omega)
            spring = {"stiffness": size, "displacement": amplitude}
            damper = {"damping": size / omega, "rate": omega * amplitude}
            for side in (1.0, -1.0) if size > 0.0 else ():
                found.append(NonlinearElement(element.port, "local_stiffness", {**spring, "side": side}))
                found.append(NonlinearElement(element.port, "local_damping", {**damper, "side": side}))
    return tuple(found)


def _stiffness(element: NonlinearElement, amplitude: float, omega: float) -> float:
    """Force of an element over its motion, both root mean square, under a harmonic motion."""
    # A law with memory has settled in the second period.
    phase = 2.0 * np.pi * np.arange(2 * _SAMPLES) / _SAMPLES
    force = element.restoring_force.force(amplitude * np.cos(phase), -omega * amplitude * np.sin(phase))[_SAMPLES:]
    return float(np.sqrt(2.0 * np.mean(force**2))) / amplitude


def scaled(element: NonlinearElement, factor: float) -> NonlinearElement:
    """The element with a part of its force."""
    return replace(element, parameters=element.restoring_force.scaled(factor).parameters)


def that_tell(
    form: Form, errors: Mapping[int, ComplexArray], groups: Sequence[Group]
) -> tuple[Form, dict[int, ComplexArray]]:
    """Those errors of which records tell anything: of others the largest that is believed does no more than noise."""
    squares = np.zeros(len(form))
    for g in groups if form else ():
        for weight, (entry, *_) in zip(g.weight, g.entries, strict=True):
            squares += np.sum(np.abs(weight * errors[entry.record]) ** 2, axis=(1, 2))
    told = np.flatnonzero(SETTINGS.sizes["cause"][-1][0] ** 2 * squares > 1.0).tolist()
    return tuple(form[k] for k in told), {record: own[told] for record, own in errors.items()}
