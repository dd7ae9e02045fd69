"""What the fits of an opened trial's diagnoses said, beside what was true."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cutvib_ss.blind.cases import NONE, UNKNOWN, Causes, causes_of, truth_of
from cutvib_ss.blind.files import read_json
from cutvib_ss.blind.seal import Trial
from cutvib_ss.effects.catalogue import is_alias
from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.gap.calibration import Calibration, Evidence, posterior

HARDLY = 0.5
"""Gap over noise below which a cause outside the catalogue is not looked for."""


@dataclass(frozen=True)
class CaseEvidence:
    """
    One case: what the fits said, and what was true.

    Parameters
    ----------
    name : str
        The case.
    truth : frozenset of (effect, place)
        What a right answer names.
    named : mapping of str to frozenset
        What each candidate names.
    evidence : Evidence
        What the fits said.
    """

    name: str
    truth: Causes
    named: Mapping[str, Causes]
    evidence: Evidence


@dataclass(frozen=True)
class TrialEvidence:
    """
    The evidence of an opened trial.

    Parameters
    ----------
    folder : str
        Name of its folder.
    settings : dict
        Cases, seed, mix and severity.
    code_sha256 : str
        Hash of the code that diagnosed.
    cases : tuple of CaseEvidence
        Its cases that were diagnosed.
    """

    folder: str
    settings: Mapping[str, Any]
    code_sha256: str
    cases: tuple[CaseEvidence, ...]


def read_evidence(folder: Path) -> TrialEvidence:
    """
    The evidence of a trial that has been opened.

    Parameters
    ----------
    folder : Path
        The trial's folder.

    Returns
    -------
    TrialEvidence
        Its diagnosed cases, but for those outside the catalogue that hardly show: none of them could be told from no gap.

    Raises
    ------
    ParameterError
        If the trial is still sealed.
    DataFormatError
        If its diagnoses hold no evidence.
    """
    trial = Trial(folder)
    if not trial.labels.is_file():
        raise ParameterError(
            f"{folder}: the seal of this trial is not open; score it first: cutvib blind score {folder}"
        )
    opened, commitment = read_json(trial.labels), read_json(trial.commitment)
    cases = [
        case_evidence(name, label, read_json(trial.diagnosis(name)))
        for name, label in sorted(opened["labels"].items())
        if trial.diagnosis(name).is_file() and shows(label)
    ]
    return TrialEvidence(folder.resolve().name, opened["settings"], commitment["code_sha256"], tuple(cases))


def shows(label: Mapping[str, Any]) -> bool:
    """
    Whether a case says anything of "unknown": a cause outside the catalogue whose gap is lost in the noise does not.

    Parameters
    ----------
    label : mapping
        The case's label.

    Returns
    -------
    bool
        False for causes outside the catalogue of less than `HARDLY` of the noise.
    """
    return label.get("kind") != "outside" or float(label.get("gap_sigma") or 0.0) >= HARDLY


def case_evidence(name: str, label: Mapping[str, Any], diagnosis: Mapping[str, Any]) -> CaseEvidence:
    """
    The evidence of a case.

    Parameters
    ----------
    name : str
        The case.
    label : dict
        Of the rig.
    diagnosis : dict
        JSON of ``cutvib diagnose``, with its ``evidence``.

    Returns
    -------
    CaseEvidence
        The evidence.

    Raises
    ------
    DataFormatError
        If the diagnosis holds none.
    """
    kept = diagnosis.get("evidence")
    if kept is None:
        raise DataFormatError(f"{name}: its diagnosis holds no evidence; it was made by a version that kept none")
    rows = kept["candidates"]
    named = {
        r["name"]: NONE if r["effect"] == "none" else causes_of(r["effect"], r["place"], r.get("parameters") or {})
        for r in rows
    }
    evidence = Evidence(
        log_evidence={r["name"]: float(r["log_evidence"]) for r in rows},
        causes={n: 0 if c == NONE else len(c) for n, c in named.items()},
        reduced=float(kept["reduced_chi2"]),
        held={
            r["name"]: np.inf if r["held_reduced_chi2"] is None else float(r["held_reduced_chi2"])
            for r in rows
            if r.get("judged", r["held_reduced_chi2"] is not None)
        },
        unspecific=frozenset(r["name"] for r in rows if r.get("unspecific", _is_alias(r))),
    )
    return CaseEvidence(name, truth_of(label).causes, named, evidence)


def _is_alias(row: Mapping[str, Any]) -> bool:
    # Diagnoses of before that was told.
    return is_alias(row["effect"], row.get("parameters") or {})


def stated(case: CaseEvidence, numbers: Calibration) -> dict[Causes, float]:
    """
    Probabilities by what is named, equivalent candidates together.

    Parameters
    ----------
    case : CaseEvidence
        The case.
    numbers : Calibration
        The scales.

    Returns
    -------
    dict
        Probability of each answer.
    """
    out: dict[Causes, float] = {}
    for name, p in posterior(case.evidence, numbers).items():
        answer = UNKNOWN if name == "unknown" else case.named[name]
        out[answer] = out.get(answer, 0.0) + p
    return out
