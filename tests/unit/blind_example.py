"""A tiny rig and a fake diagnosis for tests of the sealed trial: seconds, no simulation, no diagnosing code."""

import io
import json
import tarfile
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from cutvib_ss.validation.files import code_hash, now, packed, write_json
from cutvib_ss.validation.plan import Request
from cutvib_ss.validation.trial import Tools
from cutvib_ss.validation.workers import Made, Outcome

CAUSES = ("guide_compliance", "added_mass", "cubic_stiffness", "channel_delay")
PLACES = {
    "guide_compliance": "head_base", "added_mass": "tool", "cubic_stiffness": "joint2", "channel_delay": "measurement",
}  # fmt: skip
OUTSIDE = ("hum", "rattle")


def tiny_rig(request: Request) -> Made:
    """A label, and a campaign of one number that a good eye could read the cause from."""
    rng = np.random.default_rng(request.seed)
    first, second = (CAUSES[i] for i in rng.permutation(len(CAUSES))[:2])
    only = request.cause if request.cause in PLACES else first
    effect, place = {
        "none": ("none", "none"),
        "single": (only, PLACES[only]),
        "pair": (f"{first}+{second}", f"{PLACES[first]}+{PLACES[second]}"),
        "outside": (f"outside:{request.cause}", "rail"),
    }[request.kind]
    label = {
        "effect": effect, "place": place, "parameters": {}, "severity": float(rng.uniform(*request.severity)),
        "kind": request.kind, "gap_sigma": 0.0 if request.kind == "none" else float(rng.uniform(0.3, 8.0)), "conditions": {},
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "records").mkdir()
        (folder / "records" / "p1.csv").write_text(f"{rng.normal()}\n")
        (folder / "campaign.toml").write_text('[campaign]\ntitle = "campaign"\n')
        return Made(label, packed(folder))


def diagnosis(causes: list[tuple[str, str, float]], verdict: str = "explained", **more: Any) -> dict[str, Any]:
    """JSON of a diagnosis that states some causes with their probabilities."""
    rows = [
        {"effect": e, "place": p, "probability": q, "parameters": {}, "after": 0.0021, "shrinkage": 0.93,
         "reduced_chi2": 1.02}
        for e, p, q in causes
    ]  # fmt: skip
    total, likely = 0.0, []
    for i, (_, _, q) in enumerate(causes):
        likely.append(i)
        total += q
        if total >= 0.95 - 1e-9:
            break
    return {
        "schema": "cutvib-diagnosis/1",
        "verdict": verdict,
        "gap": {"unit": "g/N", "before": 0.0286, "tuned": 0.019, "after": 0.0021, "noise_floor": 0.0019,
                "band_hz": [15.0, 450.0], "shrinkage": 0.925, "shrinkage_interval": [0.91, 0.94]},
        "where": {"place": causes[0][1], "places": [], "bands_hz": [], "by_position": [], "by_channel": [],
                  "level_dependent": False},
        "causes": rows,
        "ambiguity_set": likely,
        "next_test": None,
        **more,
    }  # fmt: skip


def outcome(found: dict[str, Any] | None, status: str = "done", **more: Any) -> Outcome:
    """What became of a diagnosis."""
    return Outcome(
        **{
            "status": status, "exit_status": 0 if found else 1, "started": now(), "finished": now(), "seconds": 0.2,
            "cpu_seconds": 0.1, "code_sha256": code_hash(), "host": "here", "message": "" if found else "a fault",
            "diagnosis": None if found is None else json.dumps(found).encode(), **more,
        }  # type: ignore[arg-type]
    )  # fmt: skip


def says_none(archive: bytes) -> Outcome:
    """A diagnosis that never sees a gap."""
    with tarfile.open(fileobj=io.BytesIO(archive)) as content:
        assert "campaign.toml" in content.getnames()
    return outcome(
        diagnosis([("none", "none", 0.98), ("added_mass", "tool", 0.01), ("unknown", "rail", 0.01)], "no_gap")
    )


TOOLS = Tools(tiny_rig, says_none, CAUSES, OUTSIDE)


def opened_trial(folder: Path, cases: list[tuple[dict[str, Any], dict[str, Any]]], seed: int = 1) -> Path:
    """A trial as if run and opened, from labels and diagnoses; only what reads opened trials can use it."""
    for part in ("campaigns", "diagnoses"):
        (folder / part).mkdir(parents=True)
    names = [f"c{k:03d}" for k in range(len(cases))]
    for name, (_, found) in zip(names, cases, strict=True):
        (folder / "campaigns" / name).mkdir()
        write_json(folder / "diagnoses" / f"{name}.json", found)
        write_json(folder / "diagnoses" / f"{name}.run.json", {"status": "done", "cpu_seconds": 1.0})
    settings = {"cases": len(cases), "seed": seed, "mix": {}, "severity": [0.3, 2.0]}
    labels = {name: label for name, (label, _) in zip(names, cases, strict=True)}
    write_json(folder / "labels.json", {"labels": labels, "settings": settings})
    write_json(folder / "commitment.json", {"code_sha256": "0" * 64, "campaigns_sha256": dict.fromkeys(names, "")})
    return folder


def label(effect: str, place: str, gap_sigma: float = 5.0, **parameters: Any) -> dict[str, Any]:
    """A label of the rig."""
    return {"effect": effect, "place": place, "parameters": parameters, "severity": 1.0, "gap_sigma": gap_sigma}
