"""Random machines and structures: any head and rail that could be built, with any slots filled."""

from dataclasses import replace
from math import radians
from typing import Any

import numpy as np
from hypothesis import strategies as st

from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.effects.parameter_shift import MACHINE_PARAMETERS
from cutvib_ss.model.elements import Attachment, Guide, SpringDamperMass, SprungMass
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.measurement_chain import ChannelChain, MeasurementChain
from cutvib_ss.model.rail import EndSupports, Rail, RailAttachment, Shear, Torsion
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.parameters import HeadParameters, RailParameters

FREQ = np.array([3.0, 24.6, 77.7, 151.3, 211.9, 240.4, 333.3, 480.1])
"""Frequencies of the comparisons [Hz]."""
POSITIONS = st.floats(0.01, 0.99)
SIDES = st.sampled_from(["head", "rail"])
"""Where base_x sits."""


def reals(low: float, high: float) -> st.SearchStrategy[float]:
    """
    Numbers even in the logarithm.

    Parameters
    ----------
    low, high : float
        Range.

    Returns
    -------
    SearchStrategy
        Of float.
    """
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


@st.composite
def heads(draw: st.DrawFn) -> HeadParameters:
    """Heads around the published one, wide."""
    return HeadParameters(
        m1=draw(reals(5.0, 60.0)), m2=draw(reals(0.1, 3.0)), l1=draw(reals(0.04, 0.3)), l2=draw(reals(0.04, 0.3)),
        theta01=radians(draw(st.floats(1.0, 25.0)) * draw(st.sampled_from([-1, 1]))),
        theta02=radians(draw(st.floats(40.0, 140.0))),
        k1=draw(reals(5e4, 3e6)), k2=draw(reals(1e3, 1e5)), c1=draw(reals(3.0, 100.0)), c2=draw(reals(0.05, 3.0)),
    )  # fmt: skip


@st.composite
def rail_parameters(draw: st.DrawFn, strained: bool = False) -> RailParameters:
    """Rails around the published one, wide; damped alike, mode by mode, or by the rate of strain too."""
    modes = draw(st.integers(1, 7))
    ratio = reals(0.002, 0.08)
    return RailParameters(
        length=draw(reals(0.8, 6.0)), mass=draw(reals(15.0, 300.0)), first_frequency=draw(reals(12.0, 80.0)),
        damping_ratio=draw(ratio | st.lists(ratio, min_size=modes, max_size=modes)), n_modes=modes,
        strain_damping=draw(st.just(0.0) | reals(1e-6, 1e-4)) if not strained else draw(reals(1e-6, 1e-4)),
    )  # fmt: skip


def elements() -> st.SearchStrategy[SpringDamperMass]:
    """Springs, dampers and masses to ground."""
    return st.builds(SpringDamperMass, reals(1e2, 1e5), reals(0.1, 30.0), reals(0.001, 0.5))


def attachments() -> st.SearchStrategy[tuple[Attachment, ...]]:
    """What may sit at the head's ports: up to two elements."""
    sprung = st.builds(SprungMass, reals(0.01, 2.0), reals(20.0, 400.0), reals(0.005, 0.2))
    one = st.builds(Attachment, st.sampled_from(("tool_x", "tool_z", "head_x")), st.one_of(elements(), sprung))
    at_joint = st.builds(
        Attachment, st.sampled_from(("joint1", "joint2")), st.builds(SpringDamperMass, reals(10.0, 1e4))
    )
    return st.lists(st.one_of(one, at_joint), max_size=2).map(tuple)


@st.composite
def rails(draw: st.DrawFn, torsion: bool = True) -> Rail:
    """Rails with supports, twist and attachments, or without."""
    springs = st.builds(SpringDamperMass, reals(1e3, 1e6))
    return Rail(
        draw(rail_parameters()),
        supports=draw(st.none() | st.builds(EndSupports, *[reals(1e5, 1e9)] * 2, *[reals(1.0, 1e4)] * 2)),
        torsion=draw(
            st.none() | st.builds(Torsion, st.floats(-0.1, 0.1), reals(0.1, 3.0), reals(40.0, 400.0), reals(0.003, 0.1))
        ) if torsion else None,
        attachments=draw(st.lists(
            st.builds(RailAttachment, elements(), st.floats(0.05, 0.95))
            | st.builds(RailAttachment, springs, st.sampled_from([0.0, 1.0]), st.just(True)),
            max_size=2,
        ).map(tuple)),
        shear=draw(st.none() | st.builds(Shear, reals(3.0, 300.0))),
    )  # fmt: skip


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    """Machines with any slot that changes their mechanics filled or empty."""
    return Machine(
        head=draw(heads()),
        rail=draw(rails()),
        attachments=draw(attachments()),
        guide=draw(st.none() | st.builds(Guide, reals(1e5, 1e9), reals(1.0, 1e4), SIDES)),
    )


@st.composite
def bare_machines(draw: st.DrawFn) -> Machine:
    """Machines with every slot empty."""
    return Machine(head=draw(heads()), rail=Rail(draw(rail_parameters())))


