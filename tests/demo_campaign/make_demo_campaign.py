"""
Make the demonstration campaign: hammer blows on a virtual cutting machine that has something its nominal model lacks.

This script knows nothing of the package. It has its own physics, so that a diagnosis of its records is not a model
compared with itself:

- the rail is a beam of Hermite finite elements (Euler-Bernoulli, consistent mass), damped in each of its own modes;
- the head is a planar linkage whose masses follow from where they move: its Jacobian is taken numerically from the
  kinematics, its mass matrix is Jᵀ diag(m) J;
- motion is integrated exactly in complex modes, for a force that is straight between samples sixteen times finer than
  the record's, then filtered and decimated as a digitiser does;
- every value of the machine is off by its tolerance, every accelerometer by a smooth percent of calibration, and there
  is noise on every channel.

What the machine has and the model lacks is drawn from the seed. Nothing of it is written into the campaign's folder.

    python tests/demo_campaign/make_demo_campaign.py cutvib_ss/data/demo
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from numpy.typing import NDArray
from scipy import linalg, signal

SEED = 1
POSITIONS = (0.06, 0.27, 0.46, 0.68, 0.9)
BLOWS = 3
PEAK_FORCE = 60.0  # N, nominal
SAMPLING = 2048  # Hz
SAMPLES = 4096
OVERSAMPLING = 16
PRE_TRIGGER = 0.05  # s
ELEMENTS = 60
NOISE = {"force": 0.005, "tool_x": 0.02, "tool_z": 0.02, "base_x": 0.02}  # N, m/s^2, one standard deviation
FULL_SCALE = {"force": 500.0, "tool_x": 500.0, "tool_z": 500.0, "base_x": 50.0}  # of 24-bit converters
UNIT = {"force": "N", "tool_x": "m/s^2", "tool_z": "m/s^2", "base_x": "m/s^2"}

# name: (value, one standard deviation as a fraction of it)
NOMINAL = {
    "m1": (24.88, 0.005), "m2": (0.60, 0.01), "l1": (0.097, 0.003), "l2": (0.096, 0.003),
    "k1": (522100.0, 0.01), "k2": (10442.0, 0.01), "c1": (44.20, 0.1), "c2": (0.58, 0.1),
    "mass": (76.5, 0.005), "first_frequency": (31.7, 0.005), "damping_ratio": (0.01, 0.15),
}  # fmt: skip
ANGLES = (np.radians(0.65), np.radians(110.0))
LENGTH = 2.5
CALIBRATION = 0.01

MACHINE_TOML = """\
# The nominal machine: what its builder believes of it.
[head]
m1 = 24.88          # kg
m2 = 0.60           # kg
l1 = 0.097          # m
l2 = 0.096          # m
theta01_deg = 0.65
theta02_deg = 110.0
k1 = 522100.0       # N m/rad
k2 = 10442.0        # N m/rad
c1 = 44.20          # N m s/rad
c2 = 0.58           # N m s/rad

[rail]
length = 2.5             # m
mass = 76.5              # kg, the whole rail
first_frequency = 31.7   # Hz, pinned ends, without the head
damping_ratio = 0.01     # of every mode
n_modes = 20

# How well each value is known: one standard deviation, as a fraction of the value.
[tolerance]
m1 = 0.005
m2 = 0.01
l1 = 0.003
l2 = 0.003
k1 = 0.01
k2 = 0.01
c1 = 0.1
c2 = 0.1
mass = 0.005
first_frequency = 0.005
damping_ratio = 0.15
calibration = 0.01       # of each response channel's sensitivity
"""


@dataclass(frozen=True)
class Hidden:
    """What the virtual machine has and its nominal model lacks; only one of the two is there."""

    supports: tuple[float, float, float, float] | None = None  # k_left, k_right [N/m], c_left, c_right [N s/m]
    resonator: tuple[float, float, float] | None = None  # mass [kg], frequency [Hz], damping ratio; on the head in X


def draw_hidden(rng: np.random.Generator) -> Hidden:
    """Ends of the rail that give, or something that resonates on the head; each clear of the tolerances."""
    if rng.integers(2):
        k_left, k_right = np.exp(rng.uniform(np.log(8e6), np.log(4e7), 2))
        return Hidden(supports=(k_left, k_right, 1e-5 * k_left, 1e-5 * k_right))
    return Hidden(resonator=(rng.uniform(0.8, 1.6), rng.uniform(150.0, 300.0), rng.uniform(0.02, 0.05)))


def draw_as_built(rng: np.random.Generator) -> dict[str, float]:
    """The machine's true values, off the nominal ones by their tolerances."""
    return {name: value * (1.0 + tolerance * rng.standard_normal()) for name, (value, tolerance) in NOMINAL.items()}


