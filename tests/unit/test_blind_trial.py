"""The sealed trial: stages that resume, names that tell nothing, a seal that holds."""

import json
import os
import shutil
import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.validation import confined, seal, workers
from cutvib_ss.validation.files import code_hash, folder_hash, packed, read_json, unpack, write_json
from cutvib_ss.validation.plan import Request, neutral_name, requests, settings
from cutvib_ss.validation.seal import SealError, Trial, labels_hash, open_seal
from cutvib_ss.validation.trial import run_trial
from cutvib_ss.validation.workers import RigError, clean_environment, diagnosed
from tests.unit.blind_example import CAUSES, OUTSIDE, TOOLS, outcome, says_none, tiny_rig

ASKED = settings(10, 3, "none=3,outside=2,pair=1")


@pytest.fixture(autouse=True)
def code_that_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """The package's files may be edited while tests run; its hash is tested by itself."""
    for module in ("cutvib_ss.validation.seal", "tests.unit.blind_example"):
        monkeypatch.setattr(f"{module}.code_hash", lambda: "c" * 64)


@pytest.fixture
def trial(tmp_path: Path) -> Trial:
    return run_trial(ASKED, tmp_path / "trial", TOOLS, jobs=2)


def test_a_trial_has_the_cases_that_were_asked_for(trial: Trial) -> None:
    secret = open_seal(trial)
    kinds = Counter(one["kind"] for one in secret["labels"].values())
    assert kinds == {"none": 3, "outside": 2, "pair": 1, "single": 4}
    assert secret["settings"]["seed"] == 3
    assert {p.name for p in trial.campaigns.iterdir()} == set(secret["labels"])
    assert all(trial.diagnosis(n).is_file() and trial.run(n).is_file() for n in secret["labels"])
    singles = {one["effect"] for one in secret["labels"].values() if one["kind"] == "single"}
    assert singles == set(CAUSES), "each cause as often as any other"


def test_requests_are_drawn_from_the_seed_alone() -> None:
    made = requests(ASKED, CAUSES, OUTSIDE)
    assert made == requests(ASKED, CAUSES, OUTSIDE)
    other = requests(replace(ASKED, seed=4), CAUSES, OUTSIDE)
    assert not {r.seed for r in made} & {r.seed for r in other}
    assert [r.kind for r in made] != sorted(r.kind for r in made)


def test_traits_are_dealt_to_the_same_part_of_every_kind_and_apart_from_each_other() -> None:
    asked = settings(300, 9, "none=90,outside=60,pair=30,drifting=100,structure=0")
    assert {name: round(share, 3) for name, share in asked.traits.items()} == {
        "drifting": 0.333, "varied": 0.5, "rough": 0.333, "structure": 0.0,
    }  # fmt: skip
    made = requests(asked, CAUSES, OUTSIDE)
    for kind, count in asked.mix.items():
        own = [r for r in made if r.kind == kind]
        assert sum("drifting" in r.traits for r in own) == round(count / 3)
        assert sum("varied" in r.traits for r in own) == count // 2
        assert not any("structure" in r.traits for r in own)
    both = sum({"drifting", "varied"} <= set(r.traits) for r in made)
    assert 30 <= both <= 70, "a drifting machine has a varied cause as often as another"
    plain = requests(
        settings(300, 9, "none=90,outside=60,pair=30,drifting=0,varied=0,rough=0,structure=0"), CAUSES, OUTSIDE
    )
    assert [replace(r, traits=()) for r in made] == list(plain), "traits leave the rest of the plan alone"


def test_more_cases_with_a_trait_than_cases_are_refused() -> None:
    with pytest.raises(ParameterError, match="drifting in 12 of 10 cases"):
        settings(10, 1, "none=2,drifting=12")


def test_names_tell_nothing_without_the_salt(trial: Trial, tmp_path: Path) -> None:
    again = run_trial(ASKED, tmp_path / "again", TOOLS)
    names = {p.name for p in trial.campaigns.iterdir()}
    assert names.isdisjoint(p.name for p in again.campaigns.iterdir())
    salt = bytes.fromhex(read_json(trial.sealed / "trial.json")["salt"])
    assert names == {neutral_name(salt, k) for k in range(10)}


def test_the_trials_folder_holds_no_label_and_no_seed_before_it_is_opened(trial: Trial) -> None:
    for file in trial.folder.rglob("*"):
        if file.is_file():
            text = file.read_text()
            assert "gap_sigma" not in text
            assert "seed" not in text
            assert "guide_compliance" not in text


