"""Restoring forces as the equivalent stiffnesses that records show: what they take away from the linear responses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cutvib_ss.diagnosis.records import Group
from cutvib_ss.effects.base import Carried, Model
from cutvib_ss.model.paths import Path
from cutvib_ss.response.derivatives import ResponseDerivatives
from cutvib_ss.response.receptance import ModelReceptance
from cutvib_ss.results import ComplexArray
from cutvib_ss.units import DERIVATIVE_ORDER


class EquivalentForces:
    """
    What equivalent stiffnesses z at the elements' ports p take away from each record's response.

    With receptances H from ports and inputs q to signals c, H_cp y is taken of forces y = z T that the motions T of the ports in
    (1 + H_pp z) T = H_pq make. Where the H move by dH, it moves by dH_cp y + L (dH_pq - dH_pp y) with L = H_cp z (1 + H_pp z)⁻¹.
    """

    def __init__(self, model: Model, sites: Group, row: np.ndarray, stiffness: ComplexArray) -> None:
        chain = model.chain.at(sites.channels, [DERIVATIVE_ORDER[q] for q in sites.quantities], 2j * np.pi * sites.freq)
        self.receptance = ModelReceptance(model, sites.positions, chain.s)
        self.chain, self.row, self.ports = chain, row, tuple(e.port for e in model.nonlinear)
        self.inputs = tuple(dict.fromkeys(sites.inputs))
        self.at = np.array([self.inputs.index(name) for name in sites.inputs])[row]
        of = self.receptance.between
        if not self.ports:
            return
        # Axes (…, port, record, frequency); then (record, frequency, …): one small system a record and line.
        self.at_signals = self._by_record(np.array([[of(c, p) for p in self.ports] for c in chain.signals]))
        at_ports = self._by_record(np.array([[of(p, q) for q in self.ports] for p in self.ports]))
        driven = self._of_input(self._by_record(np.array([[of(p, q) for p in self.ports] for q in self.inputs])))
        z = stiffness.transpose(0, 2, 1)
        h_cp, h_pp, h_pq = (np.moveaxis(a, (-2, -1), (0, 1)) for a in (self.at_signals, at_ports, driven))
        below = np.eye(len(self.ports)) + h_pp * z[:, :, None, :]
        self.forces = z * np.linalg.solve(below, h_pq[..., None])[..., 0]
        # z (1 + H_pp z)⁻¹ = (1 + z H_pp)⁻¹ z
        above = np.eye(len(self.ports)) + z[..., None] * h_pp
        self.onward = h_cp @ np.linalg.solve(above, z[..., None] * np.eye(len(self.ports)))

    def derivatives(self, each: Sequence[Carried]) -> ComplexArray:
        """Derivatives along moves of the model's values, shape (move, record, channel, frequency)."""
        out = np.zeros((len(each), self.row.size, len(self.chain.outputs), self.chain.s.size), dtype=np.complex128)
        paths = tuple(dict.fromkeys(path for carried in each for path, _ in carried))
        if not paths or not self.ports:
            return out
        changes = dict(zip(paths, self._of(paths), strict=True))
        for k, carried in enumerate(each):
            for path, weight in carried:
                out[k] += weight * changes[path]
        return out

    def _of(self, paths: Sequence[Path]) -> list[ComplexArray]:
        """Derivatives to some of the model's values, each of shape (record, channel, frequency)."""
        moved = [path for path in paths if path[0] != "chain"]
        if len(moved) < len(paths):
            # A window moves s.
            moved.append(("s",))
        mechanical = dict(zip(moved, self.chain.shown(self._motions(moved)), strict=True)) if moved else {}
        taken = np.einsum("cprf,rfp->crf", self.at_signals, self.forces)
        motions = dict(zip(self.chain.signals, taken, strict=True))
        return [
            mechanical[path]
            if path[0] != "chain"
            else self.chain.derivative(path, motions.__getitem__, lambda: mechanical["s",])
            for path in paths
        ]

    def _motions(self, paths: Sequence[Path]) -> ComplexArray:
        """Derivatives of the motions that are taken away, shape (value, record, signal, frequency)."""
        n, names = len(self.chain.signals), (*self.chain.signals, *self.ports)
        # Of a port the motions of the signals, then of the ports; of an input those of the ports alone.
        of_ports = [self._changed(names, name, paths) for name in self.ports]
        of_inputs = [
            of_ports[self.ports.index(name)][:, n:] if name in self.ports else self._changed(self.ports, name, paths)
            for name in self.inputs
        ]
        # Axes (input, value, output, record, frequency).
        from_ports, driven = self._by_record(np.array(of_ports)), self._by_record(np.array(of_inputs))
        by_forces = np.einsum("pmorf,rfp->morf", from_ports, self.forces)
        to_ports = self._of_input(driven) - by_forces[:, n:]
        taken = by_forces[:, :n] + np.einsum("rfcp,mprf->mcrf", self.onward, to_ports)
        return np.asarray(taken.swapaxes(1, 2))

    def _changed(self, outputs: Sequence[str], input: str, paths: Sequence[Path]) -> ComplexArray:
        """Derivatives of the receptances from a signal to others, shape (value, output, site, frequency)."""
        return ResponseDerivatives(self.receptance, outputs, input).derivatives(paths).swapaxes(1, 2)

    def _of_input(self, values: ComplexArray) -> ComplexArray:
        """Values, shape (input, ..., record, frequency), of each record's own input."""
        picked = np.moveaxis(values, (0, -2), (0, 1))[self.at, np.arange(self.row.size)]
        return np.moveaxis(picked, 0, -2)

    def _by_record(self, values: ComplexArray) -> ComplexArray:
        """Values at sites, shape (..., site, frequency), of each record; a structure has one row for all sites."""
        return values[..., self.row if values.shape[-2] > 1 else 0 * self.row, :]
