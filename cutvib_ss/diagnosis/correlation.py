"""
Correlation of models with measurements and with each other: FRAC by channel and position, MAC of the modes.

FRAC compares one response over frequency, MAC one mode over points. Both are one for proportional vectors and say nothing of scale:
they are shown beside the errors, not instead of them. A MAC over few points is close to one for modes that differ elsewhere.

Sources: W. Heylen, P. Avitabile, Correlation considerations, part 5 (degree of freedom correlation techniques), 16th International
Modal Analysis Conference (1998), for FRAC; R. J. Allemang, D. L. Brown, A correlation coefficient for modal vector analysis, 1st
International Modal Analysis Conference (1982), for MAC.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize

from cutvib_ss.diagnosis.findings import Correlation, ModePair
from cutvib_ss.diagnosis.records import measured_at
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.measurement.inputs import input_ports
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.response.modal_form import modal_form
from cutvib_ss.results import ComplexArray, FloatArray

if TYPE_CHECKING:
    from cutvib_ss.diagnosis.cross_validation import Judged
    from cutvib_ss.diagnosis.metrics import Sides


def frac(measured: ComplexArray, computed: ComplexArray) -> float:
    """Frequency response assurance criterion |Σ H₁ᴴH₂|² / (Σ|H₁|² Σ|H₂|²)."""
    power = np.sum(np.abs(measured) ** 2) * np.sum(np.abs(computed) ** 2)
    return float(np.abs(np.sum(measured.conj() * computed)) ** 2 / power) if power > 0 else 0.0


def mac(first: ComplexArray, second: ComplexArray) -> FloatArray:
    """Modal assurance criterion |φᵢᴴψⱼ|² / (φᵢᴴφᵢ ψⱼᴴψⱼ) of two sets of shapes (point, mode), shape (mode, mode)."""
    sizes = [np.maximum(np.sum(np.abs(s) ** 2, axis=0), 1e-300) for s in (first, second)]
    return np.asarray(np.abs(first.conj().T @ second) ** 2 / np.outer(*sizes))


def correlations(sides: Sides) -> tuple[Correlation, ...]:
    """FRAC of each channel at each position and input, all its records together."""
    found: dict[tuple[tuple[float | None, str], str], list[int]] = {}
    for i, j in enumerate(sides.before):
        for channel in j.entry.channels:
            found.setdefault((measured_at(j.entry), channel), []).append(i)
    return tuple(
        Correlation(
            place[0],
            None if place[1] == FORCE else place[1],
            channel,
            *(_pooled(side, members, channel) for side in (sides.before, sides.tuned, sides.after)),
        )
        for (place, channel), members in found.items()
    )


def _pooled(side: Sequence[Judged], members: Sequence[int], channel: str) -> float:
    rows = [(side[i], side[i].entry.channels.index(channel)) for i in members]
    return frac(
        np.concatenate([j.entry.data[k] for j, k in rows]),
        np.concatenate([j.predicted[k] for j, k in rows]),
    )


def mode_pairs(
    nominal: Model, corrected: Model, positions: Sequence[float | None], band: tuple[float, float]
) -> tuple[ModePair, ...]:
    """Modes of the corrected model within a band, each with the mode of the nominal one that it continues, and their MAC."""
    out = []
    for position in positions:
        (poles, shapes), (other, others) = (_shapes(m, position, band) for m in (nominal, corrected))
        alike = mac(shapes, others)
        freq, freq_other = np.abs(poles) / (2 * np.pi), np.abs(other) / (2 * np.pi)
        cost = 1.0 - alike + np.abs(np.log(freq[:, None] / freq_other))
        before = {int(k): int(i) for k, i in zip(*optimize.linear_sum_assignment(cost.T), strict=True)}
        for k, f in enumerate(freq_other):
            if not band[0] <= f <= band[1]:
                continue
            i = before.get(k)
            damping = float(-other[k].real / np.abs(other[k]))
            pair = (None, None, None)
            if i is not None:
                pair = (float(freq[i]), float(-poles[i].real / np.abs(poles[i])), float(alike[i, k]))  # type: ignore[assignment]
            out.append(ModePair(position, pair[0], float(f), pair[1], damping, pair[2]))
    return tuple(out)


def _shapes(model: Model, position: float | None, band: tuple[float, float]) -> tuple[ComplexArray, ComplexArray]:
    """Poles of a model around a band, ascending, and its modes' shapes at points that move in m."""
    points = [p for p in input_ports(model) if not model.rotates(p)] or list(input_ports(model))
    form = modal_form(model, position, points, SETTINGS.simulation_hysteresis_at, ports=())
    size = np.abs(form.poles) / (2 * np.pi)
    keep = (form.poles.imag > 0.1 * np.abs(form.poles)) & (size > band[0] / 2) & (size < 2 * band[1])
    order = np.argsort(size[keep])
    return form.poles[keep][order], form.shapes[:, keep][:, order]
