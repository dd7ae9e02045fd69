"""
Simpler methods in the same trial, so that its figures mean something.

Nearest signature
    The campaigns of other, opened trials whose errors look most alike name the cause.
Classifier
    A random forest on features of the campaigns, trained on the same.
Untuned χ²
    Every single cause fitted to the model as given, nothing re-tuned and no calibration error allowed: the least χ² wins.
BIC
    The diagnosis' own tuned fits, weighed by Schwarz's criterion: no held-out records, no "unknown", no calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, fields, replace
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from threadpoolctl import threadpool_limits

from cutvib_ss.blind.cases import NONE, UNKNOWN, Answer, Case, Causes, Entry, causes_of, read_cases
from cutvib_ss.blind.features import CHANNELS, SIGNATURE, features
from cutvib_ss.blind.files import read_json, write_json
from cutvib_ss.blind.rows import rows
from cutvib_ss.blind.score import Score
from cutvib_ss.blind.seal import Trial
from cutvib_ss.errors import CutvibError, ParameterError
from cutvib_ss.gap.candidate_evidence import evidence_of
from cutvib_ss.gap.cause import search
from cutvib_ss.gap.findings import finite_or_none
from cutvib_ss.gap.observations import observe
from cutvib_ss.gap.ranking import COARSE_LINES
from cutvib_ss.gap.records import Records
from cutvib_ss.gap.verdict import SET, SURE
from cutvib_ss.gap.workers import Workers
from cutvib_ss.measurement.campaign import read_campaign
from cutvib_ss.results import FloatArray

Odds: TypeAlias = Mapping[Causes, float]

NEIGHBOURS = 5
"""Campaigns that vote in the lookup."""
TREES = 400
UNTUNED = 1e-6
"""Tolerance of a model that may not be re-tuned."""


def with_baselines(score: Score, folders: Sequence[Path], train: Sequence[Path], jobs: int = 1) -> Score:
    """
    A score with the figures of the simpler methods beside it.

    Parameters
    ----------
    score : Score
        Of one trial, or of several together.
    folders : sequence of Path
        Their folders.
    train : sequence of Path
        Opened trials to learn from.
    jobs : int
        Campaigns at a time.

    Returns
    -------
    Score
        The same, with baselines.

    Raises
    ------
    ParameterError
        If a trial to learn from is sealed or is the same one, or scikit-learn is not installed.
    """
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
    with Workers(jobs) as workers:
        seen = np.array(workers.map(features, [*(k for k, _ in known), *campaigns]))
    learnt, asked, truths = seen[: len(known)], seen[len(known) :], [t for _, t in known]
    found = {
        "nearest signature": nearest_signature(learnt, truths, asked),
        "classifier": forest(learnt, truths, asked),
    }
    if all("evidence" in c.answer.diagnosis for c in score.cases if c.answer.entries):
        found["untuned χ²"] = [least_chi2(d) for d in untuned(campaigns, jobs)]
        found["BIC"] = [bic(c.answer.diagnosis) for c in score.cases]
    return replace(score, baselines={name: rows(answered(score.cases, odds)) for name, odds in found.items()})


def answered(cases: Sequence[Case], odds: Sequence[Odds]) -> tuple[Case, ...]:
    """
    Cases with the answers of another method.

    Parameters
    ----------
    cases : sequence of Case
        The cases.
    odds : sequence of mapping
        Probability of each answer, for each case; empty where the method has none.

    Returns
    -------
    tuple of Case
        The same truths.
    """
    # They correct no model: nothing is closed.
    return tuple(replace(c, answer=answer(o), run={}, achieved=np.nan) for c, o in zip(cases, odds, strict=True))


def answer(odds: Odds) -> Answer:
    """
    Probabilities as the diagnosis would give them.

    Parameters
    ----------
    odds : mapping of frozenset to float
        Probability of each answer.

    Returns
    -------
    Answer
        With a verdict by the diagnosis' own thresholds.
    """
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
    """
    The causes of the campaigns whose errors look most alike, in shape and whatever their size.

    Parameters
    ----------
    learnt : ndarray, shape (campaign, feature)
        Features of labelled campaigns.
    truths : sequence of frozenset
        Their causes.
    asked : ndarray, shape (case, feature)
        Features of the cases.

    Returns
    -------
    list of mapping
        Votes of the nearest, by cosine.
    """
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
    """
    A random forest's votes.

    Parameters
    ----------
    learnt : ndarray, shape (campaign, feature)
        Features of labelled campaigns.
    truths : sequence of frozenset
        Their causes.
    asked : ndarray, shape (case, feature)
        Features of the cases.

    Returns
    -------
    list of mapping
        Share of the trees for each answer.

    Raises
    ------
    ParameterError
        If scikit-learn is not installed.
    """
    try:
        ensemble = import_module("sklearn.ensemble")
    except ImportError:
        raise ParameterError('the classifier needs scikit-learn: pip install "cutvib_ss[trial]"') from None
    names = list(dict.fromkeys(truths))
    trees = ensemble.RandomForestClassifier(TREES, min_samples_leaf=2, random_state=0)
    trees.fit(learnt, [names.index(t) for t in truths])
    votes = trees.predict_proba(asked)
    return [{names[k]: float(p) for k, p in zip(trees.classes_, row, strict=True) if p > 0} for row in votes]


def least_chi2(diagnosis: Mapping[str, Any] | None) -> Odds:
    """
    Probabilities by χ² alone, as if noise were all that separates model and measurement.

    Parameters
    ----------
    diagnosis : dict or None
        JSON with its evidence.

    Returns
    -------
    mapping
        Probability of each answer; empty without a diagnosis.
    """
    return _softmax(diagnosis, lambda row, data: -row["chi2"] / 2)


def bic(diagnosis: Mapping[str, Any] | None) -> Odds:
    """
    Probabilities by Schwarz's criterion, χ² + k ln n.

    Parameters
    ----------
    diagnosis : dict or None
        JSON with its evidence.

    Returns
    -------
    mapping
        Probability of each answer; empty without a diagnosis.
    """
    return _softmax(diagnosis, lambda row, data: -(row["chi2"] + row["unknowns"] * np.log(data)) / 2)


def _softmax(diagnosis: Mapping[str, Any] | None, score: Callable[[Mapping[str, Any], int], float]) -> Odds:
    evidence = (diagnosis or {}).get("evidence")
    if evidence is None:
        return {}
    # What was only bounded on few lines has no χ² on all of them.
    listed = [r for r in evidence["candidates"] if r["chi2"] is not None]
    values = np.array([score(r, evidence["data"]) for r in listed])
    weight = np.exp(values - values.max())
    odds: dict[Causes, float] = {}
    for r, p in zip(listed, weight / weight.sum(), strict=True):
        named = NONE if r["effect"] == "none" else causes_of(r["effect"], r["place"], r.get("parameters") or {})
        odds[named] = odds.get(named, 0.0) + float(p)
    return odds


def untuned(campaigns: Sequence[Path], jobs: int) -> list[Mapping[str, Any]]:
    """
    Fits of linear causes to a model whose values may not move; they are kept, so that a second call is quick.

    Parameters
    ----------
    campaigns : sequence of Path
        The cases' campaigns, each in its trial's folder.
    jobs : int
        At a time.

    Returns
    -------
    list of dict
        The evidence of each case as a diagnosis holds it; without any where it cannot be fitted.
    """
    kept = [c.parent.parent / "baselines" / "untuned" / f"{c.name}.json" for c in campaigns]
    for folder in {file.parent for file in kept}:
        folder.mkdir(parents=True, exist_ok=True)
    missing = [(c, file) for c, file in zip(campaigns, kept, strict=True) if not file.is_file()]
    with Workers(jobs) as workers:
        workers.map(fitted_untuned, [c for c, _ in missing], [file for _, file in missing])
    return [read_json(file) for file in kept]


def fitted_untuned(campaign: Path, out: Path) -> None:
    """
    Fit every linear cause to one campaign with a model whose tolerances are next to nothing.

    Parameters
    ----------
    campaign : Path
        The campaign's folder.
    out : Path
        File for the evidence.
    """
    try:
        measured = read_campaign(campaign)
        given: Any = measured.machine  # of either kind: both have tolerances
        nothing = {f.name: UNTUNED for f in fields(given.tolerance) if f.name != "drift"}
        nominal = replace(given, tolerance=replace(given.tolerance, **nothing))
        observed = observe(measured, nominal)
        with threadpool_limits(1):
            # Few lines, their noise as measured, tell single causes apart as all do, in a third of the time.
            records = Records(observed.entries).coarse(COARSE_LINES, 0.0)
            ranked = search(nominal, records, observed, lambda r: r.reduced, Workers(), pairs=False, laws=False)
    except CutvibError:
        write_json(out, {})
        return
    listed = [asdict(evidence_of(r)) for r in ranked]
    candidates = [{**c, "chi2": finite_or_none(c["chi2"]), "held_reduced_chi2": None} for c in listed]
    write_json(out, {"evidence": {"data": ranked[0].fit.count, "candidates": candidates}})
