"""
H∞ against resonant control over the rail, and a controller that the nominal model likes and the corrected one does not.

    python examples/controllers.py
"""

import cutvib_ss as cv
from cutvib_ss.control_design import PROTOTYPES, Sampling, check_controller, check_positions, schedule
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.plot import controller_overview, controller_responses, save

nominal = cv.published_machine()
# What a diagnosis may find: the pillars under the rail's ends give. `diagnosis.corrected_machine` is such a machine.
corrected = SupportCompliance("rail_ends", k_left=1.3e7, k_right=3.0e7).apply(nominal)
machines = {"nominal": nominal, "corrected": corrected}

# An accelerometer on the tool; an inertial actuator on the head, or, lighter, on the tool itself; 10 kHz, one period late.
checks = []
for name, port in (("resonant", "head_x"), ("hinf", "head_x"), ("hinf", "tool_x")):
    kind = PROTOTYPES[name]
    hardware = kind.hardware(port, Sampling())
    if port == "tool_x":  # one controller serves the whole rail
        controller = kind.design(nominal, 0.5, hardware)
    else:  # the way from head to tool turns too much on the way: a family, interpolated
        controller = schedule(lambda y, k=kind, h=hardware: k.design(nominal, y, h), check_positions(21))
    check = check_controller(controller, machines, check_positions(10), hardware, f"{name}, {port}")
    checks.append(check)
    for machine in machines:
        worst = check.worst(machine)
        if worst.stable == worst.positions:
            print(
                f"{check.name} on the {machine} machine: {worst.attenuation:.2f} is left at 217 Hz at worst, "
                f"disk margin {worst.disk_margin:.2f}, {worst.effort:.2g} N per newton of cutting force"
            )
        else:
            print(
                f"{check.name} on the {machine} machine: stable at {worst.stable} of {worst.positions} positions, "
                f"worst at y/L = {worst.attenuation_position:.2f}"
            )

# Known, the corrected machine can be controlled as well.
kind, hardware = PROTOTYPES["hinf"], PROTOTYPES["hinf"].hardware("head_x", Sampling())
again = kind.design(corrected, 0.1, hardware)
worst = check_controller(again, corrected, [0.1], hardware).worst()
print(f"designed on the corrected machine, at y/L = 0.10: {worst.attenuation:.2f} is left")

save(controller_overview(checks), "controllers.png")
save(controller_responses(checks), "responses.png")
print("drawn: controllers.png, responses.png")
