"""
The pneumatic tool's pulses on the machine, with and without Table 7's absorber: steady state, start from rest, force on the ends.

    python examples/pulses.py
"""

import cutvib_ss as cv
from cutvib_ss.absorber import attach_absorber
from cutvib_ss.parameters import table_7
from cutvib_ss.plot import save, time_histories

RATE, FS = 217.0, 217.0 * 128
machine = cv.published_machine()
machines = {"without": machine, "with the absorber": attach_absorber(machine, table_7())}

# One period is enough for the periodic steady state.
period = cv.pulse_train(FS, 1 / RATE, rate=RATE, duty=0.3, amplitude=100.0)
for name, m in machines.items():
    steady = cv.time_response(m, 0.5, period, FS, outputs=["tool_x", "rail_left_force"], start="periodic")
    tool = steady.sel(output="tool_x").in_g()
    end = steady.sel(output="rail_left_force").peak().item()
    print(f"{name}: tool {tool.rms().item():.2f} g RMS, {tool.peak().item():.2f} g peak; left end {end:.0f} N peak")

# From rest the tool needs a while to get there; a little jitter, as valves have it, fills the gaps between the harmonics.
force = cv.pulse_train(FS, 0.5, rate=RATE, duty=0.3, amplitude=100.0, jitter=0.01)
for name, m in machines.items():
    response = cv.time_response(m, 0.5, force, FS, outputs=["tool_x", "tool_z"])
    save(time_histories(response, title=name), f"pulses_{'with' if 'with ' in name else 'without'}.png")
