"""What may be fitted to the virtual machine, by fault or design. Plain data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Supports:
    """
    Springs and dampers under the rail's ends.

    Parameters
    ----------
    k_left, k_right : float
        Stiffness [N/m].
    c_left, c_right : float
        Damping [N s/m].
    """

    k_left: float
    k_right: float
    c_left: float = 0.0
    c_right: float = 0.0


@dataclass(frozen=True)
class Twist:
    """
    A rail that twists.

    Parameters
    ----------
    eccentricity : float
        Distance in Z of the head's first joint from the shear centre [m].
    inertia : float
        Polar moment of inertia of the whole rail [kg m^2].
    torsion_frequency : float
        First frequency of torsion, without the head [Hz].
    damping_ratio : float
        Damping ratio of that mode; damping goes with the rate of strain.
    """

    eccentricity: float
    inertia: float
    torsion_frequency: float
    damping_ratio: float


@dataclass(frozen=True)
class Shear:
    """
    Timoshenko's beam.

    Parameters
    ----------
    shear_ratio : float
        κGA L²/(π² EI).
    modulus_ratio : float
        κG/E of section and material; with the shear ratio it gives the rotary inertia.
    """

    shear_ratio: float
    modulus_ratio: float


@dataclass(frozen=True)
class Lump:
    """
    A mass on the rail.

    Parameters
    ----------
    position : float
        Where, y / L.
    mass : float
        Mass [kg].
    damping : float
        Damping to ground [N s/m].
    """

    position: float
    mass: float
    damping: float


@dataclass(frozen=True)
class Crack:
    """
    A hinge in the rail.

    Parameters
    ----------
    position : float
        Where, y / L.
    stiffness : float
        Rotational spring that holds it [N m/rad].
    """

    position: float
    stiffness: float


@dataclass(frozen=True)
class Oscillator:
    """
    A sprung mass.

    Parameters
    ----------
    place : str
        ``"tool"`` or ``"head"``.
    axis : str
        ``"x"`` or ``"z"``, the only direction in which it is felt.
    mass : float
        Mass [kg].
    frequency : float
        Natural frequency [Hz].
    damping_ratio : float
        Damping ratio.
    """

    place: str
    axis: str
    mass: float
    frequency: float
    damping_ratio: float


@dataclass(frozen=True)
class Spring:
    """
    A spring and damper between two places.

    Parameters
    ----------
    ends : (str, str)
        Two of ``"tool"``, ``"head"``, ``"base"`` and ``"ground"``.
    axis : str
        ``"x"`` or ``"z"``.
    stiffness : float
        Stiffness [N/m].
    damping : float
        Damping [N s/m].
    """

    ends: tuple[str, str]
    axis: str
    stiffness: float
    damping: float = 0.0


@dataclass(frozen=True)
class Viscoelastic:
    """
    A lossy torque in a joint.

    Parameters
    ----------
    joint : str
        ``"joint1"`` or ``"joint2"``.
    coefficient : float
        Of (iω)^order, or of i where the order is 0 (hysteresis) [N m/rad s^order].
    order : float
        0 (hysteresis) to 1 (viscous).
    """

    joint: str
    coefficient: float
    order: float


@dataclass(frozen=True)
class Law:
    """
    A nonlinear element.

    Parameters
    ----------
    port : str
        ``"joint1"``, ``"joint2"``, ``"rail_left"``, ``"rail_right"``, or the difference of two ports, ``"tool_x-base_x"``.
    kind : str
        Its law (`laws.KINDS`).
    values : tuple of float
        Its values (`laws.force`).
    """

    port: str
    kind: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class Fittings:
    """
    What is fitted to the plain machine; nothing by default.

    Parameters
    ----------
    supports : Supports, optional
        Springs under the rail's ends.
    fixity : (float, float)
        Rotational springs at the ends [N m/rad].
    twist : Twist, optional
        A rail that twists.
    shear : Shear, optional
        A rail that shears.
    lumps : tuple of Lump
        Masses on the rail.
    crack : Crack, optional
        A crack in the rail.
    guide : (float, float), optional
        Stiffness [N/m] and damping [N s/m] of a guide that gives between rail and head.
    oscillators : tuple of Oscillator
        Sprung masses.
    springs : tuple of Spring
        Springs between places.
    coupling : float
        Spring on the difference of the joints' angles [N m/rad].
    viscoelastic : tuple of Viscoelastic
        Lossy torques in joints.
    laws : tuple of Law
        Nonlinear elements.
    """

    supports: Supports | None = None
    fixity: tuple[float, float] = (0.0, 0.0)
    twist: Twist | None = None
    shear: Shear | None = None
    lumps: tuple[Lump, ...] = ()
    crack: Crack | None = None
    guide: tuple[float, float] | None = None
    oscillators: tuple[Oscillator, ...] = ()
    springs: tuple[Spring, ...] = ()
    coupling: float = 0.0
    viscoelastic: tuple[Viscoelastic, ...] = ()
    laws: tuple[Law, ...] = ()
