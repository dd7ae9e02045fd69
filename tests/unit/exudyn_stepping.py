"""
The same machine stepped by exudyn itself: large rotations, contacts and friction as exudyn's own elements.

Some minutes a campaign, and so not what campaigns are made with; it is what `motion` is held against.
"""

from __future__ import annotations

from collections.abc import Callable

import exudyn as exu
import numpy as np
from exudyn import itemInterface as item
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from cutvib_ss.validation.rig.fittings import Law
from cutvib_ss.validation.rig.multibody import Machine, build
from cutvib_ss.validation.rig.structure import Rig

Array = NDArray[np.float64]


def stepped(rig: Rig, position: float, force: Array, fs: float, highest: float = 2500.0) -> Array:
    """Accelerations from rest, by Runge and Kutta's fourth order."""
    machine = build(rig, position, highest, assemble=False)
    system = machine.system
    for law in rig.fittings.laws:
        _add(machine, law)

    def drive(_: object, t: float, __: object) -> list[float]:
        return [0.0, float(smooth(t * fs)), 0.0]

    smooth = CubicSpline(np.arange(force.size), force)
    system.AddLoad(item.Force(markerNumber=machine.markers["tool"], loadVector=[0.0] * 3, loadVectorUserFunction=drive))
    sensors = [
        system.AddSensor(
            item.SensorKinematicTree(
                objectNumber=machine.tree,
                linkNumber=machine.on_tree[place][0],
                localPosition=[machine.on_tree[place][1], 0.0, 0.0],
                outputVariableType=exu.OutputVariableType.Acceleration,
                storeInternal=True,
                writeToFile=False,
            )
        )
        for place in ("tool", "base")
    ]
    system.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = force.size - 1
    settings.timeIntegration.endTime = (force.size - 1) / fs
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = 1e-9  # every step
    settings.linearSolver.solverType = exu.LinearSolverType.EXUdense
    system.SolveDynamic(settings, solverType=exu.DynamicSolverType.RK44)
    tool, base = (np.array(system.GetSensorStoredData(sensor))[:, 1:] for sensor in sensors)
    return np.array([tool[:, 1], tool[:, 0], base[:, 1]])


def _add(machine: Machine, law: Law) -> None:
    """One of exudyn's elements between a joint and ground, beside the joint's spring."""
    system = machine.system
    ground = system.AddMarker(
        item.MarkerNodeCoordinate(nodeNumber=system.AddNode(item.NodePointGround()), coordinate=0)
    )
    pair = [ground, machine.joints[law.port]]
    memory = {
        "nodeNumber": system.AddNode(item.NodeGenericData(initialCoordinates=[0.0] * 3, numberOfDataCoordinates=3))
    }
    v = law.values
    if law.kind == "freeplay":
        # the joint's own spring is outweighed, and contacts stand at ±gap
        stops = {"limitStopsUpper": v[0], "limitStopsLower": -v[0], "limitStopsStiffness": v[1], "useLimitStops": True}
        system.AddObject(item.CoordinateSpringDamperExt(markerNumbers=pair, stiffness=-v[1], **stops, **memory))
    elif law.kind == "jenkins":
        friction = {"stickingStiffness": v[1], "dynamicFrictionForce": v[0]}
        system.AddObject(item.CoordinateSpringDamperExt(markerNumbers=pair, **friction, **memory))
    else:
        torques: dict[str, Callable[[float, float], float]] = {
            "cubic": lambda u, rate: v[0] * u**3,
            "bilinear": lambda u, rate: v[0] * abs(u),
            "quadratic_damping": lambda u, rate: v[0] * rate * abs(rate),
        }
        torque = torques[law.kind]

        def answer(_: object, t: float, n: int, u: float, rate: float, k: float, d: float, offset: float) -> float:
            return float(torque(u, rate))

        system.AddObject(item.CoordinateSpringDamper(markerNumbers=pair, springForceUserFunction=answer))
