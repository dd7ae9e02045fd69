"""
How far the gap really shrank: the corrected model against records of the same machine that the diagnosis never had.

They are at other positions, with hardly any noise and no calibration errors: what a user of the corrected model will meet.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from cutvib_ss.diagnosis.cross_validation import predicted
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.records import Entry
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Model
from cutvib_ss.measurement.campaign import read_campaign
from cutvib_ss.model_files import read_machine
from cutvib_ss.validation.cases import Case
from cutvib_ss.validation.files import digest, read_json, unpack, write_json
from cutvib_ss.validation.seal import SealError, Trial


def with_achieved(trial: Trial, cases: Sequence[Case], jobs: int = 1) -> tuple[Case, ...]:
    """Cases with what their corrected models achieve; kept in the trial's folder, so that a second call is quick."""
    kept = trial.folder / "achieved.json"
    known: dict[str, float] = read_json(kept) if kept.is_file() else {}
    able = [
        c for c in cases if c.name not in known and trial.fresh(c.name).is_file() and trial.machine(c.name).is_file()
    ]
    for case in able:
        if digest(trial.fresh(case.name).read_bytes()) != case.truth.label["fresh_sha256"]:
            raise SealError(f"{trial.fresh(case.name)}: are not the records that were committed to; the trial is void")
    if able:
        names = [c.name for c in able]
        with Workers(jobs) as workers:
            known |= dict(zip(names, workers.map(partial(closed, trial), names), strict=True))
        write_json(kept, known)
    return tuple(replace(c, achieved=known.get(c.name, float("nan"))) for c in cases)


def closed(trial: Trial, name: str) -> float:
    """
    Part of the nominal model's error that one corrected model closes.

    The mean modulus of the error over records, channels and the lines of the diagnosis' band, as in the diagnosis.
    """
    low, high = read_json(trial.diagnosis(name))["gap"]["band_hz"]
    corrected = read_machine(trial.machine(name))
    with tempfile.TemporaryDirectory(prefix="cutvib-") as folder:
        unpack(trial.fresh(name).read_bytes(), Path(folder) / "fresh")
        campaign = read_campaign(Path(folder) / "fresh")
    nominal: Model = campaign.machine
    entries = observe(campaign, nominal).entries

    def error(model: Model) -> float:
        return float(np.mean([_error(e, model, low, high) for e in entries]))

    return 1.0 - error(corrected) / error(nominal)


def _error(e: Entry, model: Model, low: float, high: float) -> float:
    lines = (e.freq >= low) & (e.freq <= high)
    return float(np.mean(np.abs(predicted(e, model, 0.0).data - e.data)[:, lines]))
