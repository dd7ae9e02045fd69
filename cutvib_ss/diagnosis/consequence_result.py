"""Consequences of a diagnosis for the machine: the vibration now and with the cause fixed, and a controller on both models."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Consequence:
    """A figure now and with the cause fixed."""

    position: float | None  # y_b / L
    now: float  # Estimate
    now_interval: tuple[float, float]  # Its 95 % interval, tuning and effect drawn from the fit's covariance
    fixed: float  # Estimate with the cause fixed
    fixed_interval: tuple[float, float]  # Its 95 % interval
    ratio_interval: tuple[float, float]  # 95 % interval of fixed over now
    measured: float | None = None  # The measurement at the nearest line, where the position was measured


@dataclass(frozen=True)
class Loop:
    """A controller designed on the nominal model, on the nominal and on the corrected one."""

    position: float | None  # y_b / L
    stable: bool  # Whether the corrected loop is stable
    nominal_margin: float  # Disk margin: gain and phase may change at once by as much; 0 where unstable
    corrected_margin: float
    nominal_attenuation_db: float  # By how much the loop lowers the vibration at the working frequency [dB]
    corrected_attenuation_db: float


@dataclass(frozen=True)
class Consequences:
    """What the diagnosis means for the machine."""

    frequency: float  # Working frequency [Hz]
    channel: str  # What is looked at, and its unit
    unit: str
    vibration: tuple[Consequence, ...]  # At each position
    controller: str = ""  # Which controller was checked; empty where none was
    loops: tuple[Loop, ...] = ()  # That controller at each position
    warnings: tuple[str, ...] = ()  # Where this extrapolates
