"""
The generator's own prior, read off the generator: what each form of a cause draws, as coordinates and branches.

A form's maker is run with numbers that are given instead of drawn. Continuous draws become standard normal coordinates (a uniform
one is its distribution function at the coordinate), and every choice becomes a branch with its probability. So the oracle has the
rig's forms, sizes and their prior without a copy of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from cutvib_ss.validation.rig.causes import FORMS
from cutvib_ss.validation.rig.responses import covered
from cutvib_ss.validation.rig.sites import Form
from cutvib_ss.validation.rig.structure import Rig

Array = NDArray[np.float64]

VARIED = 0.5
"""Part of the cases whose cause has another form than the catalogue's: of a trial by default."""


class Coin(float):
    """A number drawn evenly from 0 to 1 that is asked only whether it is less than a threshold."""

    script: Script

    def __lt__(self, threshold: float) -> bool:
        return self.script.branch([threshold, 1.0 - threshold]) == 0


class Script:
    """Stands for a generator of random numbers: coordinates and branches in the order in which they are asked for."""

    def __init__(self, coordinates: Sequence[float] | Array, branches: Sequence[int] = ()) -> None:
        self.coordinates, self.branches = coordinates, branches
        self.used = 0
        self.taken: list[int] = []
        self.odds: list[Array] = []

    def standard_normal(self) -> float:
        """The next coordinate; 0 where no more are given."""
        self.used += 1
        return float(self.coordinates[self.used - 1]) if self.used <= len(self.coordinates) else 0.0

    def uniform(self, low: float, high: float) -> float:
        """Its distribution function, scaled."""
        return float(low + (high - low) * ndtr(self.standard_normal()))

    def branch(self, odds: Sequence[float]) -> int:
        """The next branch, the first where no more are given."""
        k = len(self.taken)
        self.taken.append(self.branches[k] if k < len(self.branches) else 0)
        self.odds.append(np.asarray(odds, dtype=np.float64))
        return self.taken[-1]

    def random(self) -> Coin:
        """A number that becomes a branch when it is compared."""
        coin = Coin(0.5)
        coin.script = self
        return coin

    def choice(self, options: Sequence[Any]) -> Any:
        """One of the options; equal ones are one branch."""
        values = list(options)
        different = list(dict.fromkeys(values))
        return different[self.branch([values.count(v) / len(values) for v in different])]


@dataclass(frozen=True)
class Hypothesis:
    """One form of a cause with all its choices made: coordinates remain."""

    effect: str
    place: str
    form: Form
    branches: tuple[int, ...]
    probability: float  # Prior, sizes integrated over
    dimension: int  # Coordinates: the severity's first

    def machine(self, plain: Rig, coordinates: Array, severity: tuple[float, float]) -> Rig:
        """The machine with the cause, its draws at these coordinates."""
        script = Script(coordinates, self.branches)
        size = float(np.exp(script.uniform(*np.log(severity))))
        made = self.form.make(plain, size, script)[0]  # type: ignore[arg-type]
        if not isinstance(made, Rig):
            raise TypeError(f"{type(made).__name__}: only the cutting machine is known")
        return made


def hypotheses(
    plain: Rig, causes: Mapping[str, float], severity: tuple[float, float], varied: float = VARIED
) -> tuple[Hypothesis, ...]:
    """Every form of the causes whose responses are known, with its prior; forms that are not are left out."""
    out = []
    for cause, share in causes.items():
        forms = FORMS[cause]
        for k, form in enumerate(forms):
            prior = share * ((1 - varied) if k == 0 else varied / (len(forms) - 1))
            if prior > 0:
                out += list(_branches(plain, cause, form, prior, severity))
    return tuple(out)


def _branches(plain: Rig, cause: str, form: Form, prior: float, severity: tuple[float, float]) -> Iterator[Hypothesis]:
    waiting: list[tuple[int, ...]] = [()]
    while waiting:
        begun = waiting.pop()
        script = Script((), begun)
        size = float(np.exp(script.uniform(*np.log(severity))))
        machine, place, _ = form.make(plain, size, script)  # type: ignore[arg-type]
        for k in range(len(begun), len(script.taken)):
            waiting += [(*script.taken[:k], other) for other in range(1, script.odds[k].size)]
        if isinstance(machine, Rig) and covered(machine):
            chance = prior * float(np.prod([odds[b] for odds, b in zip(script.odds, script.taken, strict=True)]))
            yield Hypothesis(cause, place, form, tuple(script.taken), chance, script.used)
