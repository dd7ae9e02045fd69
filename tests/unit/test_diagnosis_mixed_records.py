"""Continuous recordings beside estimated responses: each is predicted as it has to be, simulated or in closed form."""

from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from cutvib_ss import read_campaign
from cutvib_ss.diagnosis import cross_validation
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.workers import Workers

MASS, DAMPING, STIFFNESS = 10.0, 60.0, 4e4
FS, SAMPLES = 200.0, 8192
MACHINE = f"""
[model]
kind = "second_order"
dofs = ["x"]
mass = [[{MASS}]]
damping = [[{DAMPING}]]
stiffness = [[{STIFFNESS}]]
[ports]
mount = [1]
[channels]
y = {{ port = "mount", quantity = "displacement" }}
[input]
force = "mount"
[tolerance]
mass = 0.01
damping = 0.1
stiffness = 0.02
calibration = 0.01
"""
RECORD = """
[[record]]
file = "{0}.csv"
kind = "{1}"
session = "{0}"
band_hz = [2.0, 40.0]
{2}
"""


@pytest.fixture
def campaign(tmp_path: Path):
    """Random on two days and a stepped sine on a third, the mount softer or stiffer by up to 1.5 % each day."""
    rng, records = np.random.default_rng(5), ""
    for day, stiffer in (("mon", 0.012), ("tue", -0.015)):
        system = signal.StateSpace(
            [[0, 1], [-STIFFNESS * (1 + stiffer) / MASS, -DAMPING / MASS]], [[0], [1 / MASS]], [[1, 0]], 0
        )
        t, force = np.arange(SAMPLES) / FS, 20.0 * rng.standard_normal(SAMPLES)
        motion = signal.lsim(system, force, t)[1]
        motion += 1e-3 * motion.std() * rng.standard_normal(SAMPLES)
        np.savetxt(
            tmp_path / f"{day}.csv", np.c_[t, force, motion], delimiter=",", header="t [s],force [N],y [m]", comments=""
        )
        records += RECORD.format(day, "timeseries", "block = 5.12")
    freq = np.arange(5.0, 20.0, 0.1)
    s = 2j * np.pi * freq
    response = 1.0 / (MASS * s**2 + DAMPING * s + STIFFNESS * 1.01)
    response += 1e-3 * np.abs(response) * (rng.standard_normal(freq.size) + 1j * rng.standard_normal(freq.size))
    np.savetxt(
        tmp_path / "wed.csv", np.c_[freq, response.real, response.imag], delimiter=",",
        header="freq [Hz],y re [m/N],y im [m/N]", comments="",
    )  # fmt: skip
    records += RECORD.format("wed", "frf", 'excitation = "sine"\npeak_force = 20')
    (tmp_path / "machine.toml").write_text(MACHINE)
    (tmp_path / "campaign.toml").write_text('[campaign]\ntitle = ""\nmachine = "machine.toml"\n' + records)
    return read_campaign(tmp_path)


def test_drift_of_a_held_out_day_is_known_whatever_was_recorded(campaign) -> None:
    seen = observe(campaign, campaign.machine)
    none = fit(campaign.machine, Records(seen.entries), Hypothesis())
    with Workers() as workers:
        judged = cross_validation.judge(campaign.machine, cross_validation.folds(seen, None, 0), none, workers)
    assert [j.entry.leaks for j in judged] == [True, True, False]
    for j in judged:
        # As it is predicted it is off by what the day has moved; how far days move, two of them tell about.
        assert np.mean(np.abs(j.residual) ** 2 / j.entry.variance) > 30.0
        assert j.chi2.max() < 10.0
