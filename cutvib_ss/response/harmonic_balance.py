"""
Responses to a sine, swept up or down at given amplitudes of the force or of a response, with nonlinear elements at ports:
harmonic balance.

The steady motion of the ports is a few harmonics, q = Re Σ Q_k e^(ikωt). The model is linear but for the elements' forces
n(q, q̇), whose harmonics N_k are taken over the samples of a period, so that

    Q_k = δ_k1 H(ω) f - A(kω) N_k(Q),   X = H_x(ω) f - A_x(ω) N_1

with H and A the receptances from the input and between the ports, and X the channels' fundamental, which an analyser divides by
the force. The motion is followed along the sweep by pseudo-arclength, over folds to where the branch goes on: the jumps of a
slow sweep (`cutvib_ss.response.compiled_balance`). It is followed under the force smoothed over a few lines, since a measured
one scatters from line to line, and left at each line for that line's own. Where a controller holds the response of a channel
instead, the force f is one more unknown and |X| = A one more equation, line by line: nothing folds there. Elements at ports
condense everything else; more modes cost little.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.paths import Path, with_slots
from cutvib_ss.model.protocol import Model, NonlinearElement
from cutvib_ss.model.restoring_forces import RestoringForce
from cutvib_ss.parameters import check_choice, names_of
from cutvib_ss.response.axes import as_laplace, as_positions
from cutvib_ss.response.frequency import ChainedResponse, output_quantities
from cutvib_ss.response.modal_form import modal_form
from cutvib_ss.response.port_motion import PortMotion, harmonic_tables
from cutvib_ss.response.signals import displacement_unit, input_unit
from cutvib_ss.results import ComplexArray, FloatArray, FrequencyResponse, Quantity

_SAMPLES = 32
"""Samples of a period for each harmonic kept; corners of a force alias less the more there are."""


def sine_response(
    machine: Model,
    positions: ArrayLike | None,
    freq: ArrayLike,
    amplitude: ArrayLike,
    *,
    direction: Literal["up", "down"] = "up",
    harmonics: int = 7,
    outputs: str | Sequence[str] | None = None,
    viscous_at: float | None = None,
    controlled: Literal["force", "response"] = "force",
    input: str = "force",
) -> FrequencyResponse:
    """
    First-harmonic responses over force along a slow sine sweep at given amplitudes of the force, or of a response.

    Parameters
    ----------
    machine : Machine or Structure
        The model with its nonlinear elements; without any this is `frequency_response`.
    positions : array_like, shape (position,)
        y_b / L of the head; None for a structure.
    freq : array_like, shape (frequency,)
        Frequencies, ascending [Hz].
    amplitude : float or array_like, shape (frequency,)
        Amplitude of the force [N], or of the base's acceleration [m/s^2]; line by line, linear between the lines. With
        ``controlled="response"`` that of the first output, in its own quantity and SI unit.
    direction : {"up", "down"}
        Direction of the sweep: where the response folds, it tells on which branch the motion is.
    harmonics : int
        Highest harmonic of the ports' motion.
    outputs : sequence of str, optional
        Channels and ports; the model's channels by default.
    viscous_at : float, optional
        Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one where it meets the nonlinear elements.
    controlled : {"force", "response"}
        Whose amplitude is held. Under a held response the force is solved for, and the direction means nothing.
    input : str
        Where the force acts: the model's input, a port, or ``rail@0.25``.

    Returns
    -------
    FrequencyResponse
        ``data`` of shape (position, output, 1, frequency), through the measurement chain; an exponential window means nothing here.

    Raises
    ------
    ParameterError
        If a frequency, an amplitude, the direction or the number of harmonics is impossible.
    CouplingError
        If damping is hysteretic and no ``viscous_at`` is given, or no steady motion is found (a softening law runs away).

    Notes
    -----
    Alternating frequency/time (Cameron and Griffin, J. Appl. Mech. 56, 1989); laws with memory are marched through two periods.
    Friction at rest is a spring a thousand times as stiff as the model at its port, which leaves up to a percent of its effect.
    Odd laws are given odd harmonics: motion that settles unevenly under them, to one side of a clearance for instance, is not
    followed.

    Examples
    --------
    >>> from cutvib_ss.effects.cubic_stiffness import CubicStiffness
    >>> from cutvib_ss.model.machine import published_machine
    >>> machine = CubicStiffness("joint2", 8e9).apply(published_machine())
    >>> frf = sine_response(machine, [0.5], [200.0, 215.0, 230.0], 20.0, outputs=["tool_x"])
    >>> frf.data.shape, frf.unit
    ((1, 1, 1, 3), 'm/s^2/N')
    """
    return SineSweep(
        machine, positions, freq, amplitude, direction, harmonics, outputs, viscous_at, controlled, input
    ).response


class SineSweep:
    """A sine sweep and its derivatives; the arguments are those of `sine_response`."""

    def __init__(
        self,
        machine: Model,
        positions: ArrayLike | None,
        freq: ArrayLike,
        amplitude: ArrayLike,
        direction: Literal["up", "down"] = "up",
        harmonics: int = 7,
        outputs: str | Sequence[str] | None = None,
        viscous_at: float | None = None,
        controlled: Literal["force", "response"] = "force",
        input: str = "force",
    ) -> None:
        # A window's decay belongs to estimates from transients.
        self.machine = with_slots(machine, chain=replace(machine.chain, decay_rate=0.0))
        self.positions = as_positions(machine, positions)
        self.freq, self._s = as_laplace(freq, 0.0)
        if self.freq.size == 0 or self.freq[0] <= 0.0 or (np.diff(self.freq) <= 0.0).any():
            raise ParameterError("the frequencies of a sweep must be above 0 Hz and ascend; `direction` turns it round")
        self.amplitude = _amplitudes(amplitude, self.freq.size)
        check_choice("controlled", controlled, ("force", "response"))
        self.controlled, self.input = controlled, input
        if direction not in ("up", "down"):
            raise ParameterError(f"direction {direction!r} is neither up nor down")
        if harmonics < 1:
            raise ParameterError(f"harmonics = {harmonics} must be at least 1")
        self.direction, self.harmonics, self._viscous_at = direction, harmonics, viscous_at
        self.elements: tuple[NonlinearElement, ...] = machine.nonlinear
        self.outputs = tuple(machine.channels) if outputs is None else names_of(outputs)
        self.quantities = output_quantities(machine, self.outputs, None)
        ports = tuple(e.port for e in self.elements)
        still: list[Quantity] = ["displacement"] * len(ports)
        self._linear = ChainedResponse(
            self.machine, self.positions, self._s, (*self.quantities, *still),
            self.outputs + ports, (input, *ports),
        )  # fmt: skip
        forces = [e.restoring_force for e in self.elements]
        even = any(not f.odd for f in forces)
        samples = _SAMPLES * (harmonics + 1)
        if all(f.degree is not None for f in forces):
            # Products of a polynomial's harmonics with those kept alias no more from here on.
            samples = 2 * (max((f.degree or 0 for f in forces), default=0) + 1) * harmonics
        self._tables = harmonic_tables(np.arange(harmonics + 1) if even else np.arange(1, harmonics + 1, 2), samples)

    @cached_property
    def _balances(self) -> list[PortMotion]:
        if not self.elements:
            return []
        places = [None if np.isnan(y) else float(y) for y in self.positions]
        forms = [modal_form(self.machine, y, (), self._viscous_at, input=self.input) for y in places]
        return [
            PortMotion((form.poles, form.drives, form.shapes), self._laws(h), self._tables)
            for form, h in zip(forms, self._receptances, strict=True)
        ]

    @cached_property
    def _solved(self) -> list[tuple[FloatArray, ComplexArray, FloatArray, bool]]:
        """By position the ports' motion, fundamentals of the restoring forces, the exciting force, and whether the curve folds."""
        omegas, found = 2 * np.pi * self.freq, []
        for balance, h in zip(self._balances, self._receptances, strict=False):
            folds = False
            if self.controlled == "response":
                motions, force = balance.held(omegas, h[0, 0], h[0, 1:], self.amplitude)
                missing = np.flatnonzero(np.isnan(force))
            else:
                turn, force = 1 if self.direction == "up" else -1, self.amplitude
                swept, folds = balance.sweep(omegas[::turn], force[::turn])
                missing = np.arange(omegas.size)[::turn][len(swept) :]
                motions = np.ascontiguousarray(swept[::turn])
            if missing.size:
                raise CouplingError(
                    f"no steady motion at {self.freq[missing[0]]:.4g} Hz under {self.amplitude[missing[0]]:g}: "
                    f"{', '.join(e.law for e in self.elements)} lets it run away, or the sweep is too coarse; "
                    "lower the amplitude or add lines"
                )
            found.append((motions, balance.fundamentals(omegas, motions), force, folds))
        return found

    @cached_property
    def _slopes(self) -> list[tuple[FloatArray, Mapping[tuple[int, str], FloatArray]]]:
        omegas = 2 * np.pi * self.freq
        return [b.slopes(omegas, motions) for b, (motions, *_) in zip(self._balances, self._solved, strict=True)]

    @cached_property
    def _receptances(self) -> ComplexArray:
        """Channels, then ports, by the force, then by the ports; shape (position, output, input, frequency)."""
        return self._linear.data()

    def _laws(self, receptances: ComplexArray) -> list[RestoringForce]:
        """The elements' laws without jumps: friction sticks as stiffly as may be resolved."""
        n, out, force = len(self.outputs), [], self.amplitude
        if self.controlled == "response":
            force = force / np.abs(receptances[0, 0])
        for j, e in enumerate(self.elements):
            own = float(np.median(1.0 / np.abs(receptances[n + j, 1 + j])))
            moved = float((force * np.abs(receptances[n + j, 0])).max())
            out.append(e.restoring_force.regularised(own, moved))
        return out

    @cached_property
    def data(self) -> ComplexArray:
        """The responses, shape (position, output, frequency)."""
        n, h = len(self.outputs), self._receptances
        out = h[:, :n, 0].copy()
        for i, (_, forces, force, _) in enumerate(self._solved):
            out[i] -= np.einsum("cjf,fj->cf", h[i, :n, 1:], forces) / force
        return out

    @property
    def folds(self) -> bool:
        """Whether a curve that was followed folds, or does farther on: else there is one motion at each line."""
        return any(folds for *_, folds in self._solved)

    @property
    def response(self) -> FrequencyResponse:
        """The responses as a result."""
        return FrequencyResponse(
            self.data[:, :, None], self.freq, self.positions, self.outputs, (self.input,), self.quantities,
            input_unit=input_unit(self.machine, self.input),
            displacement_units=tuple(displacement_unit(self.machine, o) for o in self.outputs),
        )  # fmt: skip

    def derivative(self, path: Path) -> ComplexArray:
        """
        Derivative of the responses to one of the model's values, as a fit takes it.

        With N = N(Q; p) the ports' motion moves by (1 + A B) dQ = dh f - dA N - A e + h df, B being ∂N/∂Q and e ∂N/∂p. Of a held
        response, dX = dX₀ + x df with Re(X* dX) = 0 tells df; under a held force it is nothing.
        """
        n = len(self.outputs)
        by_law = path[0] == "nonlinear"
        d = np.zeros(self._receptances.shape, dtype=np.complex128) if by_law else self._linear.derivative(path)
        out: ComplexArray = d[:, :n, 0].copy()
        for i, ((_, laws, f, _), (by_motion, by_parameter)) in enumerate(zip(self._solved, self._slopes, strict=True)):
            h = self._receptances[i]
            own = _real(h[n:, 1:])
            pushed = f * d[i, n:, 0] - np.einsum("jif,fi->jf", d[i, n:, 1:], laws)
            explicit = np.zeros((self.freq.size, 2 * len(self.elements)))
            if by_law:
                explicit = by_parameter[int(path[1]), str(path[3])]
            right = np.stack([_pairs(pushed.T) - np.einsum("fab,fb->fa", own, explicit), _pairs(h[n:, 0].T)], axis=-1)
            moved = np.einsum("fab,fbk->fak", by_motion, np.linalg.solve(np.eye(own.shape[1]) + own @ by_motion, right))
            moved[..., 0] += explicit
            # Derivatives of the laws' forces along the value, and along the exciting force.
            along, by_force = ((moved[:, 0::2, k] - 1j * moved[:, 1::2, k]) for k in (0, 1))
            change = (
                f * d[i, :n, 0]
                - np.einsum("cjf,fj->cf", d[i, :n, 1:], laws)
                - np.einsum("cjf,fj->cf", h[:n, 1:], along)
            )
            if self.controlled == "response":
                shown = f * self.data[i]
                louder = h[:n, 0] - np.einsum("cjf,fj->cf", h[:n, 1:], by_force)
                df = -(shown[0].conj() * change[0]).real / (shown[0].conj() * louder[0]).real
                change = change + (louder - self.data[i]) * df
            out[i] = change / f
        return out


