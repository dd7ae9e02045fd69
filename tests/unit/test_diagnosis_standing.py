"""What a fit leaves tells that nothing large is hidden only where no error of its own has taken that up."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from cutvib_ss.diagnosis.layout import Sizes
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.standing import leaves_noise_alone

# The smallest sizes of the priors.
SMALL = Sizes(drift=3e-5, nominal=3e-5, cause=1e-3, within=1e-3, parts=1e-3, losses=1e-3)


def _tuned(reduced: float = 1.02, sizes: Sizes = SMALL, **of_fit: object) -> Any:
    spread: Any = SimpleNamespace(sizes=sizes)
    spread.largest, spread.is_large = (
        (lambda name: Spread.largest(spread, name)),
        (lambda name: Spread.is_large(spread, name)),
    )
    fit = SimpleNamespace(spread=spread, **{"tuned_away": False, "calibrated_away": frozenset(), **of_fit})
    return SimpleNamespace(fit=fit, reduced=reduced)


def test_noise_alone() -> None:
    assert leaves_noise_alone(_tuned())
    assert not leaves_noise_alone(_tuned(reduced=2.0))
    assert not leaves_noise_alone(_tuned(tuned_away=True))
    assert not leaves_noise_alone(_tuned(calibrated_away=frozenset({"tool_x"})))


@pytest.mark.parametrize(
    ("name", "size", "alone"),
    [("nominal", 3e-4, True), ("nominal", 0.03, False), ("parts", 0.3, True), ("parts", 1.0, False)],
)
def test_what_an_error_of_the_model_has_taken_up_need_not_be_small(name: str, size: float, alone: bool) -> None:
    """A panel of 0.6 kg that resonates on the head left 1.02 of the noise beside elements that were off by 3 %."""
    assert leaves_noise_alone(_tuned(sizes=replace(SMALL, **{name: size}))) is alone