def test_labels_are_committed_to_before_any_diagnosis_runs(tmp_path: Path) -> None:
    seen = []

    def looks(archive: bytes) -> workers.Outcome:
        seen.append(read_json(tmp_path / "trial" / "commitment.json"))
        return says_none(archive)

    trial = run_trial(ASKED, tmp_path / "trial", replace(TOOLS, diagnose=looks))
    assert len(seen) == 10
    secret = open_seal(trial)
    salt = bytes.fromhex(read_json(trial.opening)["salt"])
    assert {c["labels_sha256"] for c in seen} == {labels_hash(secret, salt)}
    changed = json.loads(json.dumps(secret))
    next(iter(changed["labels"].values()))["severity"] += 1e-9
    assert labels_hash(changed, salt) != labels_hash(secret, salt)
    assert labels_hash(secret, bytes(32)) != labels_hash(secret, salt)


class Stopped(BaseException):
    """As if the power went."""


def test_a_trial_that_is_stopped_anywhere_resumes_and_loses_nothing(tmp_path: Path) -> None:
    calls: Counter[str] = Counter()

    def rig(request: Request) -> workers.Made:
        calls["rig"] += 1
        if calls["rig"] == 4:
            raise Stopped
        return tiny_rig(request)

    def diagnose(archive: bytes) -> workers.Outcome:
        calls["diagnosis"] += 1
        if calls["diagnosis"] == 5:
            raise Stopped
        return says_none(archive)

    out = tmp_path / "trial"
    tools = replace(TOOLS, rig=rig, diagnose=diagnose)
    with pytest.raises(Stopped):
        run_trial(ASKED, out, tools)
    first = {p.name: folder_hash(p) for p in (out / "campaigns").iterdir()}
    assert len(first) == 3
    assert not (out / "commitment.json").exists()
    # A campaign that was cut short, and one whose label was not yet written.
    (out / "campaigns" / ".half.part").mkdir()
    orphan = next(iter(first))
    (out.with_name("trial.sealed") / "cases" / f"{orphan}.json").unlink()
    with pytest.raises(Stopped):
        run_trial(ASKED, out, tools)
    sealed = (out / "commitment.json").read_bytes()
    assert len(list((out / "diagnoses").glob("*.run.json"))) == 4
    trial = run_trial(ASKED, out, tools)
    assert (out / "commitment.json").read_bytes() == sealed
    assert calls == {"rig": 3 + 1 + 1 + 7, "diagnosis": 4 + 1 + 6}
    assert {p.name: folder_hash(p) for p in trial.campaigns.iterdir() if p.name in first} == first
    assert len(open_seal(trial)["labels"]) == 10


def test_a_trial_whose_process_is_killed_goes_on_where_it_was(tmp_path: Path) -> None:
    # SIGKILL leaves no time for anything: what is there was written whole.
    out = tmp_path / "trial"
    program = f"""
import time
from dataclasses import replace
from pathlib import Path
from cutvib_ss.validation import seal
from cutvib_ss.validation.plan import settings
from cutvib_ss.validation.trial import run_trial
from tests.unit import blind_example
seal.code_hash = blind_example.code_hash = lambda: "c" * 64
def slowly(archive):
    time.sleep(0.05)
    return blind_example.says_none(archive)
asked = settings(10, 3, "none=3,outside=2,pair=1")
run_trial(asked, Path({str(out)!r}), replace(blind_example.TOOLS, diagnose=slowly))
"""
    running = subprocess.Popen([sys.executable, "-c", program], cwd=Path(__file__).parents[2])
    while len(list((out / "diagnoses").glob("*.run.json"))) < 3 and running.poll() is None:
        time.sleep(0.01)
    running.kill()
    running.wait()
    kept = {p.name: p.read_bytes() for p in (out / "diagnoses").glob("*.run.json")}
    sealed = (out / "commitment.json").read_bytes()
    assert 3 <= len(kept) < 10
    trial = run_trial(ASKED, out, TOOLS)
    assert (out / "commitment.json").read_bytes() == sealed
    assert {name: (out / "diagnoses" / name).read_bytes() for name in kept} == kept
    assert len(open_seal(trial)["labels"]) == 10