def hermite_beam(nodes: NDArray[np.float64], mass_per_length: float, bending: float) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness of a free beam; degrees of freedom are deflection and slope at each node in turn."""
    n = 2 * nodes.size
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    for e, h in enumerate(np.diff(nodes)):
        m = mass_per_length * h / 420.0 * np.array(
            [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
             [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]
        )  # fmt: skip
        k = bending / h**3 * np.array(
            [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2],
             [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
        )  # fmt: skip
        at = slice(2 * e, 2 * e + 4)
        mass[at, at] += m
        stiffness[at, at] += k
    return mass, stiffness


def modal_damping(mass: np.ndarray, stiffness: np.ndarray, ratio: float) -> np.ndarray:
    """Damping matrix that gives every mode of (mass, stiffness) the same ratio."""
    squared, shapes = linalg.eigh(stiffness, mass)
    weighted = mass @ shapes
    damping: np.ndarray = weighted @ np.diag(2.0 * ratio * np.sqrt(squared)) @ weighted.T
    return damping


def mass_positions(joints: np.ndarray, built: dict[str, float]) -> np.ndarray:
    """Where the head's two masses are: x1, z1, x2, z2, for the joint rotations and the base's motion (X down)."""
    first = ANGLES[0] + joints[0]
    second = first + ANGLES[1] + joints[1]
    x1 = joints[2] + built["l1"] * np.sin(first)
    z1 = built["l1"] * np.cos(first)
    return np.array([x1, z1, x1 + built["l2"] * np.sin(second), z1 + built["l2"] * np.cos(second)])


def head_jacobian(built: dict[str, float]) -> np.ndarray:
    """Motion of x1, z1, x2, z2 for each of θ1, θ2 and the base, by complex steps: exact to rounding."""
    step = 1e-30
    columns = [mass_positions(1j * step * row, built).imag / step for row in np.eye(3)]
    return np.column_stack(columns)


@dataclass(frozen=True)
class Assembled:
    """M, C, K of the machine at one position, and the rows of the tool, the base and the accelerometers."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    rows: dict[str, np.ndarray]


