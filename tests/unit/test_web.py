"""The page's logic without a browser: uploads, curves, the diagnosis in a process of its own."""

import io
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.absorber.coupling import absorbed_response, attach_absorber
from cutvib_ss.cli import main
from cutvib_ss.control_design.check import check_controller
from cutvib_ss.control_design.hardware import Sampling
from cutvib_ss.control_design.prototypes import prototype
from cutvib_ss.errors import DataFormatError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.parameters import table_7
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.web import curves, figures
from cutvib_ss.web.curves import Change, Controller
from cutvib_ss.web.job import Job
from cutvib_ss.web.session import DEMO, PREFIX, Refused, Session, server_folder
from cutvib_ss.web.uploads import store

BAND = (20.0, 400.0)


def _files(folder: Path, prefix: str = "") -> list[tuple[str, io.BytesIO]]:
    return [
        (prefix + p.relative_to(folder).as_posix(), io.BytesIO(p.read_bytes()))
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    ]


def _zipped(files: list[tuple[str, io.BytesIO]]) -> io.BytesIO:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name, content in files:
            archive.writestr(name, content.getvalue())
    made.seek(0)
    return made


@pytest.fixture
def session() -> Iterator[Session]:
    made = Session("a-visitor")
    yield made
    made.close()
    assert not made.folder.exists()


# --- uploads ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["folder", "files in their folders", "zip", "zip of a folder", "files alone"])
def test_a_campaign_is_read_however_it_is_uploaded(session: Session, form: str) -> None:
    files = _files(DEMO, "demo/" if "folder" in form and form != "files in their folders" else "")
    if form.startswith("zip"):
        files = [("my.zip", _zipped(files))]
    if form == "files alone":
        files = [(Path(name).name, content) for name, content in files]
    session.open_upload(files)
    assert session.opened is not None
    assert session.opened.campaign.title == "Demonstration campaign"
    assert [r.position for r in session.opened.campaign.records] == [0.06, 0.27, 0.46, 0.68, 0.9]
    assert session.opened.channels == ["tool_x", "tool_z", "base_x"]


def _without(files: list[tuple[str, io.BytesIO]], name: str) -> list[tuple[str, io.BytesIO]]:
    return [(n, c) for n, c in files if not n.endswith(name)]


def _bad_uploads() -> dict[str, tuple[list[tuple[str, io.BytesIO]], str]]:
    text = (DEMO / "campaign.toml").read_text(encoding="utf-8")
    rest = _without(_files(DEMO), "campaign.toml")

    def with_text(changed: str) -> list[tuple[str, io.BytesIO]]:
        return [("campaign.toml", io.BytesIO(changed.encode())), *rest]

    return {
        "no campaign.toml": (rest, "no campaign.toml among the uploaded files"),
        "a record is missing": (_without(_files(DEMO), "p3.tdms"), "records/p3.tdms"),
        "not a zip": ([("my.zip", io.BytesIO(b"PK\x03\x04 and then nothing"))], "my.zip: cannot be unpacked"),
        "out of the folder": ([*_files(DEMO), ("../../elsewhere.toml", io.BytesIO(b"x"))], "elsewhere.toml"),
        "a record out of the upload": (with_text(text.replace("records/p1.tdms", "/etc/hostname")), "/etc/hostname"),
        "a machine out of the upload": (with_text(text.replace('"machine.toml"', '"../../m.toml"')), "../../m.toml"),
        "two campaigns": (_files(DEMO, "a/") + _files(DEMO, "b/"), "2 campaigns were uploaded"),
        "a wrong position": (with_text(text.replace("0.46", "4.6")), "position"),
        "no records": (with_text(text[: text.index("[[record]]")]), "campaign.toml"),
        "not a campaign": (with_text("this is = not [toml"), "campaign.toml"),
        "a record that is none": (
            [*_without(_files(DEMO), "p2.tdms"), ("records/p2.tdms", io.BytesIO(b"no"))],
            "p2.tdms",
        ),
    }


