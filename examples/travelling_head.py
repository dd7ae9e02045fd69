"""
The head travels along the rail while the tool works: acceleration on the way, and the work of the drive.

    python examples/travelling_head.py
"""

import numpy as np

import cutvib_ss as cv
from cutvib_ss.plot import save, travel_histories
from cutvib_ss.response.moving import moving_response
from cutvib_ss.response.pulses import pulse_train
from cutvib_ss.response.travel import s_curve

machine = cv.published_machine()
fs = 217.0 * 32
way = s_curve(0.1, 0.9, speed=1.5, acceleration=8.0, jerk=200.0, length=machine.rail.parameters.length, begin=0.2)
force = pulse_train(fs, way.duration + 0.2, amplitude=100.0)

response = moving_response(machine, way, force, fs, outputs=["tool_x", "base_x"])
period = 32
rms = np.sqrt(np.convolve(response.data[0] ** 2, np.ones(period) / period, "same"))
settled = slice(int(0.1 * fs), -period)
worst = np.argmax(rms[settled]) + settled.start
print(
    f"tool_x on the way: {rms[settled].min():.0f} to {rms[settled].max():.0f} m/s^2 RMS, most at y/L = {response.path[worst]:.2f}"
)

e = response.energies
print(f"work of the force {e.force[-1]:.3f} J, of the drive {e.drive[-1]:.1e} J, lost {e.lost[-1]:.3f} J")
print(f"energy that does not add up: {np.abs(e.imbalance).max():.0e} J")
save(travel_histories(response.in_g()), "travelling_head.png")
