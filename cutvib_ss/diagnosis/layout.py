"""Columns of the unknowns and of the directions beside them, and the sizes of these."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cutvib_ss.diagnosis.form_errors import Form
from cutvib_ss.diagnosis.hit_errors import SET_UPS, Hit
from cutvib_ss.diagnosis.residual_modes import ResidualMode
from cutvib_ss.diagnosis.unknowns import NO_PARTS, Parts
from cutvib_ss.results import FloatArray


@dataclass(frozen=True)
class Sizes:
    """Relative standard deviations of drifts, and of discrepancies of nominal elements and of the cause; others as they say."""

    drift: float = 1e-3
    nominal: float = 3e-4
    cause: float = 1e-2
    noise: float = 1.0  # A factor on its variance
    within: float = 1e-3
    parts: float = 0.1  # Of single parts of a structure's matrices, and single frequencies of the rail, in tolerances
    losses: float = 0.3  # The same of the losses of modes
    flexibility: float = 1e-2  # Of residual modes, in their scale
    aim: float = 0.3  # Set-up errors of the force's direction and point, in their units
    placing: float = 0.3  # Set-up errors of the position


def deviations(parts: Parts, count: int, sizes: Sizes) -> FloatArray:
    """Standard deviations of the priors of unknowns, in their units: one, but for errors of parts, which have a size."""
    out = np.ones(count)
    out[list(parts.matrices)], out[list(parts.losses)] = sizes.parts, sizes.losses
    return out


@dataclass(frozen=True)
class Layout:
    """Which columns the directions take behind the unknowns of a problem, and the smooth shapes they are made of."""

    unknowns: int
    sessions: tuple[tuple[float | str, ...], ...]
    channels: tuple[str, ...]
    drifting: tuple[int, ...]
    nominal: tuple[int, ...]
    pivots: tuple[tuple[float, float], ...]
    shapes: int
    records: tuple[int, ...] = ()  # Those that drift within their session, by their index in the campaign
    cause_drifts: bool = False  # Whether there is a cause with a size, which drifts like the machine's values
    hits: tuple[Hit, ...] = ()  # What hits and set-ups do
    errors: tuple[float, ...] = ()  # Where each of these is taken to be
    parts: Parts = NO_PARTS  # Unknowns that are errors of single parts of a structure
    residual_modes: tuple[ResidualMode, ...] = ()  # That the model leaves out
    form: Form = ()  # Errors of a restoring force's form

    @cached_property
    def per_session(self) -> int:
        """Directions of one session, or record: tuned values, real and imaginary gain of each channel, the cause's size."""
        return len(self.drifting) + 2 * len(self.channels) + self.cause_drifts

    @cached_property
    def first_within(self) -> int:
        """First column of the records' own drift."""
        return self.unknowns + self.per_session * len(self.sessions)

    @cached_property
    def first_nominal(self) -> int:
        """First column of the nominal elements' discrepancy."""
        return self.first_within + self.per_session * len(self.records)

    @cached_property
    def first_cause(self) -> int:
        """First column of the causes' discrepancy."""
        return self.first_nominal + 2 * self.shapes * len(self.nominal)

    @cached_property
    def first_form(self) -> int:
        """First column of the errors of a restoring force's form, which are the causes' discrepancy too."""
        return self.first_cause + 2 * len(self.pivots)

    @cached_property
    def first_residual(self) -> int:
        """First column of the residual modes."""
        return self.first_form + len(self.form)

    @cached_property
    def first_hit(self) -> int:
        """First column of what hits do."""
        return self.first_residual + len(self.residual_modes)

    @cached_property
    def size(self) -> int:
        """All columns."""
        return self.first_hit + len(self.hits)

    def scale(self, sizes: Sizes) -> FloatArray:
        """Factor on each column."""
        out = np.ones(self.size)
        out[: self.unknowns] = deviations(self.parts, self.unknowns, sizes)
        out[self.unknowns : self.first_within] = sizes.drift
        out[self.first_within : self.first_nominal] = sizes.within
        out[self.first_nominal : self.first_cause] = sizes.nominal
        out[self.first_cause : self.first_residual] = sizes.cause
        out[self.first_residual : self.first_hit] = sizes.flexibility
        out[self.first_hit :] = [getattr(sizes, kind) if kind in SET_UPS else 1.0 for kind, *_ in self.hits]
        return out

    def placed(self, drift: FloatArray) -> FloatArray:
        """Drifts of the tuned values, of sessions and then of records, and errors of hits and set-ups, in their columns."""
        out = np.zeros(self.size)
        out[self.first_hit :] = self.errors or 0.0
        for k, own in enumerate(drift if self.sessions else ()):
            first = self.unknowns + k * self.per_session
            out[first : first + own.size] = own
        return out
