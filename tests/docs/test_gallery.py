"""The gallery shows every example, with its program, its output and its pictures."""

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
MADE = runpy.run_path(str(DOCS / "make_figures.py"), run_name="made")


def test_the_page_is_the_one_that_is_made() -> None:
    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == MADE["gallery_page"](), (
        "run .venv/bin/python docs/make_figures.py page"
    )


def test_every_example_is_shown() -> None:
    assert set(MADE["EXAMPLES"]) == {path.stem for path in (DOCS.parent / "examples").glob("*.py")}


def test_no_picture_is_left_over() -> None:
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    assert all(picture.name in text for picture in (DOCS / "figures" / "gallery").glob("*.png"))
