"""
Simpler methods in the same trial, so that its figures mean something.

Nearest signature
    The campaigns of other, opened trials whose errors look most alike name the cause.
Classifier
    A random forest on features of the campaigns, trained on the same.

They know the cutting machine only: campaigns on other structures they leave without an answer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import TypeAlias

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.results import FloatArray
from cutvib_ss.validation.cases import NONE, UNKNOWN, Answer, Case, Causes, Entry, read_cases
from cutvib_ss.validation.features import CHANNELS, SIGNATURE, features
from cutvib_ss.validation.files import read_json
from cutvib_ss.validation.rows import rows
from cutvib_ss.validation.score import Score
from cutvib_ss.validation.seal import Trial

Odds: TypeAlias = Mapping[Causes, float]

NEIGHBOURS = 5
"""Campaigns that vote in the lookup."""
TREES = 400
SET, SURE = 0.95, 0.9
"""Probability that the set of answers carries, and from which one answer is given alone: as in the diagnosis."""


def with_baselines(score: Score, folders: Sequence[Path], train: Sequence[Path], jobs: int = 1) -> Score:
    """A score with the figures of the simpler methods beside it."""
    for other in train:
        if not Trial(other).labels.is_file():
            raise ParameterError(
                f"{other}: the seal of this trial is not open; score it first: cutvib blind score {other}"
            )
        if other.resolve() in {folder.resolve() for folder in folders}:
            raise ParameterError(f"{other}: is the trial to be scored; the baselines must learn from another")
    known = [
        (Trial(other).campaigns / c.name, c.truth.causes)
        for other in train
        for c in read_cases(Trial(other), read_json(Trial(other).labels)["labels"])
    ]
    trials = [Trial(folder) for folder in folders]
    campaigns = [t.campaigns / c.name for c in score.cases for t in trials if (t.campaigns / c.name).is_dir()]
    folders_of = [*(k for k, _ in known), *campaigns]
    if jobs == 1:
        seen = [seen_as(folder) for folder in folders_of]
    else:
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
            seen = list(pool.map(seen_as, folders_of))
    learning = [(x, t) for x, (_, t) in zip(seen, known, strict=False) if x is not None]
    learnt, truths = np.array([x for x, _ in learning]), [t for _, t in learning]
    asked = seen[len(known) :]
    able = np.array([x for x in asked if x is not None])
    found: dict[str, list[Odds]] = {}
    for name, method in (("nearest signature", nearest_signature), ("classifier", forest)):
        odds = iter(method(learnt, truths, able))
        found[name] = [{} if x is None else next(odds) for x in asked]
    return replace(score, baselines={name: rows(answered(score.cases, odds)) for name, odds in found.items()})


def seen_as(campaign: Path) -> FloatArray | None:
    """Features of a campaign; None where it is of another structure."""
    try:
        return features(campaign)
    except ParameterError:
        return None


def answered(cases: Sequence[Case], odds: Sequence[Odds]) -> tuple[Case, ...]:
    """Cases with the answers of another method."""
    # They correct no model: nothing is closed.
    return tuple(replace(c, answer=answer(o), run={}, achieved=np.nan) for c, o in zip(cases, odds, strict=True))


def answer(odds: Odds) -> Answer:
    """Probabilities as the diagnosis would give them."""
    ranked = sorted(odds.items(), key=lambda item: -item[1])
    if not ranked:
        return Answer("failed", (), frozenset(), frozenset(), {})
    first, p = ranked[0]
    total = np.cumsum([q for _, q in ranked])
    likely = ranked[: int(np.searchsorted(total, SET - 1e-9)) + 1]
    verdict = {NONE: "no_gap", UNKNOWN: "unknown"}.get(first, "explained" if p >= SURE else "ambiguous")
    places = frozenset(place for _, place in first)
    return Answer(verdict, tuple(Entry(c, q, np.nan) for c, q in ranked), frozenset(c for c, _ in likely), places, {})


def nearest_signature(learnt: FloatArray, truths: Sequence[Causes], asked: FloatArray) -> list[Odds]:
    """The causes of the campaigns whose errors look most alike, in shape and whatever their size."""
    mean, spread_of = learnt.mean(axis=0), learnt.std(axis=0) + 1e-9
    # Of each channel its signature alone.
    width = learnt.shape[1] // len(CHANNELS)
    used = np.concatenate([np.arange(SIGNATURE) + k * width for k in range(len(CHANNELS))])

    def directions(x: FloatArray) -> FloatArray:
        scaled = ((x - mean) / spread_of)[:, used]
        return np.asarray(scaled / (np.linalg.norm(scaled, axis=1, keepdims=True) + 1e-12))

    alike = directions(asked) @ directions(learnt).T
    out: list[Odds] = []
    for row in alike:
        near = np.argsort(-row, kind="stable")[:NEIGHBOURS]
        weight = np.exp(10.0 * (row[near] - row[near[0]]))
        votes: dict[Causes, float] = {}
        for k, w in zip(near, weight / weight.sum(), strict=True):
            votes[truths[k]] = votes.get(truths[k], 0.0) + float(w)
        out.append(votes)
    return out


def forest(learnt: FloatArray, truths: Sequence[Causes], asked: FloatArray) -> list[Odds]:
    """A random forest's votes."""
    try:
        ensemble = import_module("sklearn.ensemble")
    except ImportError:
        raise ParameterError('the classifier needs scikit-learn: pip install "cutvib_ss[trial]"') from None
    names = list(dict.fromkeys(truths))
    trees = ensemble.RandomForestClassifier(TREES, min_samples_leaf=2, random_state=0)
    trees.fit(learnt, [names.index(t) for t in truths])
    votes = trees.predict_proba(asked)
    return [{names[k]: float(p) for k, p in zip(trees.classes_, row, strict=True) if p > 0} for row in votes]
