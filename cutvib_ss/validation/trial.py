"""
A sealed trial: make the campaigns, seal the labels, diagnose.

Each stage leaves one finished file or folder a case, which appears whole or not at all. So a trial that is interrupted, by whatever
means, goes on where it was when the same command is given again.
"""

from __future__ import annotations

import secrets
import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from cutvib_ss.errors import ParameterError
from cutvib_ss.validation.files import digest, folder_hash, packed, read_json, unpack, write_bytes, write_json
from cutvib_ss.validation.plan import Request, Settings, command_of, neutral_name, requests
from cutvib_ss.validation.seal import SealError, Trial, check_code, commit
from cutvib_ss.validation.workers import Diagnoser, Made, Rig, RigError, diagnosed, rig_case, spread

Progress: TypeAlias = Callable[[str, int, int], None]
"""Told the stage, the cases that are done, and how many there are."""

_TOLD = 200
"""Characters of a reason that are kept."""

REDRAWS = 20
"""Times that a case is drawn anew, with other seeds, where the rig's solver fails."""


@dataclass(frozen=True)
class Tools:
    """What makes and what diagnoses the cases; a test brings its own."""

    rig: Rig  # Makes a case of a request
    # Diagnoses the archive of a campaign; None stands for ``cutvib diagnose`` in a process of its own
    diagnose: Diagnoser | None
    causes: Sequence[str]  # What the rig can make
    outside: Sequence[str]


def package_tools() -> Tools:
    """The package's own rig and diagnosis."""
    try:
        import exudyn  # noqa: F401

        from cutvib_ss.validation.rig import CAUSES, OUTSIDE_KINDS
    except ImportError as error:
        raise ParameterError(f'the rig cannot be loaded ({error}): pip install "cutvib_ss[rig]"') from None
    return Tools(rig_case, None, tuple(CAUSES), tuple(OUTSIDE_KINDS))


def run_trial(
    asked: Settings,
    out: Path,
    tools: Tools,
    jobs: int = 1,
    scheduler: str | None = None,
    timeout: float | None = None,
    progress: Progress = lambda stage, done, total: None,
) -> Trial:
    """Run a trial, or the rest of one."""
    trial = Trial(out)
    salt = _prepared(trial, asked)
    if trial.opening.is_file():
        raise SealError(f"{trial.opening}: the seal of this trial is open; a new trial needs a new folder")
    if not trial.commitment.is_file():
        _make_campaigns(trial, asked, salt, tools, jobs, scheduler, progress)
        _seal(trial, asked, salt)
    commitment = check_code(trial, "going on")
    _diagnose(trial, commitment, tools, jobs, scheduler, timeout, progress)
    return trial


def _prepared(trial: Trial, asked: Settings) -> bytes:
    """The folders, and the trial's secret; a folder that holds another trial, or something else, is refused."""
    kept = trial.sealed / "trial.json"
    if kept.is_file():
        before = read_json(kept)
        if before["settings"] != asked.to_dict():
            raise ParameterError(
                f"{trial.folder}: holds a trial with other settings ({command_of(before['settings'])}); give it again to "
                "resume it, or choose another folder"
            )
        trial.folder.mkdir(parents=True, exist_ok=True)
    else:
        if trial.folder.exists() and (not trial.folder.is_dir() or any(trial.folder.iterdir())):
            raise ParameterError(f"{trial.folder}: is not empty and is no trial of this package; choose another folder")
        try:
            trial.folder.mkdir(parents=True, exist_ok=True)
            trial.sealed.mkdir(mode=0o700, exist_ok=True)
            write_json(kept, {"salt": secrets.token_hex(32), "settings": asked.to_dict()})
        except OSError as error:
            raise ParameterError(f"{trial.folder}: cannot be made ({error.strerror}); choose another folder") from error
    for folder in (trial.campaigns, trial.diagnoses, trial.sealed / "cases"):
        folder.mkdir(exist_ok=True)
    return bytes.fromhex(read_json(kept)["salt"])


