"""The table of docs/settings.md is that of the numbers as they stand; each number says what it is."""

import re
from dataclasses import fields
from pathlib import Path

from cutvib_ss.diagnosis.settings import SETTINGS, settings_table

ROOT = Path(__file__).parents[2]


def test_page_shows_the_numbers_as_they_stand() -> None:
    page = (ROOT / "docs" / "settings.md").read_text(encoding="utf-8")
    table = page.partition("<!-- numbers -->\n")[2].partition("<!-- end -->")[0]
    assert table == settings_table(), "put the text of settings_table() between the two marks of docs/settings.md"


def test_every_number_says_what_it_is_and_is_used() -> None:
    code = "\n".join(
        f.read_text(encoding="utf-8") for f in (ROOT / "cutvib_ss").rglob("*.py") if f.name != "settings.py"
    )
    for d in fields(SETTINGS):
        assert all(d.metadata[key] for key in ("unit", "meaning", "effect", "source")), d.name
        own = d.name.startswith("prior_") or re.fullmatch(r"likelihood_(\w+_sizes|noise_factors)", d.name)
        assert own or f"SETTINGS.{d.name}" in code, f"{d.name} is used by no code"


def test_no_module_of_the_diagnosis_holds_a_number_of_its_own() -> None:
    number = re.compile(r"^[A-Z][A-Z0-9_]+(?:, [A-Z][A-Z0-9_]+)*(?:: [^=]+)? = [(-]?[0-9]", re.MULTILINE)
    for file in (ROOT / "cutvib_ss" / "diagnosis").glob("*.py"):
        found = number.findall(file.read_text(encoding="utf-8"))
        assert not found, f"{file.name}: {found}: move it into settings.py"
