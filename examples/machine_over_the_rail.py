"""
The published machine at two positions of its head: modes, a state-space plant for python-control, a Bode plot.

    python examples/machine_over_the_rail.py
"""

import control
import numpy as np

import cutvib_ss as cv
from cutvib_ss.plot import bode, save

machine = cv.published_machine()

for position in (1 / 3, 1 / 2):
    modes = cv.modes(machine, position)
    print(f"head at y/L = {position:.3f}")
    for freq, damping in zip(modes.natural_freq, modes.damping_ratio, strict=True):
        print(f"  {freq:7.2f} Hz, damping {100 * damping:.2f} %")

# The same machine as a state-space object, cutting force to acceleration of the tool, with python-control's own tools.
plant = machine.plant(position=0.5, inputs=["force"], outputs=["tool_x"], quantity="acceleration")
response = control.frequency_response(plant, [2 * np.pi * 217.0])
print(f"plant: {plant.nstates} states; accelerance at 217 Hz: {response.magnitude.item():.4f} m/s^2/N")

# In closed form, for many positions and frequencies at once.
frf = cv.frequency_response(machine, [1 / 3, 1 / 2], np.arange(10.0, 500.0, 0.5), form="accelerance")
save(bode(frf), "bode.png")
print("drawn: bode.png")
