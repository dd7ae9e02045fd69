"""The campaign's estimator, predicted: against a simulation in time, and derivatives against differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from cutvib_ss.diagnosis.prediction import Prediction, gained, light_poles
from cutvib_ss.diagnosis.records import Group, merged
from cutvib_ss.diagnosis.simulated import simulated as stepped_in_time
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.window_damping import WindowDamping
from cutvib_ss.measurement.replay import Replay
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.paths import value_at, with_value
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from tests.unit.record_example import entry_of

CHANNELS = ("tool_x", "tool_z", "base_x")
BLOCK, BLOW_AT = 2.0, 0.0525


def group(blow_at=BLOW_AT, decay_rate=0.0, positions=(0.17, 0.5), quantity="acceleration"):
    freq = np.arange(15.0, 400.0, 0.5)
    shape = (len(positions), len(CHANNELS), freq.size)
    full = np.full(len(positions), BLOCK)
    return Group(
        np.array(positions), freq, CHANNELS, (quantity,) * 3, np.zeros(shape, complex), np.ones(shape),
        full, np.full(len(positions), blow_at), np.full(len(positions), decay_rate),
    )  # fmt: skip


def simulated(machine, position, decay_rate=0.0, fs=4000.0):
    """FRF of a simulated blow in a boxcar block: the response by the plant's own matrix exponential."""
    plant = machine.plant(position, outputs=CHANNELS, quantity="displacement")
    time = np.arange(round(BLOCK * fs)) / fs
    # A blow of one sample is a rectangle from sample to sample for a zero-order hold.
    force = np.zeros(time.size)
    force[round(BLOW_AT * fs)] = 1000.0
    discrete = signal.cont2discrete((plant.A, plant.B, plant.C, plant.D), 1 / fs)[:4]
    _, response, _ = signal.dlsim((*discrete, 1 / fs), force)
    window = np.exp(-decay_rate * time)
    spectrum = np.fft.rfft(response.T * window) / np.fft.rfft(force)
    freq = np.fft.rfftfreq(time.size, 1 / fs)
    # The rectangle lasts one sample more than its own transform says: its delay and sinc, taken out.
    s = decay_rate + 2j * np.pi * freq
    with np.errstate(invalid="ignore", divide="ignore"):
        hold = np.where(s == 0, 1.0, (1 - np.exp(-s / fs)) / (s / fs))
    return freq, spectrum / hold


@pytest.mark.parametrize("decay_rate", [0.0, 2.0])
def test_truncated_block_is_predicted(decay_rate):
    machine = published_machine()
    g = group(decay_rate=decay_rate, quantity="displacement")
    plain = Prediction(machine, g)
    predicted = plain.data
    assert plain.circles.points.size > 0
    for i, position in enumerate(g.positions):
        freq, spectrum = simulated(machine, position, decay_rate)
        lines = np.searchsorted(freq, g.freq)
        low = g.freq < 60.0
        for c in range(3):
            scale = np.abs(spectrum[c, lines][low]).max()
            error = np.abs(predicted[i, c] - spectrum[c, lines])[low].max() / scale
            assert error < 1e-3
    if decay_rate == 0.0:
        # Without the correction the slow mode would be off by percents.
        untouched = plain.untruncated
        assert np.abs(untouched - predicted).max() / np.abs(predicted[:, 2]).max() > 0.01


def test_nothing_is_cut_off_an_endless_block():
    g = group()
    endless = Group(**{**vars(g), "block": np.full(2, np.inf)})
    prediction = Prediction(published_machine(), endless)
    assert prediction.circles.points.size == 0
    np.testing.assert_array_equal(prediction.data, prediction.untruncated)


PATHS = [
    ("head", "k1"),
    ("head", "l2"),
    ("rail", "parameters", "mass"),
    ("rail", "parameters", "first_frequency"),
    ("rail", "parameters", "damping_ratio"),
]


@pytest.mark.parametrize("path", PATHS, ids=lambda p: ".".join(p))
def test_derivative_includes_what_is_cut_off(path):
    machine, g = published_machine(), group()
    derivative = Prediction(machine, g).derivative(((path, 1.0),))
    value = value_at(machine, path)
    step = 1e-6 * value
    up, down = (Prediction(with_value(machine, path, value + h), g).data for h in (step, -step))
    difference = (up - down) / (2 * step)
    assert np.abs(derivative - difference).max() < 1e-5 * np.abs(difference).max()


