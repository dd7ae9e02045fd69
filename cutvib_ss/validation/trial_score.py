"""From sealed trials to their score: open the seal, read what was said, try the corrected models on fresh records."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cutvib_ss.validation.achieved import with_achieved
from cutvib_ss.validation.cases import Case, read_cases
from cutvib_ss.validation.files import read_json
from cutvib_ss.validation.measured import MeasuredRow
from cutvib_ss.validation.score import Score, scored
from cutvib_ss.validation.seal import SealError, Trial, open_seal, opened


def score_trials(folders: Sequence[Path], jobs: int = 1, measured: Sequence[MeasuredRow] = ()) -> Score:
    """Score a trial, opening its seal where that is still closed; or several opened trials of one code, as one."""
    trials = [Trial(folder) for folder in folders]
    secrets = [open_seal(trials[0])] if len(trials) == 1 else [opened(trial) for trial in trials]
    codes = {str(read_json(trial.commitment)["code_sha256"]) for trial in trials}
    if len(codes) > 1:
        told = ", ".join(str(f) for f in folders)
        raise SealError(f"{told}: were diagnosed by different code; score each by itself")
    cases: list[Case] = []
    for trial, secret in zip(trials, secrets, strict=True):
        cases += with_achieved(trial, read_cases(trial, secret["labels"]), jobs)
    first, *others = [_about(trial, secret) for trial, secret in zip(trials, secrets, strict=True)]
    return scored(cases, {**first, "with": others} if others else first, measured)


def _about(trial: Trial, secret: dict[str, Any]) -> dict[str, Any]:
    commitment, opening = read_json(trial.commitment), read_json(trial.opening)
    return {
        "folder": trial.folder.resolve().name,
        "sealed": commitment["sealed"],
        "opened": opening["opened"],
        "version": commitment["version"],
        "commit": commitment["commit"],
        "code_sha256": commitment["code_sha256"],
        "labels_sha256": commitment["labels_sha256"],
        "settings": secret["settings"],
    }
