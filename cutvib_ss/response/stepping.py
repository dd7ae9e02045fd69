"""
Responses in time to a measured force, with nonlinear forces at ports.

The linear part is exact: a force that is band-limited between its samples passes through the modal sum at s = σ + jω, the
histories being weighted by e^(-σt), which keeps off resonances; what the transform wraps around is a free response, known mode by
mode, and is taken away. Only the nonlinear forces are stepped: the modes that they drive are advanced exactly over a fine step,
the forces being implicit at its end (`cutvib_ss.response.compiled`). What the forces do to the channels is again a product with
the modal sum, cut at the Nyquist frequency as a digitiser's filter would.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.restoring_forces import Hysteretic, packed
from cutvib_ss.response.modal_basis import linear_course, parts, reading
from cutvib_ss.response.modal_form import ModalForm, modal_form
from cutvib_ss.results import ComplexArray, FloatArray

__all__ = ["ModalForm", "Stepped", "modal_form", "step"]

_DIED = 27.6
"""A mode that has decayed by e^-27.6 = 1e-12 is gone."""
_WRAP = 3.0
"""Decay exponent of every mode over the transform's length, at least: small, since the weights magnify rounding by e^3."""
_TAPER = 32
"""Samples over which forces fade in before the record and out beyond it, so that its ends do not ring."""
STEPS = 40
"""Steps in a period of a port's motion: errors of smooth laws are then about 1e-6, of laws with corners 1e-4."""
_FINEST = 32
"""Largest oversampling that is chosen unasked."""
_FREE = 8.0
"""Oversampling of a free body with friction, at least: it drifts by 1e-3 of its way."""
_BLOCK = 200_000
"""Fine instants of several blows that are treated together."""
_CHUNK = 1 << 15
"""Instants of a free response that are computed at once."""
_PART = 128
"""Instants over which a mode's own turn is computed, once for all parts of a free response."""
_KEPT = 1 << 18
"""Lines times modes from which a modal sum does not keep them: 8 MB."""


@dataclass(frozen=True)
class Stepped:
    """Responses in time."""

    responses: FloatArray  # Channels, each in its quantity
    motions: FloatArray  # Displacement of each nonlinear element's port
    forces: FloatArray  # Force of each nonlinear element against that motion
    ran_away: np.ndarray  # Whether a softening law let the motion run away; its force is zero from there on


def step(
    form: ModalForm,
    force: ArrayLike,
    fs: float,
    elements: Sequence[NonlinearElement] = (),
    oversample: int | None = None,
    initial: ArrayLike | None = None,
    dynamic_below: float = np.inf,
    steps: float = STEPS,
) -> Stepped:
    """Responses to a sampled force that is band-limited between its samples, from rest or an initial state."""
    f = np.asarray(force, dtype=np.float64)
    if f.ndim != 2 or not f.size or not np.isfinite(f).all():
        raise ParameterError(f"force has shape {f.shape}; give finite numbers of shape (blow, sample)")
    if not (fs > 0.0 and (oversample is None or oversample >= 1)):
        raise ParameterError(f"fs = {fs} and oversample = {oversample} must be positive")
    if [e.port for e in elements] != list(form.ports):
        raise ParameterError(f"the elements sit at {[e.port for e in elements]}, the form's ports are {form.ports}")
    run = _Run(form, f, fs, tuple(elements), oversample, _initial(form, initial, len(f)), dynamic_below, steps).result()
    form.add_base(run.responses, f, fs)
    return run


def _initial(form: ModalForm, initial: ArrayLike | None, blows: int) -> ComplexArray | None:
    if initial is None:
        return None
    state = np.atleast_2d(np.asarray(initial, dtype=np.float64))
    if state.shape[1] != 2 * len(form.dofs) or len(state) not in (1, blows):
        raise ParameterError(
            f"initial has shape {state.shape}; give displacement and velocity of {', '.join(form.dofs)}"
        )
    modes: ComplexArray = np.broadcast_to(state, (blows, state.shape[1])) @ form.from_state.T
    return modes


