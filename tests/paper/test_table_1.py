"""Table 1: the first guess (Eqs. 14-20), and where the printed values leave its equations."""

from dataclasses import replace
from math import sqrt

import pytest

from cutvib_ss.errors import ParameterError
from cutvib_ss.identification import first_guess
from cutvib_ss.identification.first_guess import PAPER_DIP, PAPER_PEAKS, resonances, stiffness_ratio
from cutvib_ss.parameters import table_1, table_2

PRINTED = table_1()


def test_k2_is_eq_16_at_the_dip() -> None:
    # Five printed digits.
    assert first_guess(PAPER_PEAKS, PAPER_DIP).k2 == pytest.approx(PRINTED.k2, abs=0.5)


def test_k1_is_fifty_times_k2_and_not_what_the_printed_peaks_give() -> None:
    assert first_guess(PAPER_PEAKS, PAPER_DIP, ratio=50.0).k1 == pytest.approx(PRINTED.k1, abs=50.0)
    assert stiffness_ratio(PAPER_PEAKS, PAPER_DIP) == pytest.approx(47.83, abs=0.01)
    assert first_guess(PAPER_PEAKS, PAPER_DIP).k1 == pytest.approx(499_422, abs=1.0)


def test_m1_follows_from_the_peaks_and_not_from_the_printed_k1() -> None:
    assert round(first_guess(PAPER_PEAKS, PAPER_DIP).m1) == PRINTED.m1
    assert first_guess(PAPER_PEAKS, PAPER_DIP, ratio=50.0).m1 == pytest.approx(25.0)


def test_dampings_are_those_of_half_the_stated_ratio() -> None:
    stated = first_guess(PAPER_PEAKS, PAPER_DIP, ratio=50.0)
    halved = first_guess(PAPER_PEAKS, PAPER_DIP, ratio=50.0, damping_ratio=0.05)
    assert stated.c2 == pytest.approx(1.445, abs=5e-4)
    assert halved.c2 == pytest.approx(PRINTED.c2, abs=5e-3)
    heavy = replace(halved, m1=26.0)
    assert 2 * 0.05 * sqrt(heavy.k1 * heavy.m1 * heavy.l1**2) == pytest.approx(PRINTED.c1, abs=5e-3)


def test_eq_19_gives_back_the_interval_between_the_peaks() -> None:
    low, high = resonances(PAPER_DIP, stiffness_ratio(PAPER_PEAKS, PAPER_DIP))
    assert high - low == pytest.approx(PAPER_PEAKS[1] - PAPER_PEAKS[0], abs=1e-9)


def test_eq_19_gives_the_eigenvalues_of_eq_17() -> None:
    from cutvib_ss.identification import held_natural_frequencies

    guess = first_guess(PAPER_PEAKS, PAPER_DIP)
    expected = resonances(PAPER_DIP, guess.k1 / guess.k2)
    assert held_natural_frequencies(guess) == pytest.approx(expected, rel=1e-12)


def test_table_2_lies_around_table_1() -> None:
    lower, upper = table_2()
    for name in ("m1", "m2", "l1", "l2", "theta01", "theta02", "k1", "k2", "c1", "c2"):
        assert getattr(lower, name) <= getattr(PRINTED, name) <= getattr(upper, name)


@pytest.mark.parametrize("dip", [200.0, 260.0, 215.0])
def test_a_dip_outside_the_peaks_is_refused(dip: float) -> None:
    with pytest.raises(ParameterError, match="between the peaks"):
        stiffness_ratio(PAPER_PEAKS, dip)
