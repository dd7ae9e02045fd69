"""All tables side by side, as `cutvib paper` shows them."""

import json
import math

import pytest

from cutvib_ss.paper import Row, paper_tables


@pytest.fixture(scope="module")
def tables() -> dict[str, list[Row]]:
    return paper_tables()


def test_every_table_is_there_and_is_json(tables: dict[str, list[Row]]) -> None:
    assert list(tables)[:7] == ["1", "2", "3", "4", "5", "6", "7"]
    assert json.loads(json.dumps(tables, allow_nan=False)) == tables
    for rows in tables.values():
        for row in rows:
            assert set(row) == {"name", "printed", "computed", "note"}
            if row["computed"] is None:
                assert "not reproducible" in str(row["note"])
            else:
                assert isinstance(row["computed"], float)
                assert math.isfinite(row["computed"])


def test_tables_5_and_6_within_two_per_mille(tables: dict[str, list[Row]]) -> None:
    rows = tables["5"] + tables["6"]
    assert len(rows) == 16
    for row in rows:
        assert row["computed"] == pytest.approx(row["printed"], rel=2e-3), row["name"]


def test_what_does_not_agree_says_why(tables: dict[str, list[Row]]) -> None:
    for table in ("1", "2", "3", "4", "7", "first_guess"):
        for row in tables[table]:
            if row["printed"] is None or row["computed"] != pytest.approx(row["printed"], rel=0.01):
                assert row["note"], row["name"]


def test_the_misprint_stands_out(tables: dict[str, list[Row]]) -> None:
    [row] = [row for row in tables["7"] if str(row["name"]).startswith("k_a")]
    assert "misprint" in str(row["note"])
    assert row["computed"] == pytest.approx(10 * float(row["printed"] or 0.0), rel=1e-4)