def test_derivative_to_an_unknown_blow():
    machine, g = published_machine(), group(blow_at=np.nan, decay_rate=1.0)
    derivative = Prediction(machine, g, 0.05).by_blow_at()
    up, down = (Prediction(machine, g, 0.05 + h).data for h in (1e-6, -1e-6))
    assert np.abs(derivative - (up - down) / 2e-6).max() < 1e-6 * np.abs(derivative).max()


def test_circles_of_a_model_close_by_serve():
    machine, g = published_machine(), group()
    first = Prediction(machine, g)
    close = with_value(machine, ("rail", "parameters", "first_frequency"), 31.705)
    far = with_value(machine, ("rail", "parameters", "first_frequency"), 33.0)
    assert Prediction(close, g, circles=first.circles).circles is first.circles
    moved = Prediction(far, g, circles=first.circles)
    assert moved.circles is not first.circles
    exact = Prediction(close, g).data
    scale = np.abs(exact).max()
    assert np.abs(Prediction(close, g, circles=first.circles).data - exact).max() < 1e-5 * scale


def test_circles_that_are_kept_serve_another_instant_of_the_blow():
    machine, g = published_machine(), group(blow_at=np.nan, quantity="displacement")
    first = Prediction(machine, g, 0.05)
    later = Prediction(machine, g, 0.06, first.circles)
    assert later.circles is first.circles
    np.testing.assert_array_equal(later.data, Prediction(machine, g, 0.06).data)
    assert np.abs(later.data - first.data).max() > 1e-3 * np.abs(first.data).max()


@pytest.mark.parametrize(
    "effect",
    [LocalResonator("head", 1.0, 200.0, 0.02, 0.4), WindowDamping("measurement", 3.0, 0.02)],
    ids=lambda e: e.effect,
)
def test_effects_are_seen_through_the_estimator(effect):
    machine, g = published_machine(), group()
    applied = effect.apply(machine)
    moves = effect.moved_by(machine, applied)
    base = Prediction(applied, g)
    for name, carried in moves.items():
        value = getattr(effect, name)
        step = 1e-6 * (value or 1.0)
        fields = dict(vars(effect))
        up, down = (
            Prediction(type(effect)(**{**fields, name: value + h}).apply(machine), g).data for h in (step, -step)
        )
        difference = (up - down) / (2 * step)
        assert np.abs(base.derivative(carried) - difference).max() < 1e-5 * np.abs(difference).max()


def test_blows_of_finite_length_in_short_blocks_are_seen_as_they_are_simulated():
    # A slow mode is alive at the end; the blow lasts 6 ms, the record has a clock that shows.
    machine, fs, size = published_machine(), 2048.0, 1024
    time = np.arange(size) / fs
    force = 60.0 * np.where((time >= 0.1) & (time < 0.106), np.sin(np.pi * (time - 0.1) / 0.006) ** 2, 0.0)
    lines = np.arange(10, 120)
    freq, shape = lines * fs / size, (3, lines.size)
    entry = entry_of(
        0, 0.3, 60.0, np.ones(shape, complex), np.ones(shape), freq, CHANNELS, ("acceleration",) * 3,
        block=size / fs, blow_at=0.103, replay=Replay((force,), fs, lines),
    )  # fmt: skip
    (whole,) = merged([entry])
    stepped = stepped_in_time(machine, whole, steps=40.0).data
    seen, impulse = Prediction(machine, whole).data, Prediction(machine, replace(whole, entries=())).data
    # Between the resonances an impulse without a clock is off by far more.
    assert np.abs(seen - stepped).max() < 1e-3 * np.abs(stepped).max()
    assert np.median(np.abs(impulse - stepped)) > 4.0 * np.median(np.abs(seen - stepped))


