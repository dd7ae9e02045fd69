"""Fig. 20: what the absorber on the tool does to the accelerance XX at L/2 and L/3."""

import pytest

from cutvib_ss.absorber import check_absorber, misprinted_absorber, parametric_study
from cutvib_ss.model.machine import published_machine
from cutvib_ss.parameters import table_7


def test_the_accelerance_at_217_hz_falls_by_about_two_thirds() -> None:
    check = check_absorber(published_machine(), table_7())
    assert check.reduction == pytest.approx([2 / 3, 2 / 3], abs=0.02)


def test_the_peak_is_split_in_two_near_200_and_230_hz() -> None:
    check = check_absorber(published_machine(), table_7())
    assert [len(p) for p in check.peaks_before] == [1, 1]
    for low, high in check.peaks_after:
        assert low == pytest.approx(200.0, abs=2.0)
        assert high == pytest.approx(230.0, abs=3.0)


def test_with_the_misprinted_stiffness_it_does_next_to_nothing() -> None:
    check = check_absorber(published_machine(), misprinted_absorber())
    assert (check.reduction > 0.0).all()
    assert (check.reduction < 0.025).all()


def test_the_parametric_study_judges_each_absorber_as_the_check_does() -> None:
    study = parametric_study(published_machine(), tuning=[205.0, 212.0, 230.0], damping_ratio=[0.01, 0.04])
    check = check_absorber(published_machine(), table_7())
    assert study.worst[1, 1] == pytest.approx(check.worst[1], rel=1e-9)
    best = check_absorber(published_machine(), study.best)
    assert best.after.max() == pytest.approx(study.worst.min(), rel=1e-9)
