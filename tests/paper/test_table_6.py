"""Table 6: natural frequencies of the rail with the head, and the rail's mass that it hides."""

import numpy as np
import pytest

from cutvib_ss.errors import IdentificationError
from cutvib_ss.identification import recover_rail_mass
from cutvib_ss.model.machine import published_machine
from cutvib_ss.parameters import recovered_rail, table_6
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modes import modes

# The rounding of Table 3 and the misfit that least squares over Table 6 leaves.
TOLERANCE = 2e-3


@pytest.mark.parametrize(
    ("position", "mode", "printed"),
    [(position, k, f) for position, row in table_6().items() for k, f in enumerate(row)],
)
def test_every_frequency_within_two_per_mille(position: float, mode: int, printed: float) -> None:
    assert modes(published_machine(), position).natural_freq[mode] == pytest.approx(printed, rel=TOLERANCE)


def test_the_plant_has_the_same_frequencies() -> None:
    for position, printed in table_6().items():
        poles = np.linalg.eigvals(published_machine().plant(position).A)
        # |p| is the undamped frequency only where damping does not couple the modes: 0.2 % more.
        assert np.sort(np.abs(poles[poles.imag > 0])) / (2 * np.pi) == pytest.approx(printed, rel=2 * TOLERANCE)


def test_least_squares_over_the_table_gives_the_mass() -> None:
    found = recover_rail_mass()
    assert round(found.mass, 1) == 76.5
    assert found.worst_error < TOLERANCE
    assert found.std < 0.2


def test_the_mass_is_found_again_from_frequencies_computed_with_another() -> None:
    from dataclasses import replace

    from cutvib_ss.model.machine import cutting_machine
    from cutvib_ss.parameters import table_3

    heavier = cutting_machine(table_3(), replace(recovered_rail(), mass=101.0))
    table = {y: tuple(modes(heavier, y).natural_freq) for y in (0.5, 0.31)}
    found = recover_rail_mass(table)
    assert found.mass == pytest.approx(101.0, rel=1e-6)


def test_more_frequencies_than_the_machine_has_are_refused() -> None:
    with pytest.raises(IdentificationError, match="at most the 3"):
        recover_rail_mass(n_modes=1)


def test_a_mode_with_its_node_under_the_head_keeps_its_frequency() -> None:
    alone = 31.7 * np.arange(1.0, 5.0) ** 2
    assert np.abs(modes(published_machine(), 1 / 2).natural_freq[:, None] - alone[[1, 3]]).min(axis=0).max() < 1e-9
    assert np.abs(modes(published_machine(), 1 / 3).natural_freq - alone[2]).min() < 1e-9


def test_figure_18_modes_with_a_node_under_the_head_do_not_answer() -> None:
    etas = ("eta1", "eta2", "eta3", "eta4")
    frf = frequency_response(
        published_machine(), [1 / 2, 1 / 3], np.arange(1.0, 300.0), form="receptance", outputs=etas
    )
    size = np.abs(frf.data[:, :, 0]).max(axis=-1)
    assert (size[0, [1, 3]] < 1e-12 * size[0, 0]).all()
    assert size[1, 2] < 1e-12 * size[1, 0]
    assert size[0, 2] > 1e-6 * size[0, 0]
    assert (size[1, [1, 3]] > 1e-6 * size[1, 0]).all()


def test_figure_19_the_third_mode_is_missing_at_the_base() -> None:
    frf = frequency_response(published_machine(), [1 / 3], [281.3, 285.3, 289.3], outputs=("base_x",))
    left, middle, right = np.abs(frf.data[0, 0, 0])
    assert middle < 1.001 * max(left, right)