@pytest.mark.parametrize(("quantity", "order"), [("displacement", 0), ("velocity", 1), ("acceleration", 2)])
def test_what_nothing_holds_goes_on_moving_after_the_blow(quantity, order):
    """Two masses of 1 kg on a spring between them: after a unit impulse on one it moves by t/2 + e^(-σt) sin(ωt)/2ω."""
    sigma, w, time_left = 2.0, 2 * np.pi * 20.0, 1.9
    k, c = (w**2 + sigma**2) / 2.0, sigma
    link = np.array([[1.0, -1.0], [-1.0, 1.0]])
    system = SecondOrder(np.eye(2), c * link, k * link, ("q1", "q2"), {"p1": np.array([1.0, 0.0])})
    free = Structure(system, {"y": Channel("p1", quantity)}, "p1")
    freq = np.arange(1.0, 60.0, 0.5)
    entry = entry_of(
        0, None, 60.0, np.ones((1, freq.size), complex), np.ones((1, freq.size)), freq, ("y",), (quantity,),
        block=time_left + 0.1, blow_at=0.1,
    )  # fmt: skip
    (g,) = merged([entry])
    s = 2j * np.pi * freq
    # Transforms of both motions over the rest of the block; of an acceleration the impulse itself.
    end = np.exp(-s * time_left)
    exact = {0: (1 - end * (1 + s * time_left)) / s**2 / 2, 1: (1 - end) / s / 2, 2: np.ones(s.size)}[order]
    for pole in (-sigma + 1j * w, -sigma - 1j * w):
        exact = exact + pole**order * (1 - np.exp((pole - s) * time_left)) / (s - pole) / (4j * pole.imag)
    found = Prediction(free, g).data[0, 0]
    assert np.abs(found - exact).max() < 1e-5 * np.abs(exact).max()


def test_what_rounding_leaves_of_a_rigid_motion_is_no_pole():
    """Stiffnesses with digits cut off: the rigid motion gets a square of 1e-13 of the largest, and a decay of rounding."""
    k = (2 * np.pi * 20.0) ** 2 / 2.0
    link = np.array([[1.0, -1.0], [-1.0, 1.0]])
    off = 1e-13 * np.diag([1.0, 0.0])
    system = SecondOrder(np.eye(2), 1.0 * (link + off), k * (link + off), ("q1", "q2"), {"p1": np.array([1.0, 0.0])})
    free = Structure(system, {"y": Channel("p1", "acceleration")}, "p1")
    (poles,) = light_poles(free, np.array([np.nan]))
    assert poles.size == 1
    assert abs(poles[0]) == pytest.approx(2 * np.pi * 20.0, rel=1e-6)


def test_a_gain_over_frequency_comes_before_the_blocks_end():
    # One mode of 0.3 % damping, of which a third is left when the block ends, behind a first-order low-pass filter.
    omega, ratio, filtered = 2 * np.pi * 30.0, 0.003, 1.0 / 2000.0
    one = SecondOrder(np.eye(1), np.array([[2 * ratio * omega]]), np.array([[omega**2]]), ("x",), {"p": [1.0]})
    model = Structure(one, {"y": Channel("p", "displacement")}, "p")
    freq = np.arange(5.0, 80.0, 0.5)
    shape = (1, 1, freq.size)
    g = Group(
        np.array([np.nan]), freq, ("y",), ("displacement",), np.zeros(shape, complex), np.ones(shape),
        np.array([BLOCK]), np.array([BLOW_AT]), np.zeros(1),
    )  # fmt: skip
    s, pole = 2j * np.pi * freq, omega * (-ratio + 1j * np.sqrt(1 - ratio**2))

    def shown(gain_at_pole, residue_of_filter):
        """Transform of the motion from blow to end, by partial fractions."""
        residue = gain_at_pole / (pole - pole.conjugate())
        parts = [(pole, residue), (pole.conjugate(), residue.conjugate()), (-1.0 / filtered, residue_of_filter)]
        return sum(r * -np.expm1((p - s) * (BLOCK - BLOW_AT)) / (s - p) for p, r in parts)

    prediction = Prediction(model, g)
    np.testing.assert_allclose(prediction.data[0, 0], shown(1.0, 0.0), atol=1e-5 * np.abs(prediction.data).max())
    of_filter = 1.0 / (filtered * abs(-1.0 / filtered - pole) ** 2)
    measured = shown(1.0 / (1.0 + pole * filtered), of_filter)

    def gain(f):
        return 1.0 / (1.0 + 2j * np.pi * np.atleast_2d(f) * filtered)

    behind, before = (
        np.abs(d / measured - 1.0).max() for d in (prediction.data * gain(freq), gained(prediction, gain))
    )
    assert behind > 0.02
    assert before < 0.05 * behind