def assemble(position: float, built: dict[str, float], hidden: Hidden) -> Assembled:
    """The whole machine with the head at a position: beam, head, and what is hidden."""
    left = max(2, round(position * ELEMENTS))
    nodes = LENGTH * np.concatenate(
        [np.linspace(0.0, position, left + 1), np.linspace(position, 1.0, ELEMENTS - left + 1)[1:]]
    )
    bending = built["mass"] * (2 * np.pi * built["first_frequency"]) ** 2 * LENGTH**3 / np.pi**4
    beam_mass, beam_stiffness = hermite_beam(nodes, built["mass"] / LENGTH, bending)
    n_beam = beam_mass.shape[0]
    ends = np.array([0, n_beam - 2])
    inner = np.setdiff1d(np.arange(n_beam), ends)
    # The beam's own damping acts on what bends it: motion relative to the straight line between its ends.
    straight = np.zeros((n_beam, 2))
    straight[0::2, 0], straight[0::2, 1] = 1.0 - nodes / LENGTH, nodes / LENGTH
    straight[1::2, 0], straight[1::2, 1] = -1.0 / LENGTH, 1.0 / LENGTH
    pinned = np.ix_(inner, inner)
    bent = np.eye(n_beam)[inner]
    bent[:, ends] -= straight[inner]
    damping_of_bending = modal_damping(beam_mass[pinned], beam_stiffness[pinned], built["damping_ratio"])
    beam_damping = bent.T @ damping_of_bending @ bent

    extra = 3 if hidden.resonator else 2
    n = n_beam + extra
    mass, damping, stiffness = (np.zeros((n, n)) for _ in range(3))
    mass[:n_beam, :n_beam], damping[:n_beam, :n_beam], stiffness[:n_beam, :n_beam] = (
        beam_mass, beam_damping, beam_stiffness,
    )  # fmt: skip
    joints = np.array([n_beam, n_beam + 1, 2 * left])  # θ1, θ2, deflection of the rail under the head
    jacobian = np.zeros((4, n))
    jacobian[:, joints] = head_jacobian(built)
    mass += jacobian.T @ np.diag(np.repeat([built["m1"], built["m2"]], 2)) @ jacobian
    for joint, k, c in zip(joints[:2], (built["k1"], built["k2"]), (built["c1"], built["c2"]), strict=True):
        stiffness[joint, joint] += k
        damping[joint, joint] += c
    free = np.arange(n)
    if hidden.resonator:
        m, frequency, ratio = hidden.resonator
        relative = np.eye(n)[-1] - jacobian[0]
        k = m * (2 * np.pi * frequency) ** 2
        mass[-1, -1] += m
        stiffness += k * np.outer(relative, relative)
        damping += 2 * ratio * np.sqrt(k * m) * np.outer(relative, relative)
    if hidden.supports:
        for end, k, c in zip(ends, hidden.supports[:2], hidden.supports[2:], strict=True):
            stiffness[end, end] += k
            damping[end, end] += c
    else:
        free = np.setdiff1d(free, ends)
    keep = np.ix_(free, free)
    base = np.eye(n)[2 * left]
    rows = {"tool_x": jacobian[2][free], "tool_z": jacobian[3][free], "base_x": base[free]}
    return Assembled(mass[keep], damping[keep], stiffness[keep], rows)


def accelerations(machine: Assembled, force: np.ndarray, step: float) -> dict[str, np.ndarray]:
    """
    Accelerations under a force on the tool in X, at rest before it.

    Each complex mode obeys ξ' = λ ξ + b f; for a force that is straight over a step h this is integrated without error:
    ξ+ = e^(λh) ξ + b h [φ1(λh) f + φ2(λh) (f+ - f)], φ1(z) = (e^z - 1)/z, φ2(z) = (e^z - 1 - z)/z².
    """
    n = machine.mass.shape[0]
    inverse = linalg.inv(machine.mass)
    # Velocities over a typical frequency: displacements and velocities of one size keep the modes' digits.
    scale = 2 * np.pi * 200.0
    state = np.block(
        [[np.zeros((n, n)), scale * np.eye(n)],
         [-inverse @ machine.stiffness / scale, -inverse @ machine.damping]]
    )  # fmt: skip
    drive = np.concatenate([np.zeros(n), inverse @ machine.rows["tool_x"] / scale])
    poles, modes = linalg.eig(state)
    gain = linalg.solve(modes, drive.astype(complex))
    upper = poles.imag > 0
    real = poles.imag == 0
    readers = {name: row @ state[n:] * scale @ modes for name, row in machine.rows.items()}
    total = {name: row @ drive[n:] * scale * force for name, row in machine.rows.items()}
    quick = np.abs(poles) * step > np.pi  # above the fine Nyquist frequency: follow the force at once, ξ = -b f/λ
    for name, row in readers.items():
        total[name] = total[name] - (row[quick] @ (gain[quick] / poles[quick])).real * force
    for i in np.flatnonzero((upper | real) & ~quick):
        z = poles[i] * step
        grown = np.expm1(z)
        phi1, phi2 = grown / z, (grown - z) / z**2
        numerator = gain[i] * step * np.array([phi2, phi1 - phi2])
        motion = signal.lfilter(numerator, np.array([1.0, -np.exp(z)]), force.astype(complex))
        for name, row in readers.items():
            total[name] = total[name] + (1.0 if real[i] else 2.0) * (row[i] * motion).real
    return total


