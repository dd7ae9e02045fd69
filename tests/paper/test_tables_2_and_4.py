"""Tables 2 and 4: what can be reproduced of them."""

import numpy as np
import pytest

from cutvib_ss.paper import paper_tables
from cutvib_ss.paper.tables import Row
from cutvib_ss.parameters import PAPER_POSITIONS, table_4


@pytest.fixture(scope="module")
def tables() -> dict[str, list[Row]]:
    return paper_tables()


def test_every_limit_of_table_2_follows_from_table_1(tables: dict[str, list[Row]]) -> None:
    rows = tables["2"]
    assert len(rows) == 20
    for row in rows:
        # The limits of the dampings are printed with two digits after the point.
        assert row["computed"] == pytest.approx(
            row["printed"], rel=1e-9, abs=0.0051 if "c" in str(row["name"])[:1] else 1e-9
        )


def test_table_4_says_what_cannot_be_reproduced_and_why(tables: dict[str, list[Row]]) -> None:
    errors = [row for row in tables["4"] if str(row["name"]).startswith("mean error")]
    assert [row["printed"] for row in errors] == list(table_4().values())
    for row in errors:
        assert row["computed"] is None
        assert "not reproducible" in str(row["note"])
    sizes = [row for row in tables["4"] if row["printed"] is None]
    assert len(sizes) == 8
    # The model's own mean moduli are several times the printed errors.
    assert all(float(row["computed"] or 0.0) > 2.5 * max(table_4().values()) for row in sizes)


def test_positions_have_the_paper_s_names() -> None:
    assert set(table_4()) < set(PAPER_POSITIONS)
    assert (PAPER_POSITIONS["FC"], PAPER_POSITIONS["BC"], PAPER_POSITIONS["CC"]) == (1 / 2, 1 / 2, 1 / 3)
    assert np.allclose([PAPER_POSITIONS[n] for n in ("BR", "CR", "FR")], 0.98)
