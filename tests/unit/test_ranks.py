"""Ranks of true values in posteriors: coverage of intervals, and one case drawn and fitted."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from cutvib_ss.cli.app import main
from cutvib_ss.errors import ParameterError
from cutvib_ss.validation import ranks
from cutvib_ss.validation.plan import SMALL
from cutvib_ss.validation.ranks import Rank, coverage, draw_ranks, to_dict
from cutvib_ss.validation.rig import Case
from cutvib_ss.validation.rig.motion import NotConvergedError


def drawn(narrowed: float) -> tuple[Rank, ...]:
    """Ranks of values whose intervals are too narrow by a factor."""
    z = np.random.default_rng(0).standard_normal(2000) * narrowed
    return tuple(Rank("added_mass", "mass", False, p, p) for p in stats.norm.cdf(z).tolist())


@pytest.mark.parametrize(("narrowed", "half", "most"), [(1.0, 0.5, 0.9), (2.0, 0.264, 0.589)])
def test_coverage_is_the_part_of_values_within_the_central_interval(narrowed: float, half: float, most: float) -> None:
    everything, tuned, of_cause = coverage(drawn(narrowed))
    assert [e.value for e in everything.posterior] == pytest.approx([half, most], abs=0.03)
    assert of_cause.posterior == everything.posterior == everything.stated
    assert (tuned.values, of_cause.name) == (0, "added_mass")


def test_true_values_are_ranked_in_the_fit_of_the_true_cause() -> None:
    found = draw_ranks(2, 3, ("added_mass", "guide_compliance"), small=SMALL)
    assert [(r.cause, r.parameter) for r in found if not r.tuned] == [
        ("added_mass", "mass"),
        ("guide_compliance", "stiffness"),
        ("guide_compliance", "damping"),
    ]
    assert {r.parameter for r in found if r.tuned} >= {"k1", "k2", "m2"}
    # Five standard deviations: the model that is fitted is the one that was drawn, whichever side its sensor sits on.
    assert all(3e-7 < r.posterior < 1.0 - 3e-7 for r in found)


def test_a_motion_that_the_rig_cannot_integrate_is_drawn_anew(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    seeds: list[int] = []

    def refusing(below: int) -> Callable[[Case, Path], None]:
        def write(case: Case, folder: Path) -> None:
            seeds.append(case.seed)
            if case.seed < below:
                raise NotConvergedError("freeplay: half of the noise is still wrong")

        return write

    monkeypatch.setattr(ranks, "write_campaign", refusing(5))
    assert ranks._written(3, "added_mass", (0.3, 2.0), SMALL, tmp_path).seed == 5
    assert seeds == [3, 4, 5]
    monkeypatch.setattr(ranks, "write_campaign", refusing(1000))
    with pytest.raises(
        ParameterError, match=r"added_mass: the rig could integrate none of 21 draws .*half of the noise"
    ):
        ranks._written(3, "added_mass", (0.3, 2.0), SMALL, tmp_path)


def test_ranks_are_written_as_json(tmp_path: Path) -> None:
    out = tmp_path / "ranks.json"
    assert (
        main(["blind", "ranks", "--cases", "1", "--seed", "3", "--small", "--cause", "added_mass", "--json", str(out)])
        == 0
    )
    read = json.loads(out.read_text())
    assert read["schema"] == "cutvib-ranks/1"
    assert read["coverage"][0]["values"] == 1
    assert (
        read["coverage"] == json.loads(json.dumps(to_dict(draw_ranks(1, 3, ("added_mass",), small=SMALL))))["coverage"]
    )


def test_a_cause_that_is_not_known_is_refused() -> None:
    with pytest.raises(ParameterError, match="cause 'rust': known are rail_torsion"):
        draw_ranks(1, 3, ("rust",))
    with pytest.raises(ParameterError, match="at least one"):
        draw_ranks(0, 3)
