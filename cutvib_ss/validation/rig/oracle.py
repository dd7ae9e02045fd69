"""
What a method could know at best: the posterior over causes and places of one who knows the rig.

It has the generator's forms and sizes (`prior`), the machine's exact responses (`responses`), and what the generator lets vary
beside the cause: values within their tolerances, smooth calibration errors, movement between sessions, noise. Each hypothesis is
fitted to the blows themselves by Gauss and Newton from the best of many draws of the prior: tolerances, sizes, and movement
between sessions, which are marginalised by Laplace's method. What is linear (calibration, gains) is marginalised exactly.

Known to it and to no diagnosis: the size of the noise, which blows and records went wrong, corners of AC-coupled inputs. Not
known: the machine's values, the cause, and how far the machine moves. It reads every sixth line, and the records of the two
highest levels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.validation.rig.blows import BLOCK, FS
from cutvib_ss.validation.rig.campaign import Campaign
from cutvib_ss.validation.rig.causes import FORMS
from cutvib_ss.validation.rig.evidence import MOVING, TUNED, WARMING, Marginal, movements, warming
from cutvib_ss.validation.rig.prior import VARIED, Hypothesis, hypotheses
from cutvib_ss.validation.rig.responses import covered, responses
from cutvib_ss.validation.rig.structure import TOLERANCE, Rig

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

CAUSES = tuple(c for c in FORMS)
NONE = ("none", "none")

NONE_SHARE = 0.375
"""Part of the cases without a cause among those with none or one, in a trial by default."""

_WARMED = np.array([float(name in WARMING) for name in MOVING])
_SPREAD = np.array([[float(a == b) / 0.01 for b in MOVING] for a in TUNED])

WINDOW = 2.0
"""Decay rate of the window laid over force and responses [1/s]: a response of the rail is over before the record is."""

LINES = np.arange(18.0, 450.1, 3.0)
"""Lines that are read [Hz]; what their noise shares is taken out (`evidence.whitening`)."""

LEVELS = 2
"""Levels that are read, from the highest down: the response of a linear machine is the same at all."""

COARSE, SPARSE = 3, 4
"""Of the lines one in so many, and so many positions, in the first look at a hypothesis."""

DRAWS, KEPT = 20, 8
"""Draws of the prior in the first look, and hypotheses that are fitted after it."""

ANNEALED = (0.05, 0.05, 0.02, 0.01, 0.005, *[0.0] * 7)
"""Errors of the model, over the response, with which the steps of a fit begin and end."""

STRIDE = 1.5
"""Standard deviations of the tolerances that a step may go."""

HOPELESS = 60.0
"""Nats behind the best, at the last error of the model, from which on a hypothesis is not fitted further."""

SETTLED = 0.1
"""Square of residual and unknowns that another step would take away, up to which a fit has ended."""

MOST_DRIFT = 0.01
"""Movement between sessions up to which it is followed from session to session."""

COARSEST = 2.0
"""Steps of the converter over the noise from which on the noise says nothing of what was rounded away."""


@dataclass(frozen=True)
class Posterior:
    """What a perfect method would state."""

    odds: Mapping[tuple[str, str], float]  # Probability by effect and place
    drift: float  # Most probable movement between sessions

    def to_dict(self) -> dict[str, Any]:
        """As JSON: the causes, most probable first."""
        ranked = sorted(self.odds.items(), key=lambda item: -item[1])
        rows = [{"effect": e, "place": p, "probability": q} for (e, p), q in ranked if q > 1e-12]
        return {"causes": rows, "drift": self.drift}


@dataclass(frozen=True)
class Seen:
    """What was measured: responses by session (position), channel and line, and the standard deviation of their noise."""

    positions: tuple[float, ...]
    channels: tuple[int, ...]
    s: Complex
    data: Complex
    noise: Array
    coupling: Complex  # Of the inputs: what a response over force is multiplied by
    levels: int  # Records behind each session


def knows(case: Any) -> bool:
    """Whether a case is one that the oracle can judge."""
    conditions = case.conditions
    rig, faults = case.rig, case.faults
    if not isinstance(rig, Rig) or not rig.linear or not covered(rig) or case.kind not in ("none", "single"):
        return False
    if any(f.effect not in CAUSES for f in faults) or conditions.repeatability.drift > MOST_DRIFT:
        return False
    steps = (2 * conditions.response_range / conditions.noise[0], 2 * conditions.force_range / conditions.force_noise)
    return all(step / 2**conditions.bits < COARSEST for step in steps)


def seen(campaign: Campaign) -> Seen:
    """The blows of a campaign as responses on a damped line, averaged over blows and levels."""
    c = campaign.conditions
    kept = sorted(range(len(c.levels)), key=lambda i: -c.levels[i])[:LEVELS]
    picked = tuple(campaign.names.index(name) for name in c.channels)
    count = round(BLOCK * FS)
    time = np.arange(count) / FS
    window = np.exp(-WINDOW * time)
    index = np.round(LINES * BLOCK).astype(int)
    s = np.asarray(WINDOW + 2j * np.pi * LINES)
    spoilt, wrong = campaign.overloaded(), dict(c.bad)
    step = [2 * r / 2**c.bits for r in (c.response_range * np.array(c.noise) / c.noise[0], np.array([c.force_range]))]
    size = np.sqrt(np.array(c.noise) ** 2 + step[0] ** 2 / 12)
    force_size = float(np.sqrt(c.force_noise**2 + step[1][0] ** 2 / 12))
    slow = np.sqrt(1 + 0.09 * 40 / np.maximum(index, 4))
    positions, data, noise = [], [], []
    for p, y in enumerate(c.positions):
        cross, power = np.zeros((len(picked), LINES.size), dtype=np.complex128), np.zeros(LINES.size)
        for record in (p * len(c.levels) + k for k in kept):
            for blow in range(c.blows):
                if (record, blow) in spoilt or record in wrong:
                    continue
                force, shown = campaign.recording(record, blow)
                f = np.fft.rfft(window * force)[index]
                a = np.fft.rfft(window * shown[list(picked)], axis=-1)[:, index]
                cross += a * f.conj()
                power += np.abs(f) ** 2
        if y is None or not power.any():
            continue
        h = cross / power
        energy = np.sum(window**2) / power * slow**2
        noise.append(np.sqrt(energy * (size[list(picked), None] ** 2 + np.abs(h) ** 2 * force_size**2)))
        positions.append(y)
        data.append(h)
    coupling = np.ones(LINES.size, dtype=np.complex128)
    for corner, sign in zip(c.coupling, (-1, 1), strict=True):
        if corner:
            coupling *= (s / (s + 2 * np.pi * corner)) ** sign
    return Seen(tuple(positions), picked, s, np.array(data), np.array(noise), coupling, len(kept))


def thinned(what: Seen) -> Seen:
    """Few lines and few positions of it."""
    some = np.unique(np.linspace(0, len(what.positions) - 1, SPARSE).round().astype(int))
    lines = slice(0, None, COARSE)
    return replace(
        what,
        positions=tuple(what.positions[i] for i in some),
        s=what.s[lines],
        data=what.data[some][..., lines],
        noise=what.noise[some][..., lines],
        coupling=what.coupling[lines],
    )


class Model:
    """A nominal machine, measured: responses by tuning and by the coordinates of a hypothesis."""

    def __init__(self, nominal: Rig, what: Seen, severity: tuple[float, float]) -> None:
        self.nominal, self.what, self.severity = nominal, what, severity

    def at(self, hypothesis: Hypothesis | None, x: Array, tuning: Array, moved: Array | None = None) -> Complex:
        """
        Responses (session, channel, line) at coordinates of the hypothesis and of the tolerances.

        `moved` is what each session adds to the logarithms of the values that move, over their movement at a drift of 1:
        (session, value).
        """
        what = self.what
        if moved is None or not moved.any():
            found = responses(self._machine(hypothesis, x, tuning), what.positions, what.s)
        else:
            rigs = [self._machine(hypothesis, x, tuning + _SPREAD @ own) for own in moved]
            found = np.concatenate([responses(r, [y], what.s) for r, y in zip(rigs, what.positions, strict=True)])
        return np.asarray(found[:, list(what.channels)] * what.coupling)

    def _machine(self, hypothesis: Hypothesis | None, x: Array, tuning: Array) -> Rig:
        factors = {name: float(np.exp(TOLERANCE[name] * t)) for name, t in zip(TUNED, tuning, strict=True)}
        rig = self.nominal.scaled(factors)
        return rig if hypothesis is None else hypothesis.machine(rig, x, self.severity)

    def slopes(
        self, hypothesis: Hypothesis | None, point: Array, here: Complex, moved: Array | None = None, step: float = 1e-3
    ) -> Complex:
        """Derivatives to the coordinates of the hypothesis, then to those of the tolerances: (coordinate, …)."""
        n, out = point.size - len(TUNED), []
        for k in range(point.size):
            there = point.copy()
            there[k] += step
            out.append((self.at(hypothesis, there[:n], there[n:], moved) - here) / step)
        return np.array(out)


@dataclass
class Fit:
    """One hypothesis at its best coordinates."""

    hypothesis: Hypothesis | None
    log_evidence: float  # Minus infinity where it was given up
    annealed: float  # The same with the last error of the model that is not zero
    drift: float
    x: Array
    tuning: Array


def posterior(
    case: Any, none: float = NONE_SHARE, severity: tuple[float, float] = (0.3, 2.0), varied: float = VARIED
) -> Posterior:
    """
    The posterior over effects and places of a case that `knows`.

    What the oracle does not cover is left out of its prior: it is the posterior of one who was told that the case is among those
    that it covers. All causes of the catalogue are alike in it, as in a trial.
    """
    nominal = Rig(case.nominal.head, case.nominal.rail)
    listed = hypotheses(nominal, dict.fromkeys(CAUSES, (1 - none) / len(CAUSES)), severity, varied)
    return judged(nominal, seen(case.campaign), listed, none, movements(case.conditions.repeatability.stated), severity)


def judged(
    nominal: Rig,
    what: Seen,
    listed: Sequence[Hypothesis],
    none: float,
    moves: Mapping[float, float],
    severity: tuple[float, float],
) -> Posterior:
    """The posterior given what was seen, hypotheses with their priors, that of no cause, and of movements between sessions."""
    starts, rest = _first_look(nominal, what, listed, severity)
    model = Model(nominal, what, severity)
    fits, best = [], -np.inf
    for hypothesis, x in starts:
        fit = _fitted(model, hypothesis, x, moves, best)
        best = max(best, fit.annealed)
        fits.append(fit)
    # Those that are not fitted are held against no cause as they looked at first: it matters where a gap hardly shows.
    sound = fits[0].log_evidence
    fits += [Fit(h, sound + odds, -np.inf, 0.0, np.zeros(0), np.zeros(0)) for h, odds in rest]
    weights = np.array([f.log_evidence + np.log(f.hypothesis.probability if f.hypothesis else none) for f in fits])
    weights = np.exp(weights - weights.max())
    odds: dict[tuple[str, str], float] = {}
    for fit, w in zip(fits, weights / weights.sum(), strict=True):
        name = NONE if fit.hypothesis is None else (fit.hypothesis.effect, fit.hypothesis.place)
        odds[name] = odds.get(name, 0.0) + float(w)
    return Posterior(odds, fits[int(np.argmax(weights))].drift)


def _first_look(
    nominal: Rig, what: Seen, listed: Sequence[Hypothesis], severity: tuple[float, float]
) -> tuple[list[tuple[Hypothesis | None, Array]], list[tuple[Hypothesis, float]]]:
    """No cause and the hypotheses that look best, each with its best draw; the others with log odds against no cause."""
    rng = np.random.default_rng(0)
    thin = thinned(what)
    model = Model(nominal, thin, severity)
    still = np.zeros(len(TUNED))
    bare = model.at(None, np.zeros(0), still)
    drawn = [rng.standard_normal((DRAWS, h.dimension)) for h in listed]
    found = [
        thin.data - bare,
        *(thin.data - model.at(h, x, still) for h, own in zip(listed, drawn, strict=True) for x in own),
    ]
    slopes = model.slopes(None, still, bare)
    score = Marginal(thin, ANNEALED[0]).alike(np.array(found), slopes, bare)
    sound, scores = float(score[0]), score[1:].reshape(len(listed), DRAWS)
    looks = scores.max(axis=1) + np.log([h.probability for h in listed])
    order = np.argsort(-looks, kind="stable")
    starts = [(listed[k], drawn[k][int(np.argmax(scores[k]))]) for k in order[:KEPT]]
    # Log odds of all draws of a hypothesis against no cause.
    averages = np.logaddexp.reduce(scores, axis=1) - np.log(DRAWS) - sound
    return [(None, np.zeros(0)), *starts], [(listed[k], float(averages[k])) for k in order[KEPT:]]


def _fitted(
    model: Model, hypothesis: Hypothesis | None, start: Array, moves: Mapping[float, float], best: float = -np.inf
) -> Fit:
    """Gauss and Newton from a start, the model's error falling from step to step; the evidence by Laplace at the end."""
    data, n = model.what.data, start.size
    # Coordinates, tolerances, then the trend with the temperature and its bow.
    point, drift = np.concatenate([start, np.zeros(len(TUNED) + 2)]), 0.003
    moved = np.zeros((len(model.what.positions), len(MOVING)))
    warm = warming(len(moved))
    evidence = annealed = -np.inf

    def total(point: Array, moved: Array) -> Array:
        return moved + np.outer(point[-2:] @ warm, _WARMED)

    for k, error in enumerate(ANNEALED):
        marginal = Marginal(model.what, error)
        here = model.at(hypothesis, point[:n], point[n:-2], total(point, moved))
        slopes = model.slopes(hypothesis, point[:-2], here, total(point, moved))
        parts = marginal.parts(data - here, slopes[:n], slopes[n:], here)
        values = [marginal.log_evidence(parts, point, moved, d) + np.log(w) for d, w in moves.items()]
        evidence, drift = float(np.logaddexp.reduce(values)), list(moves)[int(np.argmax(values))]
        before = marginal.misfit(parts, point, moved, drift)
        step, drawn = marginal.step(parts, point, moved, drift)
        # What the linear model still promises: it is not believed.
        left = before - marginal.misfit(parts.after(step, drawn), point + step, moved + drawn, drift)
        evidence -= 0.5 * max(left, 0.0)
        if error > 0.0:
            annealed = evidence
            # What it promises is held against what the best has shown.
            if ANNEALED[k + 1] == 0.0 and annealed + 0.5 * max(left, 0.0) < best - HOPELESS:
                return Fit(hypothesis, -np.inf, annealed, drift, point[:n], point[n:-2])
        if k == len(ANNEALED) - 1 or (error == 0.0 and left < SETTLED):
            break
        # Linear over half the width of a resonance or so: of the tolerances and of a session's movement alike.
        session = 100 * np.abs(total(step, drawn)).max()
        farthest = max(float(np.abs(step[:-2]).max()), float(session), 1e-9)
        share = min(1.0, STRIDE / farthest)
        for _ in range(4):
            ahead, own = point + share * step, moved + share * drawn
            there = model.at(hypothesis, ahead[:n], ahead[n:-2], total(ahead, own))
            tried = marginal.parts(data - there, slopes[:n], slopes[n:], there)
            gained = before - marginal.misfit(tried, ahead, own, drift)
            if gained > 0:
                point, moved = ahead, own
                break
            share /= 3
    return Fit(hypothesis, evidence, annealed, drift, point[:n], point[n:-2])
