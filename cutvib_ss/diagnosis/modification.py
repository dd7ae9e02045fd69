"""
How unknown elements at a place enter the responses, whatever their law: structural modification with unknown functions of
frequency.

An unknown dynamic stiffness z(ω) in parallel at ports r changes the response of q to a force at p by Sherman-Morrison-Woodbury,

    H = H0 - a_qr (1 + z a_rr)^-1 z a_rp,

and a compliance c(ω) in series, where two parts meet, by its dual,

    H = H0 + R_q (1 + c Z)^-1 c R_p,

R being the forces that pass and Z the stiffness with which the two sides oppose being parted. A gain is linear. All have one form,
H0 ± left (1 + U D)^-1 U right with U the diagonal of the unknown functions. Only a value that all modes of the rail share has
another: it changes the rail's receptance as a sum of fractions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cutvib_ss.diagnosis.records import Group
from cutvib_ss.effects.base import Model
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.model.rail import rail_point
from cutvib_ss.response.batched import inverse
from cutvib_ss.response.receptance import ModelReceptance
from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.units import DERIVATIVE_ORDER


class Modification(Protocol):
    """Unknown functions in the responses of a group of records."""

    @property
    def functions(self) -> int:
        """Number of unknown functions."""
        ...

    def shown(self, functions: ComplexArray) -> ComplexArray:
        """Responses with elements of given functions."""
        ...

    def sloped(self, functions: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """The same with their derivatives to the functions."""
        ...

    def inverted(self, data: ComplexArray) -> ComplexArray | None:
        """The function that each single response asks for, were there no other."""
        ...


@dataclass(frozen=True)
class Elements:
    """Elements in parallel, in series, or gains."""

    response: ComplexArray  # Responses without the elements
    left: ComplexArray  # How the elements show in each channel
    right: ComplexArray  # How the input drives them
    own: ComplexArray  # How they drive each other
    ties: FloatArray  # Elements from unknown functions
    sign: int  # -1 for elements in parallel, 1 for elements in series and gains

    @property
    def functions(self) -> int:
        """Number of unknown functions."""
        return int(self.ties.shape[1])

    def _solved(self, u: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """(1 + D U)^-1, and what it makes of the input."""
        k = len(u)
        below = np.eye(k)[:, :, None, None] + self.own * u
        solved = inverse(below.reshape(k, k, -1)).reshape(below.shape)
        return solved, np.einsum("ijpf,jpf->ipf", solved, self.right)

    def shown(self, functions: ComplexArray) -> ComplexArray:
        """Responses with elements of given functions."""
        u = np.tensordot(self.ties, functions, 1)
        with np.errstate(all="ignore"):
            _, driven = self._solved(u)
            out: ComplexArray = self.response + self.sign * np.einsum("ipcf,ipf->pcf", self.left, u * driven)
        return out

    def sloped(self, functions: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """The same with their derivatives to the functions."""
        u = np.tensordot(self.ties, functions, 1)
        with np.errstate(all="ignore"):
            solved, driven = self._solved(u)
            out: ComplexArray = self.response + self.sign * np.einsum("ipcf,ipf->pcf", self.left, u * driven)
            seen = np.einsum("ipcf,jipf->jpcf", self.left, solved)
            slopes: ComplexArray = self.sign * np.tensordot(self.ties.T, seen * driven[:, :, None], 1)
        return out, slopes

    def inverted(self, data: ComplexArray) -> ComplexArray | None:
        """The function that each single response asks for, were there no other."""
        count = len(self.ties)
        if not np.array_equal(self.ties, np.eye(count)):
            return None
        missing = data - self.response
        own = self.own[np.arange(count), np.arange(count)]
        with np.errstate(all="ignore"):
            asked = missing / (self.sign * self.left * self.right[:, :, None] - missing * own[:, :, None])
        return np.where(np.isfinite(asked), asked, 0.0)


@dataclass(frozen=True)
class RailModes:
    """
    One relative change of a value that all modes of the rail share.

    The rail's receptance α = Σ φ_r² / d_r becomes Σ φ_r² / (d_r + u t_r).
    """

    response: ComplexArray  # Responses without it
    # Force that passes to the rail from each channel, times that from the input, through the measurement chain
    through: ComplexArray
    passed: ComplexArray  # Force that passes to the rail from each channel, through the measurement chain
    opposing: ComplexArray  # Stiffness that the head opposes to a motion of the rail under it
    squares: FloatArray  # Squares of the mode shapes under the head
    crosses: FloatArray  # Their products with those where a force on the rail acts; zero for a force on the head
    flexibility: ComplexArray  # Of each mode
    change: ComplexArray  # How its dynamic stiffness moves with the function
    functions: int = 1  # One

    def _moved(self, shapes: FloatArray, functions: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Change of the rail's receptance, of given products of mode shapes, and its slope."""
        f = self.flexibility
        below = 1.0 / (1.0 + f * self.change * functions[0][:, None])
        change = np.einsum("pm,pmf->pf", shapes, f * (below - 1.0))
        slope = -np.einsum("pm,pmf->pf", shapes, self.change * (f * below) ** 2)
        return change, slope

    def shown(self, functions: ComplexArray) -> ComplexArray:
        """Responses with a given function."""
        return self.sloped(functions)[0]

    def sloped(self, functions: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """The same with their derivatives to the function."""
        with np.errstate(all="ignore"):
            change, slope = self._moved(self.squares, functions)
            crossed, crossing = self._moved(np.broadcast_to(self.crosses, self.squares.shape), functions)
            left = 1.0 / (1.0 + self.opposing * change)
            out: ComplexArray = self.response + self.through * (change * left)[:, None]
            out += self.passed * (crossed * left)[:, None]
            slopes: ComplexArray = (self.through * (slope * left**2)[:, None])[None]
            slopes += self.passed * ((crossing - crossed * self.opposing * slope * left) * left)[:, None]
        return out, slopes

    def inverted(self, data: ComplexArray) -> ComplexArray | None:
        """Nothing: a sum of fractions is not inverted at sight."""
        return None


class Lines:
    """A model at the rows and lines of a group, ready for modifications."""

    def __init__(self, model: Model, group: Group, tail: ComplexArray, window: FloatArray) -> None:
        self.model, self.group, self.tail, self.window = model, group, tail, window
        orders = [DERIVATIVE_ORDER[q] for q in group.quantities]
        self._lines = model.chain.at(group.channels, orders, group.decay_rate[0] + 2j * np.pi * group.freq)
        self.s: ComplexArray = self._lines.s
        self.receptance = ModelReceptance(model, group.positions, self.s)
        # What the channels read, then what leaks into them.
        self.reads = self._lines.signals
        self._between: dict[tuple[str, str], ComplexArray] = {}
        self.response: ComplexArray = self.through([self.driven(r) for r in self.reads]) - tail
        self.built: dict[tuple[str, str, float], Modification] = {}

    def shown(self, port: str) -> ComplexArray:
        """What the channels show of a unit force at a port."""
        return self.through([self.between(r, port) for r in self.reads])

    def through(self, motions: list[ComplexArray]) -> ComplexArray:
        """Channels' displacements as the measurement chain shows them."""
        shown: ComplexArray = self._lines.shown(np.stack(motions, axis=1)) * self.window
        return shown

    @property
    def struck(self) -> FloatArray | None:
        """y / L of the point of the rail on which each row's force acts, NaN where it acts elsewhere; None where all do."""
        points = [rail_point(name) if self.model.has_position else None for name in self.group.inputs]
        return None if all(y is None for y in points) else np.array([np.nan if y is None else y for y in points])

    def driven(self, port: str) -> ComplexArray:
        """What the records' force does at a port, one row a record."""
        inputs = self.group.inputs
        if len(set(inputs)) == 1:
            return self.between(port, inputs[0])
        return np.array([self.between(port, name)[row] for row, name in enumerate(inputs)])

    def between(self, output: str, input: str) -> ComplexArray:
        """Receptance between two ports, one row a record."""
        # "force" is no port: of a structure on a shaker it is an inertia. All else is reciprocal.
        pair = (output, input) if input == FORCE else (min(output, input), max(output, input))
        if pair not in self._between:
            value = self.receptance.between(*pair)
            self._between[pair] = np.broadcast_to(value, (self.group.positions.size, self.s.size))
        return self._between[pair]
