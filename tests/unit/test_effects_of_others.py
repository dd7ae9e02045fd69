"""Effects of another package, by entry point and by call: in files, in the search, in plans and in reports."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import cutvib_ss as cv
from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.diagnosis.hypotheses import candidates
from cutvib_ss.diagnosis.plan import PlannedCampaign, plan
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Effect, applied, parameter
from cutvib_ss.effects.catalogue import EFFECTS, GROUP
from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.report import report_html
from cutvib_ss.report.wording import cause_name, inspection_text, verdict_sentence
from tests.plugin_package.effects import Belt, HydraulicDamper

MASS = np.array([[2.0, 0.0], [0.0, 1.2]])
DAMPING = np.array([[9.0, -4.0], [-4.0, 4.0]])
STIFFNESS = np.array([[7e4, -3e4], [-3e4, 3e4]])
MACHINE = f"""
[model]
kind = "second_order"
dofs = ["x1", "x2"]
mass = {MASS.tolist()}
damping = {DAMPING.tolist()}
stiffness = {STIFFNESS.tolist()}
[ports]
base = [1.0, 0.0]
top = [0.0, 1.0]
[channels]
y1 = {{ port = "base", quantity = "displacement" }}
y2 = {{ port = "top", quantity = "displacement" }}
[input]
force = "base"
"""


def offer(monkeypatch: pytest.MonkeyPatch, point: metadata.EntryPoint) -> None:
    """An entry point as if its package were installed; those of other groups stay."""
    installed = metadata.entry_points
    monkeypatch.setattr(
        metadata, "entry_points", lambda **asked: [point] if asked.get("group") == GROUP else installed(**asked)
    )


@pytest.fixture
def by_entry_point(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The plugin package as if it were installed, its damper offered by an entry point."""
    point = metadata.EntryPoint("hydraulic_damper", "tests.plugin_package.effects:HydraulicDamper", GROUP)
    offer(monkeypatch, point)
    EFFECTS.reload()
    yield
    monkeypatch.undo()
    EFFECTS.reload()


@pytest.fixture
def by_call() -> Iterator[None]:
    """The belt, registered."""
    cv.register_effect(Belt)
    yield
    EFFECTS.remove("belt")


def structure(folder: Path, more: str = "") -> Any:
    (folder / "machine.toml").write_text(MACHINE + more, encoding="utf-8")
    return cv.read_machine(folder / "machine.toml")


def test_both_ways_lead_into_the_catalogue(by_entry_point: None, by_call: None) -> None:
    assert EFFECTS["hydraulic_damper"] is HydraulicDamper
    assert EFFECTS["belt"] is Belt
    assert list(EFFECTS)[-2:] == ["hydraulic_damper", "belt"]


def test_an_entry_point_that_cannot_be_loaded_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    point = metadata.EntryPoint("lost", "tests.plugin_package.nowhere:Lost", GROUP)
    offer(monkeypatch, point)
    EFFECTS.reload()
    with pytest.raises(ParameterError, match=r"lost = tests\.plugin_package\.nowhere:Lost .* cannot be loaded"):
        len(EFFECTS)
    monkeypatch.undo()
    EFFECTS.reload()


def test_files_hold_them_and_read_back(by_entry_point: None, by_call: None, tmp_path: Path) -> None:
    model = HydraulicDamper("top", 2e4, 30.0).apply(Belt("base", 5e3).apply(structure(tmp_path)))
    cv.write_machine(model, tmp_path / "corrected.toml")
    again = cv.read_machine(tmp_path / "corrected.toml")
    assert again.effects == model.effects
    freq = np.linspace(5.0, 60.0, 30)
    one, other = (cv.frequency_response(m, None, freq).data for m in (model, again))
    assert np.abs(one - other).max() < 1e-9 * np.abs(one).max()


def test_unknown_without_their_package(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="'belt' is not in the catalogue"):
        structure(tmp_path, '[[effect]]\neffect = "belt"\nplace = "base"\ntension = 5e3\n')


