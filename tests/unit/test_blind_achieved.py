"""How far a gap really shrank: corrected models on fresh records of a known machine."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model_files import write_machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.validation import achieved
from cutvib_ss.validation.achieved import closed, with_achieved
from cutvib_ss.validation.cases import read_cases
from cutvib_ss.validation.draw import between
from cutvib_ss.validation.files import digest, packed, read_json, write_json
from cutvib_ss.validation.seal import SealError, Trial
from tests.unit.blind_example import diagnosis, label, opened_trial


def off_by(machine: Machine, factor: float) -> Machine:
    return replace(machine, head=replace(machine.head, k2=factor * machine.head.k2))


def fresh_records(machine: Machine, folder: Path) -> bytes:
    """Responses of a machine; the nominal one is the published machine."""
    folder.mkdir()
    freq = np.arange(5.0, 500.0, 0.5)
    lines = ['[campaign]\ntitle = "t"\n']
    for k, position in enumerate((0.25, 0.7)):
        frf = frequency_response(machine, [position], freq, form="accelerance", outputs=["tool_x"]).data[0, 0, 0]
        table = np.column_stack([freq, frf.real, frf.imag, np.full(freq.size, 0.9999)])
        head = "freq [Hz],tool_x re [m/s^2/N],tool_x im [m/s^2/N],tool_x coherence"
        np.savetxt(folder / f"p{k}.csv", table, delimiter=",", header=head, comments="")
        # Random excitation: no block that ends before the slow modes do.
        lines.append(f'[[record]]\nfile = "p{k}.csv"\nkind = "frf"\nposition = {position}')
        lines.append('excitation = "random"\naverages = 9\n')
    (folder / "campaign.toml").write_text("\n".join(lines))
    return packed(folder)


@pytest.fixture
def trial(tmp_path: Path) -> Trial:
    """Three cases of one machine: found, not found, made worse."""
    archive = fresh_records(off_by(published_machine(), 1.1), tmp_path / "fresh")
    truth = label("parameter_shift", "joint2", parameter="k2") | {"fresh_sha256": digest(archive)}
    found = diagnosis([("parameter_shift", "joint2", 0.97), ("none", "none", 0.03)])
    trial = Trial(opened_trial(tmp_path / "trial", [(truth, found)] * 3))
    (trial.sealed / "cases").mkdir(parents=True)
    for name, factor in (("c000", 1.1), ("c001", 1.0), ("c002", 0.9)):
        trial.fresh(name).write_bytes(archive)
        write_machine(off_by(published_machine(), factor), trial.machine(name))
    return trial


def test_the_part_that_is_closed(trial: Trial) -> None:
    assert closed(trial, "c000") == pytest.approx(1.0, abs=1e-6)
    assert closed(trial, "c001") == pytest.approx(0.0, abs=1e-9)
    assert closed(trial, "c002") < -0.2


def test_cases_are_told_and_it_is_kept(trial: Trial, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = read_cases(trial, read_json(trial.labels)["labels"])
    trial.machine("c002").unlink()
    found = [c.achieved for c in with_achieved(trial, cases)]
    assert found[:2] == pytest.approx([1.0, 0.0], abs=1e-6)
    assert np.isnan(found[2]), "no corrected model, no figure"
    monkeypatch.setattr(achieved, "closed", lambda trial, name: pytest.fail("it is known already"))
    assert [c.achieved for c in with_achieved(trial, cases)][:2] == found[:2]


def test_other_records_than_those_of_the_label_are_refused(trial: Trial) -> None:
    labels = read_json(trial.labels)
    labels["labels"]["c001"]["fresh_sha256"] = "0" * 64
    write_json(trial.labels, labels)
    with pytest.raises(SealError, match="not the records that were committed to"):
        with_achieved(trial, read_cases(trial, labels["labels"]))


def test_fresh_positions_lie_where_nothing_was_measured() -> None:
    assert between((0.9, 0.02, 0.1, 0.5, 0.4)) == (0.25, 0.7)
    assert between((0.2, 0.8)) == (0.5,)