@st.composite
def full_machines(draw: st.DrawFn) -> Machine:
    """Machines with every slot filled, the measurement chain too."""
    some = SpringDamperMass(
        draw(reals(1e2, 1e5)), draw(reals(0.1, 30.0)), draw(reals(0.001, 0.5)), draw(reals(1.0, 1e3))
    )
    chain = st.builds(ChannelChain, st.floats(0.8, 1.2), st.floats(1e-5, 3e-4), st.floats(-0.3, 0.3))
    return Machine(
        head=draw(heads()),
        rail=Rail(
            draw(rail_parameters(strained=True)),
            EndSupports(*(draw(reals(1e6, 1e8)) for _ in "lr"), *(draw(reals(1.0, 1e4)) for _ in "lr")),
            Torsion(
                draw(st.floats(0.02, 0.1)), draw(reals(0.1, 3.0)), draw(reals(40.0, 400.0)), draw(reals(0.003, 0.1))
            ),
            (
                RailAttachment(some, draw(st.floats(0.05, 0.95))),
                RailAttachment(SpringDamperMass(draw(reals(1e3, 1e6))), 1.0, True),
            ),
            Shear(draw(reals(3.0, 300.0))),
        ),
        attachments=(
            Attachment("tool_x", SprungMass(draw(reals(0.01, 2.0)), draw(reals(20.0, 400.0)), draw(reals(0.005, 0.2)))),
            Attachment("joint2", SpringDamperMass(draw(reals(10.0, 1e4)), loss_stiffness=draw(reals(1.0, 1e3)))),
            Attachment("head_x", some),
        ),
        guide=Guide(draw(reals(1e6, 1e8)), draw(reals(1.0, 1e4))),
        chain=MeasurementChain(
            {"tool_x": draw(chain), "tool_z": draw(chain), "base_x": draw(chain)},
            cross_axis=draw(st.floats(-0.1, 0.1)),
            decay_rate=draw(st.floats(0.5, 20.0)),
        ),
    )


NO_FINITE_FORM = {"structural_damping"}


@st.composite
def chains(draw: st.DrawFn) -> MeasurementChain:
    """Measurement chains, ideal or not."""
    channel = st.builds(ChannelChain, st.floats(0.5, 2.0), st.floats(0.0, 3e-4), st.floats(-0.5, 0.5))
    return MeasurementChain(
        draw(st.dictionaries(st.sampled_from(("tool_x", "tool_z", "base_x")), channel)),
        cross_axis=draw(st.just(0.0) | st.floats(-0.3, 0.3)),
        decay_rate=draw(st.just(0.0) | st.floats(0.5, 20.0)),
    )


@st.composite
def stacked_machines(draw: st.DrawFn) -> Machine:
    """Bare machines with up to four linear effects of the catalogue, in any order and measured through any chain."""
    machine = draw(bare_machines())
    linear = sorted(name for name, kind in EFFECTS.items() if kind.linear and name not in NO_FINITE_FORM)
    for name in draw(st.lists(st.sampled_from(linear), max_size=4, unique=True)):
        kind = EFFECTS[name]
        place = draw(st.sampled_from(kind.places(machine)))
        values: dict[str, Any] = {"channel": "tool_z"} if name in ("channel_delay", "calibration_error") else {}
        if name == "parameter_shift":
            values["parameter"] = draw(st.sampled_from(MACHINE_PARAMETERS[place]))
        if name == "modal_truncation":
            values["n_modes"] = draw(st.integers(8, 40))
        for key, r in kind.ranges(machine, place).items():
            within = reals(r.low, r.high) if r.scale == "log" else st.floats(r.low, r.high)
            values[key] = draw(within)
        machine = kind(place=place, **values).apply(machine)
    chain = draw(st.none() | chains())
    return machine if chain is None else replace(machine, chain=chain)


@st.composite
def structures(draw: st.DrawFn) -> Structure:
    """Other structures: chains of masses, grounded or free, with force or base excitation, and attachments."""
    kind = draw(st.sampled_from(["force", "acceleration"]))
    n = draw(st.integers(2, 4))
    mass = np.diag([draw(reals(0.2, 20.0)) for _ in range(n)])
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        link = np.zeros(n)
        link[i] = 1.0
        if i:
            link[i - 1] = -1.0
        elif kind == "force" and draw(st.booleans()):  # on a shaker a free body would only ride along
            continue
        stiffness += draw(reals(1e3, 1e6)) * np.outer(link, link)
        damping += draw(reals(0.1, 50.0)) * np.outer(link, link)
    ports = {
        "first": np.eye(n)[0], "last": np.eye(n)[-1], "between": np.eye(n)[-1] - np.eye(n)[0], "all": np.ones(n),
    }  # fmt: skip
    sprung = st.builds(SprungMass, reals(0.01, 2.0), reals(20.0, 400.0), reals(0.005, 0.2))
    place = st.sampled_from(["first", "last", "between"])
    system = SecondOrder(mass, damping, stiffness, tuple(f"x{i}" for i in range(n)), ports)
    return Structure(
        system=system,
        channels={"y": Channel("last", "displacement"), "a": Channel("first", "acceleration")},
        input_port="first" if kind == "force" else "all",
        input_quantity=kind,
        scales=tuple(draw(reals(0.8, 1.25)) for _ in range(3)),
        parts=tuple(draw(reals(0.98, 1.02)) for _ in system.parts),
        attachments=draw(st.lists(st.builds(Attachment, place, st.one_of(elements(), sprung)), max_size=2).map(tuple)),
    )
