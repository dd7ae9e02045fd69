"""The table of effects in the documentation is the one that the code writes."""

from pathlib import Path

from cutvib_ss.effects.catalogue import catalogue_table

PAGE = Path(__file__).parents[2] / "docs" / "effects.md"


def test_the_page_holds_the_table_of_the_code() -> None:
    text = PAGE.read_text(encoding="utf-8")
    table = text.split("catalogue_table()` -->\n")[1].split("<!-- end of catalogue -->")[0]
    assert table == catalogue_table(), "put the text of catalogue_table() between the two marks of docs/effects.md"
