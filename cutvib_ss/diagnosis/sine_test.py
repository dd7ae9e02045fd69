"""How a sine test was driven."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cutvib_ss.measurement.records import Sweep
from cutvib_ss.results import FloatArray


@dataclass(frozen=True)
class SineTest:
    """How a stepped or swept sine was driven, line by line."""

    force: FloatArray  # Amplitude of the force [N]; of a held response that which it took
    direction: Sweep | None = None  # Order of the lines, where stated
    held: FloatArray | None = None  # Amplitude of the first channel, where that was held instead of the force

    def at(self, keep: np.ndarray | slice) -> SineTest:
        """Some of the lines."""
        return replace(self, force=self.force[keep], held=None if self.held is None else self.held[keep])