def test_what_they_do_not_say_is_found(by_call: None, tmp_path: Path) -> None:
    bare = structure(tmp_path)
    for effect in (HydraulicDamper("top", 2e4, 30.0), Belt("base", 5e3)):
        moved = effect.moved_by(bare, effect.apply(bare))
        for name, [(path, slope)] in moved.items():
            assert path == ("attachments", 0, "element", "stiffness" if name == "tension" else name)
            assert slope == pytest.approx(1.0, rel=1e-6)


def test_without_a_second_order_form_the_closed_form_works_and_the_plant_says_what_to_ask_for(tmp_path: Path) -> None:
    model = HydraulicDamper("top", 2e4, 30.0).apply(structure(tmp_path))
    freq = np.array([12.0, 31.0])
    found = cv.frequency_response(model, None, freq, outputs=["y1", "y2"]).data[0, :, 0]
    assert np.abs(found - exact(freq, HydraulicDamper("top", 2e4, 30.0))).max() < 1e-12
    with pytest.raises(CouplingError, match="a damper on a spring has no second-order form"):
        model.plant()
    # At the frequency at which it is replaced, the plant is exact.
    plant = model.plant(viscous_at=12.0)
    assert np.allclose(plant(2j * np.pi * 12.0)[:, 0], found[:, 0], rtol=1e-9)


def exact(freq: np.ndarray, effect: HydraulicDamper) -> np.ndarray:
    """Receptances of y1 and y2 to a force on the base, from the impedance matrix, shape (channel, frequency)."""
    s = 2j * np.pi * freq
    out = np.empty((2, freq.size), dtype=complex)
    for i, p in enumerate(s):
        z = p**2 * MASS + p * DAMPING + STIFFNESS
        z[1, 1] += 1.0 / (1.0 / effect.stiffness + 1.0 / (p * effect.damping))
        out[:, i] = np.linalg.solve(z, [1.0, 0.0])
    return out


def campaign(folder: Path, effect: HydraulicDamper) -> Any:
    """Stepped-sine responses of the structure with the damper, with a little noise."""
    structure(folder)
    rng = np.random.default_rng(4)
    freq = np.arange(5.0, 60.0, 0.7)
    lines = ["[campaign]", 'title = "A damper at the top"', 'machine = "machine.toml"']
    for k in range(3):
        shown = exact(freq, effect)
        size = 0.003 * np.abs(shown).mean(axis=1, keepdims=True)
        noisy = shown + size * (rng.standard_normal(shown.shape) + 1j * rng.standard_normal(shown.shape)) / np.sqrt(2)
        coherence = 1.0 / (1.0 + 4 * size**2 / np.abs(shown) ** 2)
        columns = [freq, *(c for h, g in zip(noisy, coherence, strict=True) for c in (h.real, h.imag, g))]
        head = "freq [Hz]," + ",".join(f"{n} re [m/N],{n} im [m/N],{n} coherence" for n in ("y1", "y2"))
        np.savetxt(folder / f"r{k}.csv", np.transpose(columns), delimiter=",", header=head, comments="", fmt="%.12e")
        lines += ["[[record]]", f'file = "r{k}.csv"', 'kind = "frf"', "averages = 4"]
        lines += ['excitation = "sine"', "peak_force = 10"]
    (folder / "campaign.toml").write_text("\n".join(lines), encoding="utf-8")
    return cv.read_campaign(folder)


@pytest.mark.slow
def test_the_diagnosis_finds_and_the_report_names_it(by_entry_point: None, by_call: None, tmp_path: Path) -> None:
    truth = HydraulicDamper("top", 1.5e4, 40.0)
    found = diagnose(campaign(tmp_path, truth))
    best = found.causes[0]
    assert (best.effect, best.place) == ("hydraulic_damper", "top")
    assert best.parameters["stiffness"].value == pytest.approx(1.5e4, rel=0.1)
    assert best.parameters["damping"].value == pytest.approx(40.0, rel=0.1)
    assert "a damper with a soft mount holds top" in verdict_sentence(found)
    assert any(limit.effect == "belt" for limit in found.limits)
    page = report_html(found)
    assert "a damper with a soft mount holds top" in page
    assert "Inspect: look for a shock absorber or a hose on top" in page


