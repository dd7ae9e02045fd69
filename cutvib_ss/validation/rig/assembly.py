"""A machine at a position as matrices with ports, whatever its kind."""

from __future__ import annotations

from cutvib_ss.validation.rig.frames import Frame
from cutvib_ss.validation.rig.multibody import Linearised, attached, build, linearise
from cutvib_ss.validation.rig.structure import Machinery, Rig


def assembled(machine: Machinery, position: float | None) -> Linearised:
    """Matrices and ports about the rest with what is fitted along ports; laws and elements without matrices are left."""
    if isinstance(machine, Rig) and position is not None:
        bare = linearise(build(machine, position))
    elif isinstance(machine, Frame):
        bare = machine.linearised()
    else:
        raise TypeError(f"{type(machine).__name__} at {position}: a cutting machine has a position, nothing else has")
    return attached(bare, machine.fittings)