def calibration_error(rng: np.random.Generator, freq: np.ndarray) -> np.ndarray:
    """A channel's smooth complex error, about a percent; no phase at zero frequency."""
    size = CALIBRATION / np.sqrt(3.0)
    over = np.pi * freq / freq[-1]
    gain = sum(size * rng.standard_normal() * np.cos(k * over) for k in range(3))
    phase = sum(size * rng.standard_normal() * np.sin(k * over) for k in (0.5, 1.0))
    error: np.ndarray = np.exp(gain + 1j * phase)
    return error


def digitise(fine: np.ndarray) -> np.ndarray:
    """What a digitiser's filter leaves, at the record's sampling frequency; no delay."""
    taps = signal.firwin(1601, 900.0, fs=SAMPLING * OVERSAMPLING, window=("kaiser", 9.0))
    filtered: np.ndarray = signal.fftconvolve(fine, taps, mode="same")[::OVERSAMPLING][:SAMPLES]
    return filtered


def blow(rng: np.random.Generator, count: int, step: float) -> np.ndarray:
    """A half sine of random peak, length and instant."""
    peak = PEAK_FORCE * rng.uniform(0.8, 1.2)
    length = rng.uniform(2.2e-3, 2.8e-3)
    time = np.arange(count) * step - PRE_TRIGGER - rng.uniform(0.0, 2e-3)
    force: np.ndarray = np.where((time > 0) & (time < length), peak * np.sin(np.pi * time / length), 0.0)
    return force


def write_record(path: Path, histories: list[dict[str, np.ndarray]], title: str) -> None:
    """One TDMS file, a group a blow."""
    objects: list[object] = [RootObject(properties={"title": title})]
    for number, history in enumerate(histories, start=1):
        group = f"blow_{number}"
        objects.append(GroupObject(group))
        for channel, values in history.items():
            properties = {"unit_string": UNIT[channel], "wf_increment": 1.0 / SAMPLING, "wf_start_offset": 0.0}
            objects.append(ChannelObject(group, channel, values.astype(np.float32), properties=properties))
    with TdmsWriter(path) as writer:
        writer.write_segment(objects)


def main() -> None:
    """Write the campaign into the folder that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=SEED)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    hidden, built = draw_hidden(rng), draw_as_built(rng)
    step = 1.0 / (SAMPLING * OVERSAMPLING)
    count = (SAMPLES + 128) * OVERSAMPLING  # beyond the record, so that the filter meets no edge within it
    lines = np.fft.rfftfreq(SAMPLES, 1.0 / SAMPLING)
    errors = {channel: calibration_error(rng, lines) for channel in ("tool_x", "tool_z", "base_x")}

    records = arguments.folder / "records"
    records.mkdir(parents=True, exist_ok=True)
    toml = ["# Hammer blows on the tool, vertical (X), at five positions of the head.", "[campaign]"]
    toml += ['title = "Demonstration campaign"', 'machine = "machine.toml"']
    for number, position in enumerate(POSITIONS, start=1):
        machine = assemble(position, built, hidden)
        histories = []
        for _ in range(BLOWS):
            force = blow(rng, count, step)
            fine = {"force": force, **accelerations(machine, force, step)}
            history = {}
            for channel, values in fine.items():
                record = digitise(values)
                if channel in errors:
                    record = np.fft.irfft(np.fft.rfft(record) * errors[channel], SAMPLES)
                record = record + NOISE[channel] * rng.standard_normal(SAMPLES)
                bit = FULL_SCALE[channel] / 2**23
                history[channel] = bit * np.round(record / bit)
            histories.append(history)
        write_record(records / f"p{number}.tdms", histories, "Demonstration campaign")
        toml += ["", "[[record]]", f'file = "records/p{number}.tdms"', 'kind = "impact"']
        toml += [f"position = {position}      # y_b / L", f"peak_force = {PEAK_FORCE:g}   # N, nominal"]
    (arguments.folder / "campaign.toml").write_text("\n".join(toml) + "\n", encoding="utf-8")
    (arguments.folder / "machine.toml").write_text(MACHINE_TOML, encoding="utf-8")
    scatter = ", ".join(f"{name} {100 * (value / NOMINAL[name][0] - 1):+.2f} %" for name, value in built.items())
    sys.stderr.write(f"hidden: {hidden}\nas built: {scatter}\n")


if __name__ == "__main__":
    main()