def test_progress_is_told(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    run_trial(ASKED, tmp_path / "trial", TOOLS, progress=lambda *p: told.append(p))
    assert told[0] == ("campaigns", 0, 10)
    assert told[-1] == ("diagnoses", 10, 10)


def test_a_rig_that_fails_is_asked_again_and_the_label_says_so(tmp_path: Path) -> None:
    asked = settings(2, 1, "none=2")
    failing = requests(asked, CAUSES, OUTSIDE)[0].seed

    def rig(request: Request) -> workers.Made:
        if request.seed == failing:
            raise RigError("no convergence")
        return tiny_rig(request)

    labels = open_seal(run_trial(asked, tmp_path / "trial", replace(TOOLS, rig=rig)))["labels"]
    assert sorted(one["redrawn"] for one in labels.values()) == [0, 1]
    assert sorted(one["refused"] for one in labels.values()) == [[], ["no convergence"]]

    def broken(request: Request) -> workers.Made:
        raise RigError("no convergence")

    with pytest.raises(RigError):
        run_trial(asked, tmp_path / "other", replace(TOOLS, rig=broken))


def test_other_settings_do_not_mix_into_a_trial(trial: Trial) -> None:
    with pytest.raises(ParameterError, match=r"other settings .*--seed 3"):
        run_trial(replace(ASKED, seed=4), trial.folder, TOOLS)


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("dear")
    with pytest.raises(ParameterError, match="not empty"):
        run_trial(ASKED, tmp_path, TOOLS)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.txt"]


def test_the_seal_is_opened_once_and_says_when(trial: Trial) -> None:
    secret = open_seal(trial)
    opening = trial.opening.read_bytes()
    assert open_seal(trial) == secret
    assert trial.opening.read_bytes() == opening
    # The labels are public now: the secret folder is no longer needed.
    shutil.rmtree(trial.sealed)
    assert open_seal(trial) == secret


def test_a_diagnosis_newer_than_the_opening_is_refused(trial: Trial) -> None:
    open_seal(trial)
    name = next(iter(trial.campaigns.iterdir())).name
    later = time.time() + 5
    os.utime(trial.diagnosis(name), (later, later))
    with pytest.raises(SealError, match="newer than the opening"):
        open_seal(trial)


def test_a_diagnosis_changed_after_the_opening_is_refused_whatever_its_date(trial: Trial) -> None:
    open_seal(trial)
    file = trial.diagnosis(next(iter(trial.campaigns.iterdir())).name)
    dates = file.stat()
    file.write_text(file.read_text().replace("no_gap", "unknown"))
    os.utime(file, ns=(dates.st_atime_ns, dates.st_mtime_ns))
    with pytest.raises(SealError, match="is not what it was when the seal was opened"):
        open_seal(trial)


def test_a_diagnosis_changed_before_the_opening_is_refused(trial: Trial) -> None:
    file = trial.diagnosis(next(iter(trial.campaigns.iterdir())).name)
    file.write_text(file.read_text().replace("no_gap", "unknown"))
    with pytest.raises(SealError, match="was changed since it was made"):
        open_seal(trial)
    assert not trial.opening.exists()


def test_changed_labels_are_refused(trial: Trial) -> None:
    kept = trial.sealed / "labels.json"
    content = read_json(kept)
    name, one = next((n, v) for n, v in content["secret"]["labels"].items() if v["kind"] == "single")
    content["secret"]["labels"][name] = {**one, "effect": "none", "place": "none"}
    write_json(kept, content)
    with pytest.raises(SealError, match="not the labels that were committed to"):
        open_seal(trial)
    assert not trial.opening.exists()
    assert not trial.labels.exists()


def test_changed_code_is_refused(trial: Trial, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seal, "code_hash", lambda: "d" * 64)
    with pytest.raises(SealError, match="code has changed since the labels were sealed"):
        open_seal(trial)
    trial.run(next(iter(trial.campaigns.iterdir())).name).unlink()
    with pytest.raises(SealError, match="code has changed"):
        run_trial(ASKED, trial.folder, TOOLS)


def test_a_worker_with_other_code_is_refused(tmp_path: Path) -> None:
    def elsewhere(archive: bytes) -> workers.Outcome:
        return replace(says_none(archive), code_sha256="e" * 64)

    with pytest.raises(SealError, match="other code"):
        run_trial(ASKED, tmp_path / "trial", replace(TOOLS, diagnose=elsewhere))


def test_an_unfinished_trial_stays_closed(trial: Trial) -> None:
    trial.run(next(iter(trial.campaigns.iterdir())).name).unlink()
    with pytest.raises(SealError, match="1 of 10 cases are not diagnosed yet"):
        open_seal(trial)
    assert not trial.labels.exists()


def test_nothing_is_diagnosed_after_the_opening(trial: Trial) -> None:
    open_seal(trial)
    with pytest.raises(SealError, match="is open"):
        run_trial(ASKED, trial.folder, TOOLS)


def test_a_changed_campaign_is_not_diagnosed(trial: Trial) -> None:
    name = next(iter(trial.campaigns.iterdir())).name
    trial.run(name).unlink()
    (trial.campaigns / name / "campaign.toml").write_text("")
    with pytest.raises(SealError, match="not the campaign that was committed to"):
        run_trial(ASKED, trial.folder, TOOLS)


def test_a_folder_without_a_trial_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SealError, match=r"no commitment\.json"):
        open_seal(Trial(tmp_path))


def test_a_diagnosis_that_fails_is_kept_as_a_failure(tmp_path: Path) -> None:
    tools = replace(TOOLS, diagnose=lambda archive: outcome(None, "failed"))
    trial = run_trial(settings(2, 1, "none=2"), tmp_path / "trial", tools)
    runs = [read_json(p) for p in trial.diagnoses.glob("*.run.json")]
    assert [r["status"] for r in runs] == ["failed", "failed"]
    assert len(open_seal(trial)["labels"]) == 2


