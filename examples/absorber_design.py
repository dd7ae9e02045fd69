"""
Absorbers for the whole rail: the best of Table 7's mass, one that bears tolerances, and what more mass would buy.

    python examples/absorber_design.py
"""

import numpy as np

import cutvib_ss as cv
from cutvib_ss.absorber import (
    AbsorberTolerance,
    HarmonicForce,
    MountedAbsorber,
    attach_absorbers,
    design_absorbers,
    mass_front,
    parametric_study,
    workspace_check,
)
from cutvib_ss.parameters import table_7
from cutvib_ss.plot import absorber_front, absorber_study, absorbers_over_the_rail, save

machine = cv.published_machine()
rail = np.arange(1, 40) / 40
pulses = HarmonicForce.pulses(rate=217.0, duty=0.3, rise=5e-4, fall=5e-4, peak=1.0)
box = AbsorberTolerance(frequency=0.02, damping_ratio=0.2, mass=0.01, rate=0.01)

# The study behind Table 7: every tuning and damping, judged by the worst position.
study = parametric_study(
    machine, rail, mass=0.08, tuning=np.arange(200.0, 250.5, 0.5), damping_ratio=np.arange(10, 51) / 1000
)
save(absorber_study(study, {"Table 7": table_7()}), "absorber_study.png")

# The optimum, exactly made; within tolerances; and within tolerances in the other direction.
judged = {"positions": rail, "force": pulses}
designs = {
    "best as designed, tool X": design_absorbers(machine, 0.08, **judged),
    "best in tolerance, tool X": design_absorbers(machine, 0.08, tolerance=box, **judged),
    "best in tolerance, tool Z": design_absorbers(machine, 0.08, ports=("tool_z",), tolerance=box, **judged),
}
checks = {"Table 7": workspace_check(machine, [MountedAbsorber(table_7())], tolerance=box, **judged)}
checks |= {name: workspace_check(machine, d.mounted, tolerance=box, **judged) for name, d in designs.items()}
for name, check in checks.items():
    without, exact, toleranced = check.worst
    print(f"{name}: {without:.2f} -> {exact:.2f} m/s^2 as designed, {toleranced:.2f} at worst within tolerance")
save(absorbers_over_the_rail(checks, "Absorbers of 0.08 kg under 217 Hz pulses of 1 N"), "absorbers_over_the_rail.png")

# Mass against the worst over the rail.
masses = np.geomspace(0.02, 0.4, 4)
fronts = {
    "tool X": mass_front(machine, masses, tolerance=box, **judged),
    "tool Z": mass_front(machine, masses, ports=("tool_z",), tolerance=box, **judged),
}
save(absorber_front(fronts, {"Table 7": checks["Table 7"]}), "absorber_front.png")

# The machine with the absorber is a machine like any other.
best = designs["best in tolerance, tool Z"].mounted
cv.write_machine(attach_absorbers(machine, best), "with_absorber.toml")
print(f"written: with_absorber.toml, {cv.read_machine('with_absorber.toml').plant(0.5).nstates} states")
