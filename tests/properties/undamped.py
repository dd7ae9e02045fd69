"""A machine with every damper taken out."""

from dataclasses import replace

from cutvib_ss.model.elements import SpringDamperMass, SprungMass
from cutvib_ss.model.machine import Machine


def _still(element: SpringDamperMass | SprungMass) -> SpringDamperMass | SprungMass:
    if isinstance(element, SprungMass):
        return replace(element, damping_ratio=0.0)
    return replace(element, damping=0.0, loss_stiffness=0.0)


def undamped(machine: Machine) -> Machine:
    """
    A machine without damping.

    Parameters
    ----------
    machine : Machine
        The machine.

    Returns
    -------
    Machine
        The same masses and springs.
    """
    rail = machine.rail
    return replace(
        machine,
        head=replace(machine.head, c1=0.0, c2=0.0),
        rail=replace(
            rail,
            parameters=replace(rail.parameters, damping_ratio=0.0, strain_damping=0.0),
            supports=rail.supports and replace(rail.supports, c_left=0.0, c_right=0.0),
            torsion=rail.torsion and replace(rail.torsion, damping_ratio=0.0),
            attachments=tuple(replace(a, element=_still(a.element)) for a in rail.attachments),
        ),
        attachments=tuple(replace(a, element=_still(a.element)) for a in machine.attachments),
        guide=machine.guide and replace(machine.guide, damping=0.0),
    )
