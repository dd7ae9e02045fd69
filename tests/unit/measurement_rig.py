"""A one-mode rig simulated exactly, for the tests of measurement, and a small campaign of made-up numbers."""

from pathlib import Path

import numpy as np
from scipy import signal

from cutvib_ss.measurement import Campaign, History, Record
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.second_order import Channel

FS = 2000.0
MASS, FREQ, ZETA = 2.0, 60.0, 0.01
_OVER = 32  # simulation steps a sample
_OMEGA = 2 * np.pi * FREQ


def accelerance(s):
    """The rig's accelerance at s."""
    return s**2 / (MASS * (s**2 + 2 * ZETA * _OMEGA * s + _OMEGA**2))


def response_to(force):
    """Acceleration of the rig at rest, for a force sampled `_OVER` times as fast as it is recorded (linear between)."""
    a = np.array([[0.0, 1.0], [-(_OMEGA**2), -2 * ZETA * _OMEGA]])
    system = (a, np.array([[0.0], [1 / MASS]]), a[1:], np.array([[1 / MASS]]))
    discrete = signal.cont2discrete(system, 1 / (FS * _OVER), method="foh")
    numerator, denominator = signal.ss2tf(*discrete[:4])
    return signal.lfilter(numerator[0], denominator, force)


def blow(peak=50.0, at=0.1, seconds=4.0, width=1e-3, second=None):
    """Force and acceleration of one blow (a Gaussian pulse: no power beyond fs/2), and of a second one where given."""
    time = np.arange(round(seconds * FS) * _OVER) / (FS * _OVER)
    force = peak * np.exp(-(((time - at) / width) ** 2) / 2)
    if second is not None:
        force = force + second[0] * np.exp(-(((time - second[1]) / width) ** 2) / 2)
    return force[::_OVER], response_to(force)[::_OVER]


_BLOWS = ((50.0, 0.1), (60.0, 0.103), (45.0, 0.0971), (52.0, 0.1), (48.0, 0.101))
_CLEAN: dict[tuple[int, float], tuple] = {}


def clean_blow(number, seconds=4.0):
    """The n-th of five blows, computed once."""
    if (number, seconds) not in _CLEAN:
        _CLEAN[number, seconds] = blow(*_BLOWS[number], seconds=seconds)
    return _CLEAN[number, seconds]


def impact(blows=3, force_noise=0.0, noise=0.0, offset=0.0, rng=None, seconds=4.0, turn=1.0):
    """An impact record of the rig, one channel `a`."""
    rng = rng or np.random.default_rng(0)
    histories = []
    for k in range(blows):
        force, motion = clean_blow(k, seconds)
        force = force + force_noise * rng.standard_normal(force.size) + offset
        motion = turn * motion + noise * rng.standard_normal(motion.size) - offset
        histories.append(History(FS, force, motion[np.newaxis], ("a",), f"blow {k + 1}"))
    return Record("r.csv", "impact", None, 50.0, None, ("a",), ("acceleration",), tuple(histories), averages=blows)


class OneMass:
    """A model of which only channels and input are known."""

    channels = {"a": Channel("drive", "acceleration")}
    input_port = "drive"
    input_quantity = "force"
    has_position = False


def small_campaign(folder=".", kind="impact", blows=2, samples=400, seed=0, channels=("tool_x", "tool_z", "base_x")):
    """A campaign on the published machine with made-up numbers: for what only reads and writes."""
    rng = np.random.default_rng(seed)
    histories = []
    for k in range(blows):
        force = 40 * np.exp(-(((np.arange(samples) - 60) / 3.0) ** 2))
        responses = np.cumsum(rng.standard_normal((len(channels), samples)), axis=1)
        histories.append(
            History(4000.0, force + 0.01 * rng.standard_normal(samples), responses, channels, f"blow {k + 1}")
        )
    record = Record(
        "records/p1.tdms", kind, 0.25, 50.0, "fit", channels, ("acceleration",) * len(channels), tuple(histories),
        averages=blows if kind == "impact" else 1, excitation="impact" if kind == "impact" else "multisine",
    )  # fmt: skip
    return Campaign('Königs Maschine "1"', Path(folder), published_machine(), (record,))


_LVM_HEAD = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t{decimal}
Multi_Headings\tYes
X_Columns\t{columns}
Time_Pref\tAbsolute
***End_of_Header***\t
\t
"""
_LVM_SEGMENT = """Channels\t2\t\t
Samples\t20\t20\t
Y_Unit_Label\tN\tg\t
X_Dimension\tTime\tTime\t
X0\t0.0\t0.0\t
Delta_X\t{step}\t{step}\t
***End_of_Header***\t\t\t
X_Value\tforce\ttool_x\tComment
"""


def lvm_text(blows=2, columns="One", decimal="."):
    """A LabVIEW measurement file with a segment per blow."""
    text = _LVM_HEAD.format(decimal=decimal, columns=columns)
    for blow in range(blows):
        text += _LVM_SEGMENT.format(step=f"0{decimal}001000")
        for k in range(20):
            x = "" if columns == "No" else f"{k * 0.001:.6f}"
            text += f"{x}\t{100 * blow + k:.6f}\t{-k:.6f}\n".replace(".", decimal)
        text += "\t\n" if blow < blows - 1 else ""
    return text
