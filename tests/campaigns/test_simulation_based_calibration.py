"""
Simulation-based calibration: machines drawn from the stated priors, fitted, and the posterior held against what was drawn.

Talts, Betancourt, Simpson, Vehtari and Gelman, "Validating Bayesian inference algorithms with simulation-based calibration",
2018: over draws from the prior the rank of the truth in its posterior is uniform. The machines are two masses on springs, computed
here with dense matrices; their stiffness drifts between sessions.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.unknowns import to_unknown
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.parameters import StructureTolerances
from tests.unit.record_example import entry_of

pytestmark = pytest.mark.slow

FREQ = np.linspace(25.0, 110.0, 86)
COUNT = 60
SESSIONS, DRIFT, NOISE = 4, 0.004, 0.02
MASS = np.diag([2.0, 1.0])
STIFFNESS = np.array([[3e5, -1e5], [-1e5, 1e5]])
DAMPING = 2e-4 * STIFFNESS
TOLERANCE = {"mass": 0.01, "damping": 0.1, "stiffness": 0.01, "calibration": 0.005, "drift": DRIFT}


def nominal():
    ports = {"drive": np.array([1.0, 0.0]), "tip": np.array([0.0, 1.0])}
    channels = {"y1": Channel("drive", "acceleration"), "y2": Channel("tip", "acceleration")}
    system = SecondOrder(MASS, DAMPING, STIFFNESS, ("x1", "x2"), ports)
    return Structure(system, channels, "drive", tolerance=StructureTolerances(**TOLERANCE))


def drawn(rng, mass=0.0, stiffness=0.0, damping=0.0):
    """Records of a machine whose values, drifts and gains are drawn from the priors, with something on its tip."""
    scale = np.exp([TOLERANCE[n] * rng.standard_normal() for n in ("mass", "damping", "stiffness")])
    gains = 1.0 + TOLERANCE["calibration"] * (rng.standard_normal(2) + 1j * rng.standard_normal(2)) / np.sqrt(2)
    entries = []
    for k in range(SESSIONS):
        z = rng.standard_normal()
        drift = np.exp(DRIFT * z), np.exp(DRIFT * rng.standard_normal() * TOLERANCE["damping"] / TOLERANCE["stiffness"])
        on_tip = np.diag([0.0, 1.0])
        s = 2j * np.pi * FREQ[:, None, None]
        dynamic = (
            s**2 * (scale[0] * MASS + mass * on_tip)
            + s * (scale[1] * drift[1] * DAMPING + damping * on_tip)
            + scale[2] * drift[0] * STIFFNESS + stiffness * on_tip
        )  # fmt: skip
        shown = (s[:, 0, 0] ** 2 * np.linalg.solve(dynamic, np.array([1.0, 0.0])[None, :, None])[:, :, 0].T) * gains[
            :, None
        ]
        shown = shown * (1.0 + DRIFT * rng.standard_normal((2, 1)))
        std = NOISE * np.median(np.abs(shown), axis=1, keepdims=True) * np.ones(shown.shape)
        noise = std / np.sqrt(2) * (rng.standard_normal(shown.shape) + 1j * rng.standard_normal(shown.shape))
        entries.append(
            entry_of(k, None, 1.0, shown + noise, std**2, FREQ, ("y1", "y2"), ("acceleration",) * 2, blow_at=0.0)
        )
    return Records(tuple(entries))


def best(model, records, starts):
    return max((fit(model, records, Hypothesis(tuple(s))) for s in starts), key=lambda f: f.log_evidence)


def test_ranks_of_a_size_are_uniform():
    model, rng, ranks = nominal(), np.random.default_rng(11), []
    own = AddedMass.ranges(model, "tip")["mass"]
    for _ in range(COUNT):
        value = own.at(rng.uniform(0.3, 0.7))
        found = best(model, drawn(rng, mass=value), [(AddedMass("tip", own.at(u)),) for u in (0.4, 0.6)])
        x = found.x[found.first_effect]
        std = np.sqrt(found.covariance[found.first_effect, found.first_effect])
        ranks.append(stats.norm.cdf((to_unknown(value, own) - x) / std))
    assert stats.kstest(ranks, "uniform").pvalue > 0.01


def test_probabilities_come_true():
    model, rng = nominal(), np.random.default_rng(12)
    mass, contact = AddedMass.ranges(model, "tip")["mass"], ToolContact.ranges(model, "tip")
    hits, stated = [], []
    for _ in range(COUNT):
        kind = rng.integers(3)
        values = {}
        if kind == 1:
            values = {"mass": mass.at(rng.uniform())}
        elif kind == 2:
            values = {n: r.at(rng.uniform()) for n, r in contact.items()}
        records = drawn(rng, **values)
        masses = [(AddedMass("tip", mass.at(u)),) for u in (0.4, 0.6, 0.8, 0.95)]
        contacts = [(ToolContact("tip", *(r.at(u) for r in contact.values())),) for u in (0.2, 0.5, 0.8, 0.95)]
        evidence = np.array([best(model, records, starts).log_evidence for starts in ([()], masses, contacts)])
        p = np.exp(evidence - evidence.max())
        p /= p.sum()
        hits.append(float(np.argmax(p) == kind))
        stated.append(float(p.max()))
    hits, stated = np.array(hits), np.array(stated)
    # As many right as was stated, within three standard deviations of what chance would show.
    assert abs(np.sum(hits - stated)) < 3.0 * np.sqrt(np.sum(stated * (1.0 - stated))) + 0.5
