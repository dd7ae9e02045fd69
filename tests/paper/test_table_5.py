"""Table 5: natural frequencies of the rail without the head."""

import numpy as np
import pytest

from cutvib_ss.model.rail import Rail, natural_frequencies, rail
from cutvib_ss.parameters import recovered_rail, table_5


def test_every_frequency_within_two_per_mille() -> None:
    assert natural_frequencies(recovered_rail()) == pytest.approx(table_5(), rel=2e-3)


def test_the_state_space_rail_has_them_too() -> None:
    beam = rail(Rail(recovered_rail()), {"base": 0.3})
    poles = beam.state_space({"rail_force": "base"}, {"base_x": ("base", "displacement")}).poles()
    natural = np.sort(np.abs(poles[poles.imag > 0])) / (2 * np.pi)
    assert natural == pytest.approx(table_5(), rel=2e-3)
