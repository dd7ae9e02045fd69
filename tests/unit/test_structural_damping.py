"""Hysteretic damping: the causal form against Kramers and Kronig, against its limit, and against motion in time."""

import numpy as np
import pytest
from scipy.integrate import quad

from cutvib_ss.effects.structural_damping import StructuralDamping
from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.elements import CausalHysteresis
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modes import modes

K, ETA, F0 = 1.3e4, 0.12, 180.0
ELEMENT = CausalHysteresis(K, ETA, F0)


def whole(omega: float) -> complex:
    """Spring and hysteresis together at a frequency [rad/s]."""
    return complex(K + ELEMENT.dynamic_stiffness(np.array([1j * omega]))[0])


@pytest.mark.parametrize("ratio", [1e-3, 0.2, 1.0, 7.0, 1e3])
def test_the_loss_factor_is_the_same_at_all_frequencies_and_the_storage_k_at_the_reference(ratio: float) -> None:
    z = whole(2 * np.pi * F0 * ratio)
    assert z.imag / z.real == pytest.approx(ETA, rel=1e-12)
    assert z.real == pytest.approx(K * ratio ** (2 / np.pi * np.arctan(ETA)), rel=1e-12)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 3.0])
def test_storage_and_loss_are_those_of_a_causal_spring(ratio: float) -> None:
    # Kramers and Kronig, subtracted at no motion, where the stiffness is zero: K'(ω) = (2ω²/π) P∫ K''(u) / (u (ω² - u²)) du.
    omega = 2 * np.pi * F0 * ratio

    def loss(u: float) -> float:
        return whole(u).imag

    # With u = ω e^x the integral is over all x; the poles of e^x and e^-x on either side of zero cancel.
    def integrand(x: float) -> float:
        above, below = loss(omega * np.exp(x)), loss(omega * np.exp(-x)) * np.exp(2 * x)
        return (below - above) / np.expm1(2 * x)

    storage = 2 / np.pi * (quad(integrand, 1e-9, 1.0, limit=200)[0] + quad(integrand, 1.0, 300.0, limit=400)[0])
    assert storage == pytest.approx(whole(omega).real, rel=1e-5)


def test_at_the_reference_frequency_both_forms_are_the_same() -> None:
    constant, causal = (
        frequency_response(
            StructuralDamping("joint2", 0.2, form, 220.0).apply(published_machine()), [0.5], [220.0]
        ).data
        for form in ("constant", "causal")
    )
    assert np.abs(causal - constant).max() < 1e-12 * np.abs(constant).max()


@pytest.mark.parametrize("ratio", [0.5, 4.0])
def test_for_small_loss_the_storage_rises_by_2_eta_over_pi_per_unit_of_log_frequency(ratio: float) -> None:
    eta = 1e-5
    z = CausalHysteresis(K, eta, F0).dynamic_stiffness(np.array([2j * np.pi * F0 * ratio]))[0]
    assert z / (K * eta) == pytest.approx(1j + 2 / np.pi * np.log(ratio), rel=1e-4)


def test_modes_have_the_damping_of_the_loss_at_their_own_frequency() -> None:
    machine = published_machine()
    constant, causal = (
        StructuralDamping("joint2", 0.01, form, 218.0).apply(machine) for form in ("constant", "causal")
    )
    close, found = modes(constant, 0.5), modes(causal, 0.5)
    assert found.natural_freq == pytest.approx(close.natural_freq, rel=1e-2)
    for r in (0, 2, 3, 4):  # the others have a node at midspan
        assert found.damping_ratio[r] == pytest.approx(close.damping_ratio[r], rel=0.02)
        # At its pole the response is without bound.
        pole = found.poles[r]
        peak, at_pole = (
            np.abs(
                frequency_response(causal, [0.5], [pole.imag / (2 * np.pi)], form="receptance", decay_rate=rate).data
            ).max()
            for rate in (0.0, pole.real)
        )
        assert at_pole > 1e6 * peak


def test_a_plant_asks_for_an_equivalent_and_a_wrong_form_for_a_right_one() -> None:
    applied = StructuralDamping("joint2", 0.05, "causal").apply(published_machine())
    with pytest.raises(CouplingError, match="equivalent viscous"):
        applied.plant(0.5)
    with pytest.raises(ParameterError, match="not one of constant, causal"):
        StructuralDamping("joint2", 0.05, "complex")