def _make_campaigns(
    trial: Trial, asked: Settings, salt: bytes, tools: Tools, jobs: int, scheduler: str | None, progress: Progress
) -> None:
    planned = {neutral_name(salt, k): r for k, r in enumerate(requests(asked, tools.causes, tools.outside))}
    missing = {name: r for name, r in planned.items() if not _is_made(trial, name)}
    done = len(planned) - len(missing)
    progress("campaigns", done, len(planned))
    tasks = ((name, partial(_itself, request)) for name, request in missing.items())
    for name, (made, refused) in spread(partial(_made, tools.rig), tasks, jobs, scheduler):
        # The campaign comes last: its folder says that the case is made.
        fresh = None if made.fresh is None else digest(made.fresh)
        if made.fresh is not None:
            write_bytes(trial.fresh(name), made.fresh)
        label = {**made.label, "redrawn": len(refused), "refused": refused, "fresh_sha256": fresh}
        write_json(trial.sealed / "cases" / f"{name}.json", label)
        unpack(made.campaign, trial.campaigns / name)
        done += 1
        progress("campaigns", done, len(planned))


def _itself(request: Request) -> Request:
    return request


def _is_made(trial: Trial, name: str) -> bool:
    campaign = trial.campaigns / name
    if campaign.is_dir() and not (trial.sealed / "cases" / f"{name}.json").is_file():
        shutil.rmtree(campaign)
    return campaign.is_dir()


def _made(rig: Rig, request: Request) -> tuple[Made, list[str]]:
    """A case, and why others were refused before it: no case is dropped because it is hard to simulate."""
    refused: list[str] = []
    while True:
        try:
            return rig(Request(**{**asdict(request), "seed": request.seed + len(refused)})), refused
        except RigError as error:
            if len(refused) == REDRAWS:
                raise
            refused.append((str(error).strip().splitlines() or [""])[-1][:_TOLD])


def _seal(trial: Trial, asked: Settings, salt: bytes) -> None:
    names = sorted(p.name for p in trial.campaigns.iterdir() if not p.name.startswith("."))
    if len(names) != asked.cases:
        raise SealError(
            f"{trial.campaigns}: {len(names)} campaigns for {asked.cases} cases; something else was put there"
        )
    labels = {name: read_json(trial.sealed / "cases" / f"{name}.json") for name in names}
    secret = {"labels": labels, "settings": asked.to_dict()}
    commit(trial, secret, salt, {name: folder_hash(trial.campaigns / name) for name in names})


def _diagnose(
    trial: Trial,
    commitment: dict[str, Any],
    tools: Tools,
    jobs: int,
    scheduler: str | None,
    timeout: float | None,
    progress: Progress,
) -> None:
    hashes: dict[str, str] = commitment["campaigns_sha256"]
    missing = [name for name in sorted(hashes) if not trial.run(name).is_file()]
    done = len(hashes) - len(missing)
    progress("diagnoses", done, len(hashes))
    forbidden = (str(trial.folder.resolve()), str(trial.sealed))
    work = tools.diagnose or partial(diagnosed, forbidden=forbidden, timeout=timeout)
    tasks = ((name, partial(_campaign, trial, name, hashes[name])) for name in missing)
    for name, outcome in spread(work, tasks, jobs, scheduler):
        if outcome.diagnosis is not None and outcome.code_sha256 != commitment["code_sha256"]:
            raise SealError(
                f"{outcome.host}: diagnosed with other code than the committed one; install the same there, or restore it"
            )
        hashes_of = {}
        for key, file, content in (
            ("diagnosis_sha256", trial.diagnosis(name), outcome.diagnosis),
            ("machine_sha256", trial.machine(name), outcome.machine),
        ):
            hashes_of[key] = None if content is None else digest(content)
            if content is not None:
                write_bytes(file, content)
        # The record comes last: it says that the case is done.
        write_json(trial.run(name), {**outcome.record(), **hashes_of})
        done += 1
        progress("diagnoses", done, len(hashes))


def _campaign(trial: Trial, name: str, committed: str) -> bytes:
    folder = trial.campaigns / name
    if not folder.is_dir() or folder_hash(folder) != committed:
        raise SealError(f"{folder}: is not the campaign that was committed to; restore it, or run a new trial")
    return packed(folder)