class _Lines(NamedTuple):
    """A modal sum at the lines of a transform of histories."""

    size: int  # Length of the transform
    rate: float  # Of the weight e^(-rate t) on the histories [1/s]
    s: ComplexArray
    receptance: ComplexArray  # Shape (output, input, line)
    inverses: ComplexArray  # 1/((s - p)(s - p̄)), shape (mode, line)
    ends: FloatArray  # Weight of each line in the mean over all lines, the conjugate ones too


def _lines(form: ModalForm, fs: float, run: int) -> _Lines:
    """The lines for histories of so many samples; a form keeps them, unless they are many."""
    if (fs, run) in form.at_lines:
        kept: _Lines = form.at_lines[fs, run]
        return kept
    size = 2 * int(fft.next_fast_len((run + _TAPER + 1) // 2, real=True))
    slowest = float(np.min(-form.poles.real))
    rate = max(0.0, _WRAP * fs / size - slowest)
    s = _at_lines(rate, fs, size)
    inverses = form.inverses(s)
    ends = np.full(s.size, 1.0 / size)
    ends[[0, -1]] *= 0.5
    made = _Lines(size, rate, s, form.summed(s, inverses), inverses, ends)
    if s.size * form.poles.size < _KEPT:
        form.at_lines[fs, run] = made
    return made


class _Run:
    """One call of `step`: what its parts share."""

    def __init__(
        self,
        form: ModalForm,
        force: FloatArray,
        fs: float,
        elements: tuple[NonlinearElement, ...],
        oversample: int | None,
        initial: ComplexArray | None,
        dynamic_below: float,
        steps: float,
    ) -> None:
        self.form, self.fs, self.elements, self.given, self.steps = form, fs, elements, oversample, steps
        self.samples = force.shape[1]
        self.initial, self.fastest = initial, 2 * np.pi * dynamic_below
        self.force = np.hstack([force, force[:, -1:] * _fade(_TAPER)])
        self.run = self.samples + _TAPER
        lines = _lines(form, fs, self.run)
        self.size, self.rate, self.s, self.receptance, self.inverses, self.ends = lines

    def _weight(self, samples: int, fine: int) -> FloatArray:
        return _decay(self.rate / (self.fs * fine), samples)

    def _transform(self, history: FloatArray, fine: int) -> ComplexArray:
        """Spectrum of histories on the fine or coarse grid, the lines of the coarse one."""
        padded = np.zeros((*history.shape[:-1], self.size * fine))
        run = history.shape[-1]
        if self.rate:
            np.multiply(history, self._weight(run, fine), out=padded[..., :run])
        else:
            padded[..., :run] = history
        # What goes before the first sample stands at the end of the transform's period, where it is earlier by one.
        before = _fade(_TAPER * fine)
        early = before / self._weight(before.size + 1, fine)[1:]
        padded[..., -before.size :] = history[..., :1] * early[::-1]
        spectrum: ComplexArray = fft.rfft(padded, axis=-1)[..., : self.s.size] / fine
        return spectrum

    def _history(
        self, spectrum: ComplexArray, samples: int, fine: int = 1, out: FloatArray | None = None
    ) -> FloatArray:
        size = self.size * fine
        if fine > 1:
            spectrum = spectrum.copy()
            spectrum[..., -1] *= 0.5  # on the finer grid the coarse Nyquist line has a twin
        history: FloatArray = fft.irfft(spectrum, size, axis=-1)[..., :samples]
        return np.multiply(history, fine / self._weight(samples, fine) if self.rate else fine, out=out)

    def _wrapped(self, spectrum: ComplexArray, drives: ComplexArray) -> ComplexArray:
        """Modes that a force's transform leaves at the first sample, shape (blow, mode)."""
        # Mode k at the first sample is the mean over all lines, the conjugate ones too, of drive · force/(s - p_k), which is
        # drive · force (s - p̄_k)/((s - p_k)(s - p̄_k)).
        mean = self.ends * spectrum
        real_parts = np.stack([mean * self.s, mean]).conj().view(np.float64) @ self.inverses.view(np.float64).T
        modes: ComplexArray = drives * 2 * (real_parts[0] - self.form.poles.conj() * real_parts[1])
        return modes

    def _free(self, modes: ComplexArray) -> FloatArray:
        """Free responses of all outputs, shape (blow, output, sample)."""
        orders = np.array([*self.form.orders, *(0 for _ in self.form.ports)])
        rows = self.form.shapes * self.form.poles ** orders[:, None]
        each = (modes[:, None, :] * rows).reshape(-1, modes.shape[1])
        out = np.zeros((len(modes), len(rows), self.samples))
        # A mode is summed while it lives; those of like length together.
        alive = np.minimum(_DIED / np.maximum(-self.form.poles.real, 1e-300) * self.fs, self.samples)
        octave = np.floor(np.log2(self.samples / np.maximum(alive, 1.0))).astype(int)
        for k in np.unique(octave):
            own = octave == k
            last = int(np.ceil(alive[own].max()))
            # From the beginning of each part on a mode turns alike: e^(p (t + u)) = e^(pt) e^(pu).
            turn = np.exp(self.form.poles[own, None] * (np.arange(_PART) / self.fs))
            turns = np.vstack([turn.real, -turn.imag])
            for first in range(0, last, _CHUNK):
                t = np.arange(first, min(last, first + _CHUNK), _PART) / self.fs
                begun = each[:, None, own] * np.exp(self.form.poles[own] * t[:, None])
                rows_of = np.concatenate([begun.real, begun.imag], axis=-1).reshape(-1, 2 * len(turn))
                summed = (rows_of @ turns).reshape(*out.shape[:2], -1)
                count = min(last - first, summed.shape[-1])
                out[..., first : first + count] += summed[..., :count]
        return out

    def result(self) -> Stepped:
        form, n, elements = self.form, len(self.form.outputs), len(self.elements)
        force = self._transform(self.force, 1)
        # What is in the transforms and not in the responses; less what is in these and not in the transforms.
        surplus = self._wrapped(force, form.drives[:, 0])
        if self.initial is not None:
            surplus = surplus - self.initial
        self.fine = self.given or (self._enough(force) if elements else 1)
        shown = np.empty((len(force), len(form.shapes), self.samples))
        resisting = np.empty((len(force), elements, self.samples))
        away = np.zeros(len(force), dtype=bool)
        # A few blows at a time stay in the processor's cache.
        count = max(1, _BLOCK // (self.size * self.fine))
        for k in range(0, len(force), count):
            some = slice(k, k + count)
            shown[some], resisting[some], away[some] = self._blows(force[some], surplus[some])
        shown -= self._free(surplus)
        return Stepped(shown[:, :n], shown[:, n:], resisting, away)

    def _blows(self, force: ComplexArray, surplus: ComplexArray) -> tuple[FloatArray, FloatArray, np.ndarray]:
        """Responses and nonlinear forces of some blows; what their transforms wrap around goes into the surplus."""
        form, n = self.form, len(self.form.outputs)
        spectrum = self.receptance[:, 0] * force[:, None]
        resisting, away = np.zeros((len(force), 0, self.s.size), dtype=np.complex128), np.zeros(len(force), dtype=bool)
        if self.elements:
            resisting, away = self._nonlinear(spectrum[:, n:], surplus)
            for e in range(len(self.elements)):
                surplus -= self._wrapped(resisting[:, e], form.drives[:, 1 + e])
                spectrum -= self.receptance[:, 1 + e] * resisting[:, e, None]
        for k, order in enumerate(form.orders):
            if order:
                spectrum[:, k] *= self.s**order
        return self._history(spectrum, self.samples), self._history(resisting, self.samples), away

    def _enough(self, force: ComplexArray) -> int:
        """Steps in a sample that resolve the ports' motion."""
        moved, rate = self.receptance[len(self.form.outputs) :, 0], np.abs(self.s)
        power = rate**2 * np.mean(_squared(force), axis=0) * np.sum(_squared(moved), axis=0)
        mean = float(rate @ power / np.sum(power)) / (2 * np.pi) if power.any() else 0.0
        if self.initial is not None:
            mean = max(mean, float(np.abs(self.form.poles).min()) / (2 * np.pi))
        slips = any(isinstance(e.restoring_force, Hysteretic) for e in self.elements)
        steps = self.steps * (2 if any(e.restoring_force.jumps for e in self.elements) else 1)
        # Where a free body stops and starts adds up over its whole way.
        free = float(np.abs(self.form.poles).min()) < 2 * np.pi * self.fs / self.size
        least = _FREE if slips and free else 1.0
        return int(min(_FINEST, 2 ** np.ceil(np.log2(max(least, steps * mean / self.fs)))))

    def _nonlinear(self, linear: ComplexArray, surplus: ComplexArray) -> tuple[ComplexArray, np.ndarray]:
        """Spectra of the nonlinear forces, shape (blow, element, frequency)."""
        from cutvib_ss.response import compiled  # numba takes half a second to import

        form, fine = self.form, self.fine
        instants = self.run * fine
        h = 1.0 / (self.fs * fine)
        rows = form.shapes[len(form.outputs) :]
        motion = np.empty((len(linear), 2, len(self.elements), instants))
        for k in range(2):
            self._history(linear * self.s**k, instants, fine, out=motion[:, k])
        modes = (np.abs(form.poles) * h < np.pi) & (np.abs(form.poles) < self.fastest)
        turn, pushes = linear_course(form.poles[modes], form.drives[modes, 1:].T, h)
        beyond = ~modes
        still = (rows[:, beyond] * -1.0 / form.poles[beyond]) @ form.drives[beyond, 1:]
        over_a_step = still.real + (rows[:, modes] @ (pushes[0] + pushes[1]).T).real
        forces_of = [
            e.restoring_force.at_step(float(a)) for e, a in zip(self.elements, over_a_step.diagonal(), strict=True)
        ]
        laws = packed(forces_of)
        begin = surplus[:, modes]
        reads = np.stack([reading(rows[:, modes] * form.poles[modes] ** k) for k in range(2)])
        forces, away, _ = compiled.interact(
            motion, np.ascontiguousarray(np.stack([begin.real, begin.imag], axis=1)), h, parts(turn),
            np.stack([parts(p) for p in pushes]), reads,
            np.stack([still.real, np.zeros(still.shape)]), *laws, np.zeros((len(linear), *laws.sliders.shape[:2])),
        )  # fmt: skip
        forces[..., -_TAPER * fine :] *= _fade(_TAPER * fine)
        spectrum = self._transform(forces, fine)
        for k, force in enumerate(forces_of):
            spectrum[:, k] *= _course(self.rate, self.fs, self.size, fine, force.jumps)
        return spectrum, away


@lru_cache(maxsize=8)
def _course(rate: float, fs: float, size: int, fine: int, jumps: bool) -> ComplexArray:
    """Spectrum of a force's course between instants over that of its values there, at the lines of a transform."""
    s = _at_lines(rate, fs, size)
    x = np.where(s == 0.0, 1e-9, s / (fs * fine))
    return np.asarray(np.expm1(x) / x if jumps else (np.sinh(x / 2) / (x / 2)) ** 2)


def _at_lines(rate: float, fs: float, size: int) -> ComplexArray:
    """Where a transform of histories that are weighted by e^(-rate t) sees a system."""
    return np.asarray(rate + 2j * np.pi * fs / size * np.arange(size // 2 + 1), dtype=np.complex128)


def _squared(values: ComplexArray) -> FloatArray:
    """Squared moduli."""
    return np.asarray(values.real**2 + values.imag**2)


@lru_cache(maxsize=8)
def _decay(rate: float, samples: int) -> FloatArray:
    """The weight e^(-rate n), which a run takes several times."""
    return np.asarray(np.exp(-rate * np.arange(samples)))


@lru_cache(maxsize=32)
def _fade(samples: int) -> FloatArray:
    """From nearly one to nearly nothing."""
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.arange(1, samples + 1) / (samples + 1)))
