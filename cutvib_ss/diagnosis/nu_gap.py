"""
The ν-gap between two models, its winding condition included.

The chordal distance is the ν-gap only if 1 + P₂ᴴP₁ has no zero on the imaginary axis and turns around the origin no more often than
unstable poles account for: not at all between stable models. That asks for the whole axis, which no measurement covers, so that it
is checked between the nominal and the corrected model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cutvib_ss.diagnosis.findings import ChannelGap, Metric, NuGap
from cutvib_ss.diagnosis.metrics import ALL, chordal_distance
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modes import modes
from cutvib_ss.results import ComplexArray, FloatArray, Modes


def nu_gap(
    rows: Sequence[Metric], scales: Mapping[str, float], nominal: Model, corrected: Model, band: tuple[float, float]
) -> NuGap:
    """The largest ν-gaps of a campaign, and the winding condition."""
    positions = dict.fromkeys(m.position for m in rows)
    pairs = {position: Pair(nominal, corrected, position, scales, band) for position in positions}
    out = []
    for channel in dict.fromkeys(m.channel for m in rows):
        quiet = [
            min(
                (m for m in rows if (m.position, m.channel) == (p, channel)), key=lambda m: m.noise_nu_gap, default=None
            )
            for p in positions
        ]
        seen = [m for m in quiet if m is not None]
        only = list(scales) if channel == ALL else [channel]
        out.append(
            ChannelGap(
                channel=channel,
                scale=None if channel == ALL else scales[channel],
                before=max(m.before.nu_gap for m in seen),
                tuned=max(m.tuned.nu_gap for m in seen),
                after=max(m.after.nu_gap for m in seen),
                noise=max(m.noise_nu_gap for m in seen),
                models=max(pair.apart(only) for pair in pairs.values()),
            )
        )
    return NuGap(tuple(out), *_winding(pairs, bool(corrected.nonlinear)))


def _winding(pairs: Mapping[float | None, Pair], nonlinear: bool) -> tuple[str, str]:
    for position, pair in pairs.items():
        turns, reason = pair.winding()
        if turns is None:
            return "not checked", reason
        if turns != 0:
            place = "" if position is None else f" at y/L = {position:.3g}"
            return "fails", f"1 + P₂ᴴP₁ turns {turns} times around the origin{place}: the ν-gap is 1 there"
    told = "between the nominal and the corrected model, at every measured position"
    return "holds", told + (", without its nonlinear force" if nonlinear else "")


@dataclass(frozen=True)
class Pair:
    """Two models at one position, their responses scaled."""

    first: Model
    second: Model
    position: float | None
    scales: Mapping[str, float]
    band: tuple[float, float]

    @cached_property
    def modes(self) -> tuple[Modes, Modes]:
        """Modes of both."""
        return modes(self.first, self.position), modes(self.second, self.position)

    def grid(self, low: float, high: float) -> FloatArray:
        """Frequencies, dense around every natural frequency."""
        spread = 0.02 * np.sinh(np.linspace(-5.0, 5.0, 41)) / np.sinh(5.0)
        sharp = np.concatenate([np.outer(m.natural_freq, 1.0 + spread).ravel() for m in self.modes])
        freq = np.unique(np.concatenate([np.geomspace(low, high, 1500), sharp]))
        return freq[(freq >= low) & (freq <= high)]

    def responses(self, freq: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Of both, shape (output, frequency)."""
        divide = np.array(list(self.scales.values()))[:, None]
        places = None if self.position is None else [self.position]
        first, second = (
            frequency_response(m, places, freq, outputs=list(self.scales)).data[0, :, 0] / divide
            for m in (self.first, self.second)
        )
        return first, second

    @cached_property
    def _over_band(self) -> tuple[ComplexArray, ComplexArray]:
        """Responses over the band."""
        return self.responses(self.grid(*self.band))

    def apart(self, channels: Sequence[str]) -> float:
        """Largest distance of some channels over the band."""
        own = [k for k, c in enumerate(self.scales) if c in channels]
        first, second = self._over_band
        return float(chordal_distance(first[own], second[own]).max())

    def winding(self) -> tuple[int | None, str]:
        """Turns of 1 + P₂ᴴP₁ around the origin, all channels together; None and the reason where they cannot be told."""
        for found in self.modes:
            if (found.damping_ratio <= 0.0).any() or (found.natural_freq <= 1e-6 * self.band[1]).any():
                return (
                    None,
                    "a pole on or beyond the imaginary axis: its encirclements cannot be counted off a response",
                )
        freq = self.grid(1e-3 * self.band[0], SETTINGS.nu_gap_beyond * self.band[1])
        values = self._product(freq)
        for _ in range(SETTINGS.nu_gap_rounds):
            fast = np.flatnonzero(np.abs(np.angle(values[1:] / values[:-1])) > SETTINGS.nu_gap_turn)
            if not fast.size:
                break
            between = (freq[fast] + freq[fast + 1]) / 2
            order = np.argsort(np.concatenate([freq, between]), kind="stable")
            freq = np.concatenate([freq, between])[order]
            values = np.concatenate([values, self._product(between)])[order]
        else:
            return None, "1 + P₂ᴴP₁ passes too close to the origin for its turns to be counted"
        # The axis from -∞ to ∞ mirrors this half; both ends are real where the responses settle.
        turns = float(np.sum(np.angle(values[1:] / values[:-1])) / np.pi)
        if abs(turns - round(turns)) > SETTINGS.nu_gap_settled:
            return None, "a delay keeps the responses from settling at high frequency"
        return round(turns), ""

    def _product(self, freq: FloatArray) -> ComplexArray:
        p1, p2 = self.responses(freq)
        value: ComplexArray = 1.0 + np.sum(p2.conj() * p1, axis=0)
        return value