# --- the diagnosing process -------------------------------------------------------------------------------------------


def test_the_environment_holds_nothing_of_the_caller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CUTVIB_SECRET", "joint2")
    environment = clean_environment(tmp_path)
    assert "CUTVIB_SECRET" not in environment
    assert environment["HOME"] == environment["TMPDIR"] == str(tmp_path)
    assert environment["OMP_NUM_THREADS"] == "1"


def test_a_diagnosis_runs_in_a_folder_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "campaign").mkdir()
    (tmp_path / "campaign" / "campaign.toml").write_text("[campaign]\n")
    found = diagnosed(packed(tmp_path / "campaign"), (str(tmp_path),))
    assert (found.status, found.exit_status) == ("failed", 2)
    assert "campaign" in found.message
    assert str(tmp_path) not in found.message
    assert found.code_sha256 is not None
    assert found.cpu_seconds is not None
    assert found.cpu_seconds > 0


def test_a_diagnosis_that_takes_too_long_is_stopped(tmp_path: Path) -> None:
    (tmp_path / "campaign.toml").write_text("[campaign]\n")
    found = diagnosed(packed(tmp_path), timeout=0.05)
    assert (found.status, found.exit_status, found.diagnosis) == ("timeout", None, None)


_PEEPS = """
import sys
from pathlib import Path
from cutvib_ss.validation.confined import forbid
secret = Path(sys.argv[1])
forbid([str(secret)])
tries = [lambda: (secret / "labels.json").read_text(), lambda: list(secret.iterdir()), lambda: open(secret / "x", "w"),
         lambda: (secret / ".." / secret.name / "labels.json").read_text(), lambda: __import__("os").symlink(secret, "s")]
for attempt in tries:
    try:
        attempt()
    except PermissionError:
        continue
    sys.exit("it could look")
print((secret.parent / "own.txt").read_text())
"""


def test_a_confined_process_cannot_look_at_the_labels(tmp_path: Path) -> None:
    import subprocess
    import sys

    secret = tmp_path / "trial.sealed"
    secret.mkdir()
    (secret / "labels.json").write_text("joint2")
    (tmp_path / "own.txt").write_text("its own")
    ended = subprocess.run(
        [sys.executable, "-c", _PEEPS, str(secret)], cwd=tmp_path, env=clean_environment(tmp_path), capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout.strip()) == (0, "its own"), ended.stderr


def test_confined_runs_the_command_and_tells_which_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(confined, "forbid", lambda folders: None)  # it cannot be taken back
    usage = tmp_path / "usage.json"
    assert confined.main([str(usage), "--", "--version"]) == 0
    assert set(read_json(usage)) == {"cpu_seconds", "code_sha256"}


# --- files ------------------------------------------------------------------------------------------------------------


def test_an_archive_unpacks_to_the_same_folder(tmp_path: Path) -> None:
    source = tmp_path / "a"
    (source / "records").mkdir(parents=True)
    (source / "records" / "p1.csv").write_bytes(b"\x00\x01")
    (source / "campaign.toml").write_text("x")
    unpack(packed(source), tmp_path / "b")
    assert folder_hash(tmp_path / "b") == folder_hash(source)
    (tmp_path / "b" / "campaign.toml").rename(tmp_path / "b" / "campaign.tom")
    assert folder_hash(tmp_path / "b") != folder_hash(source)


def test_the_codes_hash_moves_with_the_code(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "gap").mkdir()
    (tmp_path / "gap" / "verdict.py").write_text("SURE = 0.9\n")
    monkeypatch.setattr("cutvib_ss.validation.files.PACKAGE", tmp_path)
    before = code_hash()
    (tmp_path / "gap" / "__pycache__").mkdir()
    (tmp_path / "gap" / "__pycache__" / "verdict.cpython-311.pyc").write_text("x")
    assert code_hash() == before
    (tmp_path / "gap" / "verdict.py").write_text("SURE = 0.8\n")
    assert code_hash() != before


def test_json_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "cut.json").write_text('{"a": ')
    with pytest.raises(DataFormatError, match="cut short"):
        read_json(tmp_path / "cut.json")
    with pytest.raises(DataFormatError, match="cannot be read"):
        read_json(tmp_path / "absent.json")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, 1), "at least one case"),
        ((5, -1), "must not be negative"),
        ((5, 1, "none=6"), "asks for 6 cases"),
        ((5, 1, "nothing=1"), "KIND=NUMBER"),
        ((5, 1, "none=-1"), "KIND=NUMBER"),
        ((5, 1, None, (2.0, 1.0)), "LO <= HI"),
    ],
)
def test_impossible_settings(arguments: tuple, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        settings(*arguments)
