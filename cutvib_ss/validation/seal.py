"""
The seal: labels are fixed before any diagnosis runs, and are looked at once.

A trial lies in two folders. `DIR` holds campaigns and diagnoses; it can be handed to anyone. `DIR.sealed` beside it holds the
labels and a random salt. What is published before the first diagnosis, in `DIR/commitment.json`, is the SHA-256 of salt and
labels, and that of the package's code: neither can be changed afterwards unnoticed, and without the salt no guess at the labels
can be checked.
"""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from cutvib_ss.errors import CutvibError
from cutvib_ss.validation.files import PACKAGE, canonical, code_hash, digest, now, read_json, write_json

COMMITMENT_SCHEMA = "cutvib-blind-commitment/1"
OPENING_SCHEMA = "cutvib-blind-opening/1"


class SealError(CutvibError):
    """A trial cannot be scored, or go on, without the seal losing its meaning."""


@dataclass(frozen=True)
class Trial:
    """Where the parts of a trial lie."""

    folder: Path  # Its folder, DIR

    @property
    def campaigns(self) -> Path:
        """Folder of the campaigns, a folder each."""
        return self.folder / "campaigns"

    @property
    def diagnoses(self) -> Path:
        """Folder of the diagnoses."""
        return self.folder / "diagnoses"

    @property
    def commitment(self) -> Path:
        """What is published before any diagnosis runs."""
        return self.folder / "commitment.json"

    @property
    def opening(self) -> Path:
        """Record of the opening."""
        return self.folder / "opening.json"

    @property
    def labels(self) -> Path:
        """The labels, once opened."""
        return self.folder / "labels.json"

    @property
    def sealed(self) -> Path:
        """Folder of the labels and the salt, beside the trial's own."""
        resolved = self.folder.resolve()
        return resolved.with_name(resolved.name + ".sealed")

    def diagnosis(self, name: str) -> Path:
        """Where a case's diagnosis goes."""
        return self.diagnoses / f"{name}.json"

    def machine(self, name: str) -> Path:
        """Where a case's corrected model goes."""
        return self.diagnoses / f"{name}.toml"

    def fresh(self, name: str) -> Path:
        """Where the records lie that only the score looks at."""
        return self.sealed / "cases" / f"{name}.tar"

    def run(self, name: str) -> Path:
        """
        Where the record of a case's diagnosis goes: when, how long, by which code; its being there says that the case is done.
        """
        return self.diagnoses / f"{name}.run.json"


def commit(trial: Trial, secret: Mapping[str, Any], salt: bytes, campaigns: Mapping[str, str]) -> None:
    """Seal what must not be known, and publish the commitment."""
    from cutvib_ss import __version__

    write_json(trial.sealed / "labels.json", {"salt": salt.hex(), "secret": secret})
    write_json(
        trial.commitment,
        {
            "schema": COMMITMENT_SCHEMA,
            "sealed": now(),
            "cases": len(campaigns),
            "labels_sha256": labels_hash(secret, salt),
            "code_sha256": code_hash(),
            "version": __version__,
            "commit": _revision(),
            "campaigns_sha256": dict(campaigns),
        },
    )


