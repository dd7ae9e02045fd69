"""The signatures of the effects on their page are those that the code gives."""

import runpy
from pathlib import Path

import pytest

from cutvib_ss.effects.catalogue import OWN

DOCS = Path(__file__).parents[2] / "docs"
MADE = runpy.run_path(str(DOCS / "make_signatures.py"), run_name="made")
MATCHES = runpy.run_path(str(Path(__file__).parent / "test_pages.py"))["matches"]
PAGE = (DOCS / "effect_signatures.md").read_text(encoding="utf-8")
FEW = ("added_mass", "cross_axis", "support_compliance")


def _row(text: str, name: str) -> str:
    [row] = [line for line in text.splitlines() if line.startswith(f"| [`{name}`]")]
    return row


def test_every_effect_has_its_row_and_its_picture() -> None:
    for kind in OWN:
        assert _row(PAGE, kind.effect)
        assert (DOCS / "figures" / "effects" / f"{kind.effect}.png").is_file()


@pytest.mark.parametrize(
    "kind", [k if k.effect in FEW else pytest.param(k, marks=pytest.mark.slow) for k in OWN], ids=lambda k: k.effect
)
def test_the_page_shows_what_is_computed(kind: type) -> None:
    made = MADE["page"]({kind.effect: MADE["signature"](kind)})
    assert MATCHES(_row(PAGE, kind.effect), _row(made, kind.effect)), _row(made, kind.effect)