@pytest.mark.parametrize("case", list(_bad_uploads()))
def test_a_bad_upload_says_in_one_line_what_is_wrong_and_loses_nothing(session: Session, case: str) -> None:
    files, told = _bad_uploads()[case]
    session.open_demo()
    before = session.opened
    with pytest.raises(Refused) as refused:
        session.open_upload(files)
    message = str(refused.value)
    assert told in message
    assert "\n" not in message
    assert str(session.folder) not in message, "files are named as the user knows them"
    assert session.opened is before
    assert not list(session.folder.glob("upload-*")), "what was refused is not kept"


def test_a_zip_that_unpacks_to_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cutvib_ss.web.uploads.MOST_BYTES", 1 << 20)
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("campaign.toml", b"\0" * (3 << 20))
    made.seek(0)
    with pytest.raises(DataFormatError, match="larger than"):
        store([("small.zip", made)], tmp_path)


def test_another_campaign_replaces_the_files_of_the_one_before(session: Session) -> None:
    session.open_upload(_files(DEMO))
    session.open_upload(_files(DEMO))
    assert len(list(session.folder.glob("upload-*"))) == 1
    session.open_demo()
    assert not list(session.folder.glob("upload-*"))
    assert (DEMO / "campaign.toml").is_file()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["my-campaign"], "my-campaign"),
        (["--port", "{taken}"], "choose another with --port"),
        (["--host", "no-such-host.invalid"], "--host no-such-host.invalid"),
        (["--port", "70000"], "--port"),
    ],
)
def test_what_cannot_be_served_is_said_in_one_line(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("nicegui", reason="the page needs NiceGUI (extra web)")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        given = [a.format(taken=taken.getsockname()[1]) for a in arguments]
        assert main(["serve", "--no-open", *given]) == 2
    captured = capsys.readouterr()
    assert told in captured.err
    assert captured.err.count("\n") == 1


# --- curves ----------------------------------------------------------------------------------------------------------


def test_the_model_with_an_absorber_is_the_one_of_sherman_and_morrison() -> None:
    machine = published_machine()
    found = curves.modified(machine, 0.37, "tool_x", Change(absorber=table_7()), BAND)
    bare, damped = found.curves
    assert found.stable is None
    frf = frequency_response(machine, [0.37], damped.freq, inputs=["force"], outputs=["tool_x"])
    np.testing.assert_allclose(damped.data, absorbed_response(frf, table_7()).data[0, 0, 0], rtol=1e-9)
    np.testing.assert_allclose(
        bare.data, frequency_response(machine, [0.37], bare.freq, outputs="tool_x").data[0, 0, 0], rtol=1e-12
    )


def test_a_controller_without_gain_leaves_its_hardware_alone_on_the_machine() -> None:
    machine = published_machine()
    change = Change(controller=Controller("ppf", gain=0.0))
    found = curves.modified(machine, 0.5, "tool_x", change, BAND)
    assert found.stable is True
    [actuator] = prototype("ppf").hardware("tool_x", Sampling()).actuators
    passive = attach_absorber(machine, actuator.suspension, "tool_x")  # type: ignore[attr-defined]
    expected = frequency_response(passive, [0.5], found.curves[-1].freq, outputs="tool_x").data[0, 0, 0]
    np.testing.assert_allclose(found.curves[-1].data, expected, rtol=1e-6)


def test_a_controller_does_what_its_check_says() -> None:
    machine = published_machine()
    found = curves.modified(machine, 0.4, "tool_x", Change(controller=Controller("ppf")), BAND)
    kind = prototype("ppf")
    hardware = kind.hardware("tool_x", Sampling())
    checked = check_controller(kind.design(machine, 0.5, hardware), machine, [0.4], hardware, n_modes=1)
    [at] = checked.after[0, 0]
    freq = found.curves[-1].freq
    closed = curves.modified(machine, 0.4, "tool_x", Change(controller=Controller("ppf")), (216.9, 217.1))
    assert curves.at_frequency(closed.curves[-1], 217.0) == pytest.approx(at, rel=1e-4)
    assert BAND[0] == freq[0]
    assert BAND[1] == freq[-1]


def test_an_unstable_loop_has_no_response() -> None:
    found = curves.modified(published_machine(), 0.5, "tool_x", Change(controller=Controller("ppf", gain=2.6)), BAND)
    assert found.stable is False
    assert found.growth > 0.0
    assert [c.kind for c in found.curves] == ["nominal"]


def test_the_controlled_response_is_in_the_channels_quantity() -> None:
    change = Change(controller=Controller("ppf", gain=0.0))
    for output in ("tool_z", "base_x"):
        bare, closed = curves.modified(published_machine(), 0.5, output, change, BAND).curves
        assert closed.unit == bare.unit
        # Far below the actuator's 30 Hz suspension and with 0.08 kg of 100 kg the machine is as it was.
        near = np.abs(closed.freq - 150.0).argmin()
        same = np.interp(closed.freq[near], bare.freq, np.abs(bare.data))
        assert abs(closed.data[near]) == pytest.approx(same, rel=0.05)


def test_every_peak_is_drawn_at_its_height() -> None:
    machine = published_machine()
    coarse = curves.modified(machine, 0.5, "tool_x", Change(), BAND).curves[0]
    fine = np.arange(20.0, 400.0, 0.01)
    size = np.abs(frequency_response(machine, [0.5], fine, outputs="tool_x").data[0, 0, 0])
    assert np.abs(coarse.data).max() == pytest.approx(size.max(), rel=0.02)


def test_moving_the_head_takes_a_small_part_of_50_ms() -> None:
    machine, change = published_machine(), Change(absorber=table_7())
    curves.modified(machine, 0.5, "tool_x", change, BAND)
    took = []
    for position in np.linspace(0.1, 0.9, 9):
        begun = time.perf_counter()
        curves.modified(machine, float(position), "tool_x", change, BAND)
        took.append(time.perf_counter() - begun)
    assert min(took) < 0.05


def test_figures_are_plain_json_and_load_nothing(session: Session) -> None:
    session.open_demo()
    assert session.opened is not None
    campaign, summary = session.opened.campaign, session.opened.summary
    chosen = [0, 2]
    drawn = curves.measured_curves(summary.frfs, summary.records, chosen, "tool_z")
    assert [c.name for c in drawn] == ["y/L = 0.06, 69.3 N", "y/L = 0.46, 59 N"]
    model = curves.model_curves(campaign.machine, campaign, summary.records, chosen, "tool_z", "nominal")
    assert [c.colour for c in model] == [c.colour for c in drawn]
    coherence = curves.coherence_curves(summary.frfs, summary.records, chosen, "tool_z")
    for dark in (False, True):
        figure = figures.response_figure(
            [*drawn, *model], dark=dark, width=400, title="tool_z", phase=True, coherence=coherence, mark=217.0
        )
        text = json.dumps(figure, allow_nan=False)
        assert "http" not in text
        assert len(figure["data"]) == 2 * 4 + 2
        names = {trace.get("yaxis", "y") for trace in figure["data"]}
        assert names == {"y", "y2", "y3"}
        assert {"yaxis", "yaxis2", "yaxis3"} <= set(figure["layout"])


def test_the_rails_picture_marks_where_the_head_is() -> None:
    machine = published_machine()
    along = curves.along_the_rail(machine, "tool_x", Change(absorber=table_7()), 217.0)
    figure = figures.rail_figure(along, 0.3, dark=False, width=800, title="x", extra=(1.0, "with the controller"))
    assert figure["layout"]["shapes"][0]["x0"] == 0.3
    assert [t["name"] for t in figure["data"]] == ["the model", "with the absorber", "with the controller"]
    assert np.abs(along[1].data).max() < 0.5 * np.abs(along[0].data).max(), "Table 7's absorber works"


def test_a_controller_is_followed_over_the_rail_and_unstable_positions_are_marked() -> None:
    machine = published_machine()
    steady = Change(controller=Controller("resonant", 1.0, 0.5))
    along = curves.controlled_along_the_rail(machine, "tool_x", steady, 217.0)
    assert along is not None
    at = 16  # y/L = 0.5, where it was designed
    alone = curves.modified(machine, 0.5, "tool_x", steady, (200.0, 230.0)).curves[-1]
    assert abs(along.data[at]) == pytest.approx(curves.at_frequency(alone, 217.0), rel=0.02)
    wild = curves.controlled_along_the_rail(
        machine, "tool_x", Change(controller=Controller("resonant", 30.0, 0.5)), 217.0
    )
    assert wild is not None
    unstable = np.isnan(wild.data)
    assert unstable.any()
    figure = figures.rail_figure([wild], 0.3, dark=True, width=800, title="x", extra=(1.0, "with the controller"))
    (marked,) = [t for t in figure["data"] if t["name"].endswith("unstable")]
    assert marked["x"] == wild.freq[unstable].tolist()
    assert curves.controlled_along_the_rail(machine, "joint1", steady, 217.0) is None
    assert curves.controlled_along_the_rail(machine, "tool_x", Change(), 217.0) is None


# --- visitors who are gone ---------------------------------------------------------------------------------------------


def test_a_visitor_who_is_gone_is_forgotten_with_the_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    pytest.importorskip("nicegui", reason="the server needs NiceGUI (extra web)")
    from cutvib_ss.web.server import Server

    server = Server()
    stays, leaves, works = (server.session(None) for _ in range(3))
    for one in (stays, leaves, works):
        one.entered()
    works.open_demo()
    job = works.diagnose()
    leaves.gone()
    works.gone()
    server.sweep(3600.0)
    assert len(server.sessions) == 3
    server.sweep(-1.0)
    assert set(server.sessions) == {stays.name, works.name}, "a page that is open, a diagnosis that runs"
    assert not leaves.folder.exists()
    job.cancel()
    server.sweep(-1.0)
    assert set(server.sessions) == {stays.name}
    assert server.session(leaves.name).name != leaves.name
    server.close()
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="asks for a process by a signal")
def test_files_of_a_server_that_was_killed_are_removed_at_the_next_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    ended = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True, check=True
    )
    dead, alive = tmp_path / f"{PREFIX}{ended.stdout.strip()}-abc", tmp_path / f"{PREFIX}{os.getpid()}-def"
    other = tmp_path / "cutvib-page-notes"
    for folder in (dead, alive, other):
        (folder / "visitor-x").mkdir(parents=True)
    made = server_folder()
    assert not dead.exists()
    assert alive.exists()
    assert other.exists()
    assert made.name.startswith(f"{PREFIX}{os.getpid()}-")


