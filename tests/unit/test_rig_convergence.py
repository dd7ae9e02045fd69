"""Steps are short enough, for every law and for pairs: what is still wrong is at most a percent of the noise."""

import numpy as np
import pytest

pytest.importorskip("exudyn")

from cutvib_ss.validation.rig.convergence import Found, grouped, study, table


@pytest.mark.slow
def test_what_is_still_wrong_is_at_most_a_percent_of_the_noise_over_all_laws_and_pairs() -> None:
    found = list(study(1, 3))
    rows = {grouped(f.name) for f in found}
    assert {"freeplay", "dry_friction", "joint_slip", "outside", "two laws", "a law and a linear cause"} <= rows
    taken = [f for f in found if f.steps is not None]
    assert len(taken) >= 0.98 * len(found), "next to none is refused"
    stable = [f for f in taken if not f.unstable]
    assert len(stable) >= 0.95 * len(found)
    assert max(f.error for f in stable) < 0.01


def test_the_table_counts_what_was_refused_apart() -> None:
    rows = {"freeplay": [Found("freeplay: rounded", 32, 0.004), Found("freeplay: hertz", None, np.nan)]}
    rows["freeplay"].append(Found("freeplay: off_centre", 128, 0.05, unstable=True))
    assert "| freeplay | 3 | 1 | 1 | 32 (1), 128 (1) | 0.4 % |" in table(rows)
    assert grouped("freeplay + guide_compliance") == "a law and a linear cause"
    assert grouped("freeplay + dry_friction") == "two laws"
    assert grouped("outside: wiper") == "outside"
