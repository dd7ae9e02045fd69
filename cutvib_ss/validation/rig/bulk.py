"""
Campaigns of the virtual machine in bulk, to calibrate on: ``python -m cutvib_ss.validation.rig --cases N --seed S --out DIR``.

Writes folders c0001, c0002, … and labels.json; what is complete already is kept.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Collection
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from cutvib_ss.validation.rig.cases import CAUSES, OUTSIDE_KINDS, TRAITS, Kind, draw_case, write_campaign

_SHARES: dict[Kind, float] = {"none": 0.3, "single": 0.5, "outside": 0.1, "pair": 0.1}


def plan(cases: int, seed: int, shares: dict[Kind, float]) -> list[tuple[int, Kind, str | None]]:
    """Seed, kind and cause of every case; causes and outside kinds come in turn, so that all are there alike."""
    rng = np.random.default_rng(seed)
    kinds = list(shares)
    weights = np.array([shares[kind] for kind in kinds])
    count = dict.fromkeys(kinds, 0)
    turns = {"single": list(rng.permutation(CAUSES)), "outside": list(rng.permutation(OUTSIDE_KINDS))}
    planned: list[tuple[int, Kind, str | None]] = []
    for i in range(cases):
        lag = weights / weights.sum() * (i + 1) - np.array([count[kind] for kind in kinds])
        kind = kinds[int(np.argmax(lag))]
        turn = turns.get(kind)
        cause = str(turn[count[kind] % len(turn)]) if turn else None
        count[kind] += 1
        planned.append((int(rng.integers(2**31)), kind, cause))
    return planned


def make(
    folder: Path,
    seed: int,
    kind: Kind,
    cause: str | None,
    severity: tuple[float, float],
    traits: Collection[str] = (),
) -> dict[str, Any]:
    """Write one case; a complete folder is left as it is."""
    kept = folder.with_suffix(".label.json")
    if kept.is_file():
        label: dict[str, Any] = json.loads(kept.read_text())
        return label
    case = draw_case(seed, kind, cause, severity, traits=traits)
    write_campaign(case, folder)
    label = case.label | {"seed": seed}
    kept.write_text(json.dumps(label))
    return label


def main(arguments: list[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m cutvib_ss.validation.rig", description=__doc__)
    parser.add_argument("--cases", type=int, required=True, help="how many campaigns")
    parser.add_argument("--seed", type=int, required=True, help="everything follows from it")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--severity", type=float, nargs=2, default=(0.3, 2.0), metavar=("FROM", "TO"))
    parser.add_argument(
        "--traits", nargs="*", default=(), choices=TRAITS, help="what every case shall have beside its cause"
    )
    for kind, share in _SHARES.items():
        parser.add_argument(f"--{kind}", type=float, default=share, metavar="SHARE", help=f"share of {kind} cases")
    parser.add_argument("--cause", help="only this cause of the catalogue, or outside kind")
    a = parser.parse_args(arguments)
    shares: dict[Kind, float] = {kind: getattr(a, kind) for kind in _SHARES}
    planned = plan(a.cases, a.seed, shares)
    if a.cause:
        given: Kind = "outside" if a.cause in OUTSIDE_KINDS else "pair" if "+" in a.cause else "single"
        planned = [(seed, given, a.cause) for seed, _, _ in planned]
    a.out.mkdir(parents=True, exist_ok=True)
    labels: dict[str, Any] = {}
    names = [f"c{i:04d}" for i in range(1, len(planned) + 1)]
    with ProcessPoolExecutor(a.jobs, mp_context=get_context("spawn")) as pool:
        jobs = {
            pool.submit(make, a.out / name, *case, tuple(a.severity), tuple(a.traits)): name
            for name, case in zip(names, planned, strict=True)
        }
        for done, job in enumerate(as_completed(jobs), start=1):
            labels[jobs[job]] = job.result()
            sys.stderr.write(f"{done}/{len(jobs)} {jobs[job]}\n")
    ordered = {name: labels[name] for name in names}
    (a.out / "labels.json").write_text(json.dumps(ordered, indent=1) + "\n", encoding="utf-8")
