"""Drift and discrepancy as low-rank directions, against dense Gaussian algebra."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, stats

from cutvib_ss.diagnosis import cross_validation
from cutvib_ss.diagnosis.directions import Directions
from cutvib_ss.diagnosis.discrepancy import smooth_shapes
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.layout import Sizes
from cutvib_ss.diagnosis.likelihood import Factored, Quadratic
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import By, Entry, Records, merged
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.model.structure import Structure
from tests.unit.diagnosis_example import example_structure
from tests.unit.record_example import entry_of

FREQ = np.linspace(20.0, 110.0, 31)


def response(
    structure: Structure,
    k: float = 1.0,
    gain: float | np.ndarray = 1.0,
    m: float = 1.0,
    c: float = 1.0,
    parts: Sequence[float] = (),
) -> np.ndarray:
    """Displacement at the drive and acceleration at the top, by matrices."""
    system = structure.system
    s = 2j * np.pi * FREQ
    out = []
    errors = [np.zeros_like(system.mass) for _ in "kcm"]
    for factor, part in zip(parts, system.parts, strict=False):
        errors[part.power] += (factor - 1.0) * part.change
    for line in s:
        z = m * system.mass * line**2 + c * (system.damping + errors[1]) * line + k * (system.stiffness + errors[0])
        q = np.linalg.solve(z, system.ports["drive"])
        out.append([system.ports["drive"] @ q, line**2 * (system.ports["top"] @ q)])
    return np.asarray(gain * np.array(out).T)


def entries(structure: Structure, drift: float, seed: int = 1, count: int = 6) -> tuple[Entry, ...]:
    rng = np.random.default_rng(seed)
    found = []
    for i in range(count):
        data = response(structure, 1 + drift * rng.standard_normal(), 1 + drift * rng.standard_normal())
        variance = np.full(data.shape, 1.0) * (2e-3 * np.abs(data).max(axis=1, keepdims=True)) ** 2
        noise = np.sqrt(variance / 2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
        found.append(
            entry_of(i, None, 1.0, data + noise, variance, FREQ, ("y", "a"), ("displacement", "acceleration"))
        )  # fmt: skip
    return tuple(found)


def test_shapes_are_those_of_the_process() -> None:
    freq = np.geomspace(15.0, 450.0, 40)
    shapes = smooth_shapes(freq, (15.0, 450.0))
    u = np.log(freq)
    kernel = np.exp(-0.5 * ((u[:, None] - u) / SETTINGS.discrepancy_length) ** 2)
    np.testing.assert_allclose(shapes.T @ shapes, kernel, atol=0.01)


@pytest.mark.parametrize("sizes", [Sizes(3e-3, 1e-3), Sizes(3e-5, 1e-2)])
def test_evidence_of_sizes_is_that_of_the_dense_covariance(sizes: Sizes) -> None:
    structure = example_structure()
    problem = Problem(structure, merged(entries(structure, 3e-3, count=3)), Hypothesis())
    x = problem.start()
    predictions, residuals, squares = problem.residuals(x)
    directions = Directions(problem, x, predictions)
    matrix, gradient = directions.normal(residuals)
    precision = problem.prior_precision()
    quadratic = Quadratic(
        directions.layout,
        matrix,
        gradient,
        squares,
        x,
        precision,
        np.ones(x.size, dtype=bool),
        even=np.zeros(x.size, dtype=bool),
        offsets=np.zeros(directions.layout.size),
        count=2 * sum(g.data.size for g in problem.groups),
    )
    rows = directions.flat()
    residual = np.concatenate([np.concatenate([r.real.ravel(), r.imag.ravel()]) for r in residuals])

    def dense(s: Sizes) -> float:
        scaled = rows * directions.layout.scale(s)[:, None]
        return float(stats.multivariate_normal(cov=np.eye(residual.size) + scaled.T @ scaled).logpdf(residual))

    other = Sizes(1e-3, 3e-4)
    assert quadratic.log_evidence(sizes) - quadratic.log_evidence(other) == pytest.approx(
        dense(sizes) - dense(other), abs=1e-3
    )


@pytest.mark.parametrize("by", [None, "session", "record"])
def test_the_normal_matrix_is_that_of_the_columns_written_down(by: By | None) -> None:
    structure = example_structure()
    rng = np.random.default_rng(3)
    struck = tuple(
        e
        if e.record % 2
        else replace(e, hits={("hit", e.record, k): rng.standard_normal(e.data.shape) + 0j for k in range(2)})
        for e in entries(structure, 3e-3, count=4)
    )
    cause = ParameterShift("structure", "stiffness", 1.2)
    problem = Problem(structure, Records(struck, moving=True).groups(by), Hypothesis((cause,)))
    problem.drifting_within = tuple(e.record for e in struck)
    x = problem.start() + 0.1
    predictions, residuals, _ = problem.residuals(x)
    directions = Directions(problem, x, predictions)
    assert all((directions.layout.pivots, directions.layout.hits, directions.layout.nominal))
    matrix, gradient = directions.normal(residuals)
    rows = directions.flat()
    residual = np.concatenate([np.concatenate([r.real.ravel(), r.imag.ravel()]) for r in residuals])
    size = np.sqrt(np.sum(rows**2, axis=1))
    np.testing.assert_allclose(matrix / np.outer(size, size), rows @ rows.T / np.outer(size, size), atol=1e-12)
    np.testing.assert_allclose(gradient / size, rows @ residual / size, atol=1e-9 * np.linalg.norm(residual))


def test_a_structure_that_drifts_between_records_has_no_gap() -> None:
    structure = example_structure()
    drifting = entries(structure, 5e-3)
    found = fit(structure, Records(drifting), Hypothesis())
    assert found.spread.sizes.drift in (3e-3, 1e-2)
    assert 0.8 < found.reduced < 1.1
    steady = fit(structure, Records(entries(structure, 0.0)), Hypothesis())
    assert steady.spread.sizes.drift < 1e-3
    stated = replace(structure, tolerance=replace(structure.tolerance, drift=1e-9))
    assert fit(stated, Records(drifting), Hypothesis()).chi2 > 5 * found.count


def test_noise_that_is_correlated_is_each_response_s_own_and_an_error_of_the_model_one_of_all() -> None:
    structure = example_structure()
    records = Records(entries(structure, 0.0))
    found = fit(structure, records, Hypothesis())
    problem = Problem(structure, records.merged, Hypothesis())
    predictions = problem.predictions(found.x)
    directions = Directions(problem, [found.x] * len(problem.groups), predictions, True)
    slow = np.cos(np.arange(FREQ.size) / 4.0)
    residuals = [np.broadcast_to(slow, g.data.shape).astype(complex) for g in problem.groups]
    nothing = np.zeros(directions.layout.size)
    noise, error = (directions.correlation(residuals, nothing, reduced) for reduced in (0.8, 1e6))
    responses = sum(g.data.shape[0] * g.data.shape[1] for g in problem.groups)
    assert noise > 2.0
    assert error - 1.0 == pytest.approx(responses * (noise - 1.0), rel=1e-3)


def test_a_record_of_another_session_is_judged_with_the_drift_it_may_have() -> None:
    structure = example_structure()
    *known, last = entries(structure, 5e-3, seed=4)
    records = Records(tuple(known))
    fitted = fit(structure, records, Hypothesis())
    problem = Problem(structure, records.merged, Hypothesis())
    judged = cross_validation.judged(
        last, cross_validation.predicted(last, fitted.model, 0.0, problem, fitted.x), problem, fitted
    )
    plain = cross_validation.judged(last, cross_validation.predicted(last, fitted.model, 0.0, problem, fitted.x))
    assert np.all(plain.chi2 > 3.0)
    assert np.all(judged.chi2 < 2.0)


@pytest.mark.parametrize(("error", "gains"), [(0.01, True), (0.0, False)])
def test_the_corrected_model_is_the_closest_without_its_discrepancy(error: float, gains: bool) -> None:
    """A stiffness that rises with log frequency: where nobody adds the discrepancy, a mean stiffness serves best."""
    structure = example_structure()
    # The stiffness of each mode by itself would follow it.
    structure.system.__dict__["parts"] = ()
    structure = replace(structure, parts=())
    rng = np.random.default_rng(2)
    rising = np.stack(
        [response(structure, 1.0 + error * np.log(f / FREQ[0]))[:, i] for i, f in enumerate(FREQ)], axis=-1
    )
    found = []
    for i in range(3):
        variance = np.full(rising.shape, 1.0) * (1e-3 * np.abs(rising).max(axis=1, keepdims=True)) ** 2
        noise = np.sqrt(variance / 2) * (rng.standard_normal(rising.shape) + 1j * rng.standard_normal(rising.shape))
        found.append(
            entry_of(i, None, 1.0, rising + noise, variance, FREQ, ("y", "a"), ("displacement", "acceleration"))
        )
    records = Records(tuple(found))
    fitted = fit(structure, records, Hypothesis())
    problem = Problem(structure, records.merged, Hypothesis())
    posterior, closest = (problem.residuals(x)[2] for x in (fitted.x, fitted.corrected.x))
    # Where there is no discrepancy both are the same within what noise leaves open.
    assert (closest < 0.5 * posterior) if gains else 0.98 * posterior < closest <= posterior
    start = problem.prior_precision()
    heat = max(posterior / fitted.count, 1.0)
    best = optimize.minimize(lambda x: problem.residuals(x)[2] / heat + start @ x**2, fitted.x, method="Nelder-Mead")
    least = problem.residuals(best.x)[2]
    assert closest < (1.1 if gains else 1.001) * least


@pytest.mark.parametrize("merged_by_position", [True, False])
def test_what_hits_do_is_no_discrepancy(merged_by_position: bool) -> None:
    """Each record is off by a part of another response, as long as its blows say: no drift and no error of the model."""
    structure, rng = example_structure(), np.random.default_rng(5)
    steady = [replace(e, session="one" if merged_by_position else str(e.record)) for e in entries(structure, 0.0)]
    beside = 0.05 * response(structure, 0.8)
    struck = [
        replace(
            e.showing(e.data + rng.standard_normal() * beside),
            hits={("hit", e.record, 0): beside.astype(np.complex128)},
        )
        for e in steady
    ]
    known = fit(structure, Records(tuple(struck)), Hypothesis())
    blind = fit(structure, Records(tuple(replace(e, hits={}) for e in struck)), Hypothesis())
    assert known.reduced < 1.1
    assert known.spread.sizes.nominal < 1e-3
    assert known.spread.sizes.drift <= 1e-3
    assert known.log_evidence - blind.log_evidence > 100.0
    assert len(known.spread.layout.hits) == len(struck)


class Dense:
    """
    Two records as one Gaussian vector: covariance of tuning, drift, discrepancy and noise, nothing factored.

    Derivatives are differences of `response`; the discrepancy is the full process over frequency.
    """

    def __init__(self, structure: Structure, x: np.ndarray, sizes: Sizes) -> None:
        t = structure.tolerance
        parts = structure.system.parts
        of_part = [(t.stiffness, sizes.parts) if part.power == 0 else (t.damping, sizes.losses) for part in parts]
        tolerance = np.array([t.mass, t.damping, t.stiffness, *(own for own, _ in of_part)])
        self.here = np.exp(tolerance * x)
        by = []
        for i in range(x.size):
            up, down = (self.shown(structure, self.here * (1 + h * (np.arange(x.size) == i))) for h in (1e-6, -1e-6))
            by.append((up - down) / 2e-6)
        self.plain = self.shown(structure, self.here)
        # Tuning by its tolerances, errors of parts by their size in them, about where it was found.
        size = np.array([1.0, 1.0, 1.0, *(own for _, own in of_part)])
        self.x = x / size
        self.tuning = [own * row for own, row in zip(size * tolerance, by, strict=True)]
        # Damping drifts by as many tolerances as the stiffness, single modes by half of it.
        self.drift = [sizes.drift * by[2], sizes.drift * t.damping / t.stiffness * by[1]]
        self.drift += [
            0.5 * sizes.drift * tolerance[3 + i] / t.stiffness * by[3 + i]
            for i, part in enumerate(parts)
            if part.modes[0] == part.modes[1]
        ]
        for channel in range(2):
            alone = sizes.drift * self.plain * (np.arange(2) == channel)[:, None]
            self.drift += [alone, 1j * alone]
        u = np.log(FREQ)
        factor = np.linalg.cholesky(
            np.exp(-0.5 * ((u[:, None] - u) / SETTINGS.discrepancy_length) ** 2) + 1e-10 * np.eye(u.size)
        )
        self.wrong = [part * sizes.nominal * by[2] * shape for shape in factor.T for part in (1.0, 1j)]

    @staticmethod
    def shown(structure: Structure, here: np.ndarray) -> np.ndarray:
        m, c, k = here[:3]
        return response(structure, k, m=m, c=c, parts=here[3:].tolist())

    def left(self, known: Entry, other: Entry, same_session: bool) -> np.ndarray:
        """χ² per datum of each channel of one record, given the other."""

        def flat(rows: list[np.ndarray]) -> np.ndarray:
            return np.array([np.concatenate([r.real.ravel(), r.imag.ravel()]) for r in rows])

        shared, drift = flat([*self.tuning, *self.wrong]), flat(self.drift)
        mean = -self.x @ flat(self.tuning)
        both = shared.T @ shared
        own = both + drift.T @ drift
        noise = np.diag(flat([known.variance / 2 + 0j])[0] + np.append(np.zeros(known.data.size), known.variance / 2))
        first = own + noise
        cross = own if same_session else both
        gain = cross @ np.linalg.inv(first)
        r_known, r_other = (flat([e.data - self.plain])[0] for e in (known, other))
        left = r_other - mean - gain @ (r_known - mean)
        covariance = own + noise - gain @ cross.T
        out = []
        for channel in range(2):
            at = np.flatnonzero(np.tile(np.repeat(np.arange(2) == channel, FREQ.size), 2))
            out.append(left[at] @ np.linalg.solve(covariance[np.ix_(at, at)], left[at]) / at.size)
        return np.array(out)


@pytest.mark.parametrize("session", ["first", "second"])
@pytest.mark.parametrize("drift", [1e-4, 1e-3])
def test_a_held_out_record_is_judged_by_its_dense_conditional(drift: float, session: str) -> None:
    plain = example_structure()
    # Damped, and moved by little beside a resonance's width: the algebra is linear.
    damped = replace(plain.system, damping=10.0 * plain.system.damping)
    structure = replace(plain, system=damped, tolerance=replace(plain.tolerance, calibration=0.0, drift=drift))
    known, other = (replace(e, session="first") for e in entries(structure, 2e-4, seed=3, count=2))
    other = replace(other, session=session)
    records = Records((known,))
    fitted = fit(structure, records, Hypothesis())
    problem = Problem(structure, records.merged, Hypothesis())
    shown = cross_validation.predicted(other, fitted.model, 0.0, problem, fitted.x)
    found = cross_validation.judged(other, shown, problem, fitted).chi2
    dense = Dense(structure, fitted.x, fitted.spread.sizes)
    np.testing.assert_allclose(found, dense.left(known, other, session == "first"), rtol=0.02)
    # Neither noise alone nor another session's knowledge would say that.
    assert np.all(np.abs(cross_validation.judged(other, shown).chi2 / found - 1) > 0.1)
    assert np.all(np.abs(dense.left(known, other, session != "first") / found - 1) > 0.1)


def test_directions_that_are_the_same_are_factored() -> None:
    """Two columns that rounding tells apart, if anything: the normal matrix is singular, and the solution shares between them."""
    one = np.random.default_rng(4).standard_normal(200)
    rows = np.stack([1e8 * one, 1e8 * one * (1 + 1e-16), np.roll(one, 1)])
    matrix = rows @ rows.T
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(matrix - 1e-3 * np.eye(3))
    right = rows @ (3.0 * one)
    found = Factored(matrix - 1e-3 * np.eye(3)).solved(right)
    assert rows.T @ found == pytest.approx(3.0 * one, abs=1e-3)


def test_what_is_held_at_zero_takes_no_part_of_the_gain():
    rng = np.random.default_rng(4)
    rows, size = rng.standard_normal((30, 12)), 10.0 ** rng.uniform(-3, 3, 12)
    matrix, right = rows.T @ rows * np.outer(size, size), rng.standard_normal(12) * size
    held = np.array([0, 5, 11])
    free = np.setdiff1d(np.arange(12), held)
    expected = right[free] @ np.linalg.solve(matrix[np.ix_(free, free)], right[free])
    assert Factored(matrix).gain(right, held) == pytest.approx(expected, rel=1e-9)
    assert Factored(matrix).gain(right) == pytest.approx(right @ np.linalg.solve(matrix, right), rel=1e-9)
