"""Estimated responses of blows at unknown instants, against modes whose transforms over a block are known exactly."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.measurement.cut_responses import with_one_instant
from cutvib_ss.results import Estimator, MeasuredFrequencyResponse

BLOCK = 2.0
FREQ = np.arange(1001) / BLOCK
POLES = np.array([-0.5 + 148j, -2.9 + 412j, -2.8 + 780j, -40.0 + 1250j])
SHARES = np.array([[1.0, 0.7, 0.4, 0.3], [0.6, -0.9, 0.5, -0.4]])
NOISE = 2e-5


def seen(*blows: float, quantity: int = 1) -> np.ndarray:
    """Transform of the modes from each blow to the end of the block, mean of the blows; shape (channel, line)."""
    s = 2j * np.pi * FREQ[:, None]
    total = np.zeros((2, FREQ.size), dtype=np.complex128)
    for at in blows:
        for p, share in ((POLES, SHARES), (POLES.conj(), SHARES)):
            gain = p**quantity / (2j * POLES.imag) * np.where(p.imag > 0, 1.0, -1.0)
            total += share @ (gain * (1.0 - np.exp((p - s) * (BLOCK - at))) / (s - p)).T
    return total / len(blows)


def response(data: np.ndarray, blow_at: float | None = None, seed: int = 0) -> MeasuredFrequencyResponse:
    rng = np.random.default_rng(seed)
    scatter = NOISE / np.sqrt(2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
    moved = data + scatter
    # An input that is coupled to AC shows no line at zero.
    moved[:, 0] = 0.0
    return MeasuredFrequencyResponse(
        moved[None, :, None], FREQ, np.array([np.nan]), ("a", "b"), ("force",), ("velocity", "velocity"),
        variance=np.full((1, 2, 1, FREQ.size), NOISE**2), averages=3, estimator=Estimator(None, BLOCK, blow_at),
    )  # fmt: skip


def test_responses_are_cut_at_an_instant_that_is_known() -> None:
    instants = [(0.0496, 0.0503, 0.0511), (0.0521, 0.0523, 0.0519)]
    out = with_one_instant([response(seen(*at), seed=k) for k, at in enumerate(instants)])
    (blow_at,) = {r.estimator.blow_at for r in out}
    assert blow_at is not None
    assert 0.053 < blow_at < 0.08
    band = (FREQ > 0.4) & (FREQ < 350.0)
    expected = seen(blow_at)[:, band]
    for r, at in zip(out, instants, strict=True):
        before = np.abs(seen(*at)[:, band] - expected)
        left = np.abs(r.data[0, :, 0, band].T - expected)
        assert np.sqrt(np.mean(left**2)) < 1.3 * NOISE
        assert np.sqrt(np.mean(left**2)) < 0.1 * np.sqrt(np.mean(before**2))


@pytest.mark.parametrize("of", ["a stated instant", "all that rings", "no block", "what died out", "few lines"])
def test_others_are_left_as_they_are(of: str) -> None:
    r = response(seen(0.05), 0.05 if of == "a stated instant" else None)
    if of == "all that rings":
        r = response(seen(0.0))
    elif of == "no block":
        r = replace(r, estimator=Estimator(None))
    elif of == "what died out":
        s = 2j * np.pi * FREQ
        r = response(np.array([1.0 / (s + 30.0 - 400j) + 1.0 / (s + 30.0 + 400j)] * 2))
    elif of == "few lines":
        r = r.at_lines(slice(None, None, 2))
        r = replace(r, estimator=Estimator(None, BLOCK))
    (out,) = with_one_instant([r])
    assert out is r
