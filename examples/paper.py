"""
The paper from Table 3 to Fig. 20: the head, the rail, the coupled machine's frequencies, and the tuned absorber's effect.

    python examples/paper.py
"""

import numpy as np

import cutvib_ss as cv
from cutvib_ss.absorber import check_absorber
from cutvib_ss.parameters import table_7
from cutvib_ss.plot import absorber_effect, bode, save

# Table 3 is the head of `published_machine`; the rail's mass follows from Table 6.
machine = cv.published_machine()
head = machine.head
print(f"Table 3: m1 {head.m1} kg, m2 {head.m2} kg, k1 {head.k1:.0f} and k2 {head.k2:.0f} N m/rad")

# Table 6: natural frequencies of the coupled machine, front centre and centre centre.
for name, position in (("FC", 1 / 2), ("CC", 1 / 3)):
    freq = cv.modes(machine, position).natural_freq[:6]
    print(f"Table 6, {name}: {', '.join(f'{f:.1f}' for f in freq)} Hz")

# Fig. 19: from the cutting force to the base, head in the centre.
save(bode(cv.frequency_response(machine, [1 / 3], np.arange(10.0, 500.0, 0.5), outputs=["base_x"])), "fig19.png")

# Table 7 and Fig. 20: the absorber on the tool.
check = check_absorber(machine, table_7(), [1 / 3, 1 / 2])
for position, reduction in zip(check.positions, check.reduction, strict=True):
    print(f"Fig. 20, y/L = {position:.2f}: accelerance at 217 Hz falls by {100 * reduction:.0f} %")
save(absorber_effect(check), "fig20.png")