# --- the diagnosis in its process ------------------------------------------------------------------------------------


def _ended(job: Job, seconds: float) -> str:
    until = time.monotonic() + seconds
    while job.state == "running" and time.monotonic() < until:
        time.sleep(0.05)
    return job.state


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_cancelled_diagnosis_is_gone(session: Session) -> None:
    session.open_demo()
    job = session.diagnose()
    until = time.monotonic() + 60.0
    while len(job.lines) < 3 and time.monotonic() < until:
        time.sleep(0.05)
    assert [line.text for line in job.lines][:3] == ["Reading the campaign", "Diagnosing", "Tuning the nominal model"]
    assert job.state == "running"
    assert session.result("report.html") is None
    job.cancel()
    assert job.state == "cancelled"
    assert not _alive(job.process_id)
    assert session.corrected_machine() is None


def test_a_step_that_counts_is_one_line(session: Session) -> None:
    session.open_demo()
    job = session.diagnose()
    job.cancel()
    job.lines = []
    for said in ("Fitting causes", "Fitting causes: 1 of 30", "Fitting causes: 2 of 30", "Judging causes"):
        job._told(said)
    assert [line.text for line in job.lines] == ["Fitting causes: 2 of 30", "Judging causes"]


def test_a_campaign_that_cannot_be_diagnosed_ends_in_one_line(tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    shutil.copytree(DEMO, folder)
    (folder / "records" / "p1.tdms").write_bytes(b"no record")
    job = Job(folder, tmp_path / "out")
    assert _ended(job, 60.0) == "failed"
    assert job.error.startswith("records/p1.tdms")
    assert "\n" not in job.error
    assert not list((tmp_path / "out").iterdir())


def test_a_new_campaign_ends_the_diagnosis_of_the_one_before(session: Session) -> None:
    session.open_demo()
    job = session.diagnose()
    session.open_demo()
    assert job.state == "cancelled"
    assert not _alive(job.process_id)
    assert session.job is None


def test_nothing_is_diagnosed_where_nothing_is_open(session: Session) -> None:
    with pytest.raises(Refused, match="no campaign is open"):
        session.diagnose()