def _amplitudes(amplitude: ArrayLike, lines: int) -> FloatArray:
    """Amplitudes line by line."""
    given = np.asarray(amplitude, dtype=np.float64)
    if given.shape not in ((), (lines,)):
        raise ParameterError(f"amplitude has shape {given.shape}; give one value, or one for each of the {lines} lines")
    if not (np.isfinite(given) & (given > 0.0)).all():
        raise ParameterError(f"amplitude = {np.min(given):g} must be positive and finite")
    return np.ascontiguousarray(np.broadcast_to(given, (lines,)))


def _pairs(values: ComplexArray) -> FloatArray:
    """Cosines and sines of complex amplitudes, shape (frequency, port) to (frequency, 2 port)."""
    return np.stack([values.real, -values.imag], axis=-1).reshape(len(values), -1)


def _real(matrices: ComplexArray) -> FloatArray:
    """Complex matrices (port, port, frequency) as they act on cosines and sines, (frequency, 2 port, 2 port)."""
    a, b = matrices.real, matrices.imag
    blocks = np.array([[a, b], [-b, a]])  # (2, 2, port, port, frequency)
    n = 2 * a.shape[0]
    return np.ascontiguousarray(blocks.transpose(4, 2, 0, 3, 1)).reshape(-1, n, n)