def test_a_plan_counts_them_in(by_entry_point: None, by_call: None, tmp_path: Path) -> None:
    asked = PlannedCampaign((), (10.0,), ("y1", "y2"), band=(5.0, 60.0), block=4.0, noise=1e-9)
    causes = {(c.effect, c.place): c for c in plan(structure(tmp_path), asked, laws=False).causes}
    assert {("hydraulic_damper", p) for p in ("base", "top")} | {("belt", "base")} <= set(causes)
    belt = causes["belt", "base"]
    assert (belt.parameter, belt.unit, belt.weak_end) == ("tension", "N/m", "zero")
    assert belt.seen is not None
    assert math.isfinite(belt.seen)


def test_words_fall_back_on_the_id(by_call: None) -> None:
    assert cause_name("belt", "tool") == "belt at the tool"
    assert inspection_text("belt", "tool") == ""


def known(_: int) -> list[str]:
    """Effects that a worker knows."""
    return list(EFFECTS)


def test_worker_processes_know_them(by_call: None) -> None:
    with Workers(2) as workers:
        assert all("belt" in names for names in workers.map(known, range(2)))


def test_workers_refuse_an_effect_that_they_cannot_import() -> None:
    @cv.register_effect
    @dataclass(frozen=True)
    class Local(Belt):
        effect = "local"

    try:
        with pytest.raises(ParameterError, match="put its class at the top of a module"), Workers(2) as workers:
            workers.map(known, range(2))
    finally:
        EFFECTS.remove("local")


@dataclass(frozen=True)
class Warp(Effect):
    """Changes a matrix, which no derivative of a response knows."""

    effect: ClassVar[str] = "warp"

    amount: float = parameter("1", 0.01, 0.5)

    @classmethod
    def places(cls, model: Any) -> tuple[str, ...]:
        return ("structure",)

    def apply(self, model: Any) -> Any:
        return applied(
            model, replace(model, system=replace(model.system, mass=model.system.mass * (1 + self.amount))), self
        )


def test_an_effect_that_cannot_be_fitted_is_named_and_not_left_out(tmp_path: Path) -> None:
    cv.register_effect(Warp)
    try:
        with pytest.raises(ParameterError, match=r"effect 'warp' at 'structure' cannot be searched for: .*amount"):
            candidates(structure(tmp_path), (5.0, 60.0), ("y1", "y2"))
    finally:
        EFFECTS.remove("warp")


# --- what is refused --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class NoPlaces(Effect):
    effect: ClassVar[str] = "no_places"

    def apply(self, model: Any) -> Any:
        return model


@dataclass(frozen=True)
class EmptyRange(Belt):
    effect = "empty_range"

    tension: float = parameter("N/m", 5.0, 5.0)


@dataclass(frozen=True)
class LogOfZero(Belt):
    effect = "log_of_zero"

    tension: float = parameter("N/m", 0.0, 5.0)


@dataclass(frozen=True)
class NoRange(Effect):
    effect: ClassVar[str] = "no_range"

    length: float

    @classmethod
    def places(cls, model: Any) -> tuple[str, ...]:
        return ()

    def apply(self, model: Any) -> Any:
        return model


@dataclass(frozen=True)
class Taken(Belt):
    effect = "tool_contact"


class NotADataclass(Belt):
    effect = "not_a_dataclass"


@dataclass(frozen=True)
class WrongWords(Belt):
    effect = "wrong_words"
    sentence = "{port} is pulled"


@dataclass(frozen=True)
class NoId(Belt):
    effect = "No Id"


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (NoPlaces, "NoPlaces lacks places"),
        (EmptyRange, r"EmptyRange\.tension: its range 5 to 5 must be finite and not empty"),
        (LogOfZero, r"LogOfZero\.tension: a range on a 'log' scale must be above zero"),
        (NoRange, r"NoRange\.length has no range"),
        (Taken, "'tool_contact' is taken by cutvib_ss"),
        (NotADataclass, "must be a dataclass"),
        (WrongWords, r"may hold \{place\} and \{what\} alone"),
        (NoId, "'No Id' must be an id in lower case"),
        (float, "is not a class that inherits"),
    ],
)
def test_what_is_not_an_effect_is_refused_when_it_is_registered(kind: Any, message: str) -> None:
    before = list(EFFECTS)
    with pytest.raises(ParameterError, match=message):
        cv.register_effect(kind)
    assert list(EFFECTS) == before
