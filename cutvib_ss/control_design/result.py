"""What the check of a controller gives: frozen, over machines and positions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.results import FloatArray, FrequencyResponse, read_only

_PER_POSITION = (
    "growth_rate", "growth_freq", "before", "passive", "after", "effort", "noise_command", "disk_margin", "gain_margin",
    "phase_margin", "delay_margin",
)  # fmt: skip


@dataclass(frozen=True)
class WorstCase:
    """
    A check's worst positions on one machine.

    Parameters
    ----------
    machine : str
        Name of the machine.
    stable, positions : int
        At how many positions the closed loop is stable, and of how many.
    attenuation : float
        Largest closed over open response at the working frequency; NaN unless stable everywhere.
    attenuation_position : float
        y_b / L where that is; of an unstable loop, where it grows fastest.
    amplification : float
        Largest peak of the closed response over that of the open one, in the check's band.
    disk_margin : float
        Smallest; zero where a position is unstable.
    gain_margin : float
        Smallest [dB].
    phase_margin : float
        Smallest [°].
    delay_margin : float
        Smallest [s].
    effort : float
        Largest command per newton of cutting force [N/N].
    noise_command : float
        Largest RMS of the command from sensor noise [N].
    """

    machine: str
    stable: int
    positions: int
    attenuation: float
    attenuation_position: float
    amplification: float
    disk_margin: float
    gain_margin: float
    phase_margin: float
    delay_margin: float
    effort: float
    noise_command: float


@dataclass(frozen=True)
class ControllerCheck:
    """
    A controller on machines, over all positions.

    Parameters
    ----------
    name : str
        Of the controller.
    machines : tuple of str
        Names of the machines.
    positions : array_like, shape (position,)
        y_b / L.
    working_frequency : float
        Frequency of the tool's force [Hz].
    outputs : tuple of str
        Motions whose attenuation is given; the first is the one that counts.
    growth_rate, growth_freq : array_like, shape (machine, position)
        Largest real part of the closed loop's poles [1/s], unstable above zero, and the frequency of that pole [Hz].
    before : array_like, shape (machine, output, position)
        Accelerance at the working frequency of the machine as it is, without actuators [m/s^2/N].
    passive : array_like, shape (machine, output, position)
        With the actuators on it and no command.
    after : array_like, shape (machine, output, position)
        With the loop closed; NaN where it is unstable.
    effort : array_like, shape (machine, position)
        Norm of the commands per newton of cutting force at the working frequency [N/N].
    noise_command : array_like, shape (machine, position)
        RMS of the commands from the sensors' noise [N].
    disk_margin, gain_margin, phase_margin, delay_margin : array_like, shape (machine, position)
        Margins [1, dB, °, s]; zero where the loop is unstable.
    open, closed : tuple of FrequencyResponse
        For each machine the response of the first output, without actuators and with the loop closed.
    """

    name: str
    machines: tuple[str, ...]
    positions: FloatArray
    working_frequency: float
    outputs: tuple[str, ...]
    growth_rate: FloatArray
    growth_freq: FloatArray
    before: FloatArray
    passive: FloatArray
    after: FloatArray
    effort: FloatArray
    noise_command: FloatArray
    disk_margin: FloatArray
    gain_margin: FloatArray
    phase_margin: FloatArray
    delay_margin: FloatArray
    open: tuple[FrequencyResponse, ...]
    closed: tuple[FrequencyResponse, ...]

    def __post_init__(self) -> None:
        for name in ("positions", *_PER_POSITION):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    @property
    def stable(self) -> np.ndarray:
        """Whether the closed loop is stable, shape (machine, position)."""
        return self.growth_rate < 0.0

    @property
    def attenuation(self) -> FloatArray:
        """Closed over open response at the working frequency, shape (machine, output, position); NaN where unstable."""
        return self.after / self.before

    def worst(self, machine: str | None = None, output: str | None = None) -> WorstCase:
        """
        The worst positions on one machine.

        Parameters
        ----------
        machine : str, optional
            Name of the machine; the first by default.
        output : str, optional
            Motion whose attenuation is taken; the first by default.

        Returns
        -------
        WorstCase
            Each figure at its own worst position.

        Raises
        ------
        ParameterError
            If there is no such machine or output.
        """
        for label, labels in ((machine, self.machines), (output, self.outputs)):
            if label is not None and label not in labels:
                raise ParameterError(f"no {label!r} in this check; there are {', '.join(labels)}")
        m = 0 if machine is None else self.machines.index(machine)
        o = 0 if output is None else self.outputs.index(output)
        stable, ratio = self.stable[m], self.attenuation[m, o]
        there = int(np.argmax(ratio) if stable.all() else np.argmax(self.growth_rate[m]))
        peaks = [np.abs(f[m].data[:, 0, 0]).max(axis=-1) for f in (self.open, self.closed)]
        return WorstCase(
            machine=self.machines[m],
            stable=int(stable.sum()),
            positions=stable.size,
            attenuation=float(ratio.max()),
            attenuation_position=float(self.positions[there]),
            amplification=float((peaks[1] / peaks[0]).max()),
            disk_margin=float(self.disk_margin[m].min()),
            gain_margin=float(self.gain_margin[m].min()),
            phase_margin=float(self.phase_margin[m].min()),
            delay_margin=float(self.delay_margin[m].min()),
            effort=float(self.effort[m].max()),
            noise_command=float(self.noise_command[m].max()),
        )
