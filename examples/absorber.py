"""
A tuned vibration absorber on the tool: what Table 7's does at 217 Hz, and what it would do to a measured response.

    python examples/absorber.py
"""

import numpy as np

import cutvib_ss as cv
from cutvib_ss.absorber import absorbed_response, attach_absorber, check_absorber
from cutvib_ss.interchange import read_frf, write_frf
from cutvib_ss.parameters import table_7
from cutvib_ss.plot import absorber_effect, save

machine, absorber = cv.published_machine(), table_7()

check = check_absorber(machine, absorber)
for position, reduction in zip(check.positions, check.reduction, strict=True):
    print(f"y/L = {position:.3f}: accelerance at 217 Hz is less by {100 * reduction:.0f} %")
save(absorber_effect(check), "absorber.png")

# As a subsystem: the plant has two states more.
print(f"{machine.plant(0.5).nstates} states without, {attach_absorber(machine, absorber).plant(0.5).nstates} with it")

# On responses alone, without a model (Sherman-Morrison): here on an exported file that is read back.
write_frf(cv.frequency_response(machine, [0.5], np.arange(150.0, 300.0, 0.5)), "frf.csv")
measured = read_frf("frf.csv")
changed = absorbed_response(measured, absorber)
for name, frf in (("without", measured), ("with", changed)):
    peak = np.abs(frf.sel(output="tool_x").data[0, 0, 0])
    print(f"{name}: largest {peak.max():.2f} m/s^2/N at {frf.freq[peak.argmax()]:.1f} Hz")
