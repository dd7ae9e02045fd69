"""Table 7: the absorber, and the misprint of its stiffness."""

import pytest

from cutvib_ss.absorber import absorber_of
from cutvib_ss.parameters import TABLE_7_PRINTED, table_7


def test_eq_26_gives_the_printed_damping_with_the_stiffness_of_eq_25() -> None:
    assert table_7().damping == pytest.approx(TABLE_7_PRINTED["damping"], abs=0.0051)


def test_eq_25_gives_ten_times_the_printed_stiffness() -> None:
    assert table_7().stiffness == pytest.approx(141_945.4, abs=0.1)
    # A shifted decimal point, to the printed digits.
    assert table_7().stiffness / 10 == pytest.approx(TABLE_7_PRINTED["stiffness"], abs=0.6)


def test_physical_values_and_tuning_are_two_ways_to_say_the_same() -> None:
    a = table_7()
    again = absorber_of(a.mass, a.stiffness, a.damping)
    assert (again.frequency, again.damping_ratio) == pytest.approx((a.frequency, a.damping_ratio))
