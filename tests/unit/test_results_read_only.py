"""Arrays in results cannot be written to, whoever holds them."""

import numpy as np
import pytest

from cutvib_ss.results import read_only


def test_a_writeable_array_is_copied() -> None:
    given = np.arange(3.0)
    kept = read_only(given)
    given[0] = 7.0
    assert kept[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 1.0


def test_a_read_only_view_is_copied_for_its_owner_may_still_write() -> None:
    owner = np.arange(3.0)
    view = owner[:]
    view.flags.writeable = False
    kept = read_only(view)
    owner[0] = 7.0
    assert kept[0] == 0.0


def test_an_array_that_was_given_away_is_not_copied() -> None:
    given = np.arange(3.0)
    given.flags.writeable = False
    assert read_only(given, np.float64) is given
    other = read_only(given, np.complex128)
    assert other.dtype == np.complex128
    assert not other.flags.writeable