def _revision() -> str | None:
    """The checkout's commit, marked where files differ from it; None outside a checkout."""
    try:
        told = subprocess.run(
            ["git", "-C", str(PACKAGE), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"],
            capture_output=True, text=True, check=True, timeout=20,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    return told.stdout.strip() or None


def labels_hash(secret: Mapping[str, Any], salt: bytes) -> str:
    """What a commitment says of the labels."""
    return digest(salt + canonical(secret))


def check_code(trial: Trial, what: str) -> dict[str, Any]:
    """The commitment, if the code is still the one that it names."""
    if not trial.commitment.is_file():
        raise SealError(
            f"{trial.folder}: no commitment.json, so no sealed trial; make one with `cutvib blind run --out {trial.folder}`"
        )
    commitment: dict[str, Any] = read_json(trial.commitment)
    current = code_hash()
    if commitment.get("code_sha256") != current:
        raise SealError(
            f"{trial.commitment}: the package's code has changed since the labels were sealed (committed "
            f"{str(commitment.get('code_sha256'))[:12]}, now {current[:12]}): {what} would mix two programs; restore that "
            "code (run trials from a checkout of their own), or run a new trial"
        )
    return commitment


def open_seal(trial: Trial) -> dict[str, Any]:
    """Open the labels, once; later calls find them open and check that nothing was diagnosed since."""
    commitment = check_code(trial, "the score")
    if not trial.labels.is_file():
        _lay_open(trial, commitment)
    return opened(trial)


def _lay_open(trial: Trial, commitment: Mapping[str, Any]) -> None:
    """State when the seal was opened and what was diagnosed by then; copy the labels to where anyone can check them."""
    names = sorted(commitment["campaigns_sha256"])
    if trial.opening.is_file():
        _check_nothing_since(trial, names)
    _check_runs(trial, names, commitment)
    kept = trial.sealed / "labels.json"
    if not kept.is_file():
        raise SealError(f"{kept}: the sealed labels are missing; keep {trial.sealed.name} beside the trial's folder")
    content = read_json(kept)
    _check_labels(content["secret"], bytes.fromhex(content["salt"]), commitment, kept)
    if not trial.opening.is_file():
        write_json(
            trial.opening,
            {
                "schema": OPENING_SCHEMA,
                "opened": now(),
                "opened_ns": time.time_ns(),
                "salt": content["salt"],
                "labels_sha256": commitment["labels_sha256"],
                "code_sha256": commitment["code_sha256"],
                "diagnoses_sha256": {p.name: digest(p.read_bytes()) for p in _diagnosis_files(trial, names)},
            },
        )
    write_json(trial.labels, content["secret"])


def opened(trial: Trial) -> dict[str, Any]:
    """The labels of a trial that has been opened before, by whatever code is installed now."""
    if not (trial.commitment.is_file() and trial.opening.is_file() and trial.labels.is_file()):
        raise SealError(
            f"{trial.folder}: the seal is not open; score it by itself first: cutvib blind score {trial.folder}"
        )
    commitment = read_json(trial.commitment)
    names = sorted(commitment["campaigns_sha256"])
    _check_nothing_since(trial, names)
    _check_runs(trial, names, commitment)
    secret: dict[str, Any] = read_json(trial.labels)
    _check_labels(secret, bytes.fromhex(read_json(trial.opening)["salt"]), commitment, trial.labels)
    return secret


def _check_nothing_since(trial: Trial, names: Iterable[str]) -> None:
    opening = read_json(trial.opening)
    for file in _diagnosis_files(trial, names):
        if file.stat().st_mtime_ns > opening["opened_ns"]:
            raise SealError(
                f"{file}: is newer than the opening of the seal ({opening['opened']}): whoever diagnosed could have known the "
                "labels; run a new trial"
            )
        if digest(file.read_bytes()) != opening["diagnoses_sha256"].get(file.name):
            raise SealError(f"{file}: is not what it was when the seal was opened; restore it, or run a new trial")


def _check_labels(secret: Mapping[str, Any], salt: bytes, commitment: Mapping[str, Any], file: Path) -> None:
    if labels_hash(secret, salt) != commitment["labels_sha256"]:
        raise SealError(f"{file}: these are not the labels that were committed to; the trial is void")


def _check_runs(trial: Trial, names: list[str], commitment: Mapping[str, Any]) -> None:
    missing = [name for name in names if not trial.run(name).is_file()]
    if missing:
        raise SealError(
            f"{trial.folder}: {len(missing)} of {len(names)} cases are not diagnosed yet; the same `cutvib blind run` resumes, "
            "and the seal stays closed until then"
        )
    sealed = datetime.fromisoformat(commitment["sealed"])
    for name in names:
        run = read_json(trial.run(name))
        if datetime.fromisoformat(run["started"]) < sealed:
            raise SealError(f"{trial.run(name)}: was begun before the labels were sealed; the trial is void")
        if run["status"] == "done" and run["code_sha256"] != commitment["code_sha256"]:
            raise SealError(f"{trial.run(name)}: was made by other code than the committed one; run a new trial")
        for file, key in ((trial.diagnosis(name), "diagnosis_sha256"), (trial.machine(name), "machine_sha256")):
            if run[key] is not None and (not file.is_file() or digest(file.read_bytes()) != run[key]):
                raise SealError(f"{file}: is missing or was changed since it was made; run a new trial")


def _diagnosis_files(trial: Trial, names: Iterable[str]) -> list[Path]:
    kinds = (trial.diagnosis, trial.machine, trial.run)
    return [file for name in names for kind in kinds if (file := kind(name)).is_file()]
