"""
The plants of all positions as one family: exact, as a table with a bound on its error, and as pictures over the rail.

    python examples/plants_over_the_rail.py
"""

import control
import numpy as np

import cutvib_ss as cv
from cutvib_ss.interchange import write_schedule
from cutvib_ss.model.position_dependence import position_dependence
from cutvib_ss.plot import bode_map, interpolation_error, save, schedule

machine = cv.published_machine()
rail = np.arange(1, 100) / 100
freq = np.arange(5.0, 600.0, 2.0)

# Exactly affine: constant matrices, weighed by the rail's shapes under the head and their products.
terms = position_dependence(machine.coupling())
print(f"{len(terms.names)} matrices: {', '.join(terms.names[:7])} ...")

# Natural frequencies against position, damping as colour, beside the map of the response.
frf = cv.frequency_response(machine, rail, freq, outputs=["tool_x", "tool_z"])
save(schedule(cv.track_modes(machine, rail), frf, marks=[217.0, 434.0]), "schedule.png")
save(bode_map(frf), "bode_map.png")

# A table of 33 plants in common states, and what it makes of the plants between.
family = cv.schedule(
    machine, np.linspace(0.01, 0.99, 33), outputs=["tool_x"], quantity="acceleration", interpolation="cubic"
)
half_way = (family.positions[:-1] + family.positions[1:]) / 2
response = np.abs(family.frequency_response(half_way, freq).data[:, 0, 0])
error, bound = family.error(half_way, freq)[:, 0, 0], family.error_bound(half_way, freq)[:, 0, 0]
print(f"error at most {error.max():.1e}, bound {bound.max():.1e}, response up to {response.max():.1f} m/s^2/N")
save(interpolation_error(freq, response, error, bound, "m/s^2/N", "33 plants, cubic between them"), "table_error.png")
write_schedule(family, "plants.mat")

# One gain for all positions, judged between the grid points too.
tool = cv.schedule(machine, family.positions, outputs=["tool_x"], quantity="velocity")
for gain in (0.0, 100.0):
    slowest = max(control.feedback(tool.exact(y), gain).poles().real.max() for y in half_way)
    print(f"velocity feedback of {gain:g} N s/m: every pole is left of {slowest:.2f} 1/s")
