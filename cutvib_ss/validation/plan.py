"""What a trial consists of: how many cases of which kind, each with its own seed, in an order that tells nothing."""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from cutvib_ss.errors import ParameterError

Kind: TypeAlias = Literal["none", "single", "pair", "outside"]
KINDS: tuple[Kind, ...] = get_args(Kind)
"""No gap; one cause of the catalogue; two of them; a cause outside it."""

SHARES: Mapping[str, float] = {"none": 0.30, "outside": 0.12, "pair": 0.08}
"""Parts of a trial by default; the rest has one cause. Of 500 cases: 150, 60, 40 and 250."""

TRAITS: Mapping[str, float] = {"drifting": 1 / 3, "varied": 0.5, "rough": 1 / 3, "structure": 0.15}
"""
Parts of the cases of each kind, by default: whose machine moves between sessions; whose cause has another form than the
catalogue's; that are measured with instruments and hands as they are; whose machine is another structure. Each is dealt by itself.
"""

SMALL: Mapping[str, Any] = {
    "positions": (0.12, 0.37, 0.63, 0.88), "levels": (20.0, 100.0), "channels": ("tool_x", "tool_z"),
}  # fmt: skip
"""Conditions of a small campaign."""


@dataclass(frozen=True)
class Request:
    """A case to be made by the rig."""

    seed: int  # Of everything about the case
    kind: Kind  # What is wrong with the machine
    cause: str | None  # Which cause, where the kind leaves a choice; None leaves it to the rig
    severity: tuple[float, float]  # Range from which the severity is drawn, relative to the rig's usual one
    small: bool = False  # Whether the campaign is one of an hour, not of a day
    traits: tuple[str, ...] = ()  # What else the case has, of `TRAITS`


@dataclass(frozen=True)
class Settings:
    """What was asked for: the same settings make the same cases."""

    cases: int  # Number of cases
    seed: int  # Of all cases
    mix: Mapping[str, int]  # Number of cases of each kind
    severity: tuple[float, float] = (0.3, 2.0)  # Range of severities
    small: bool = False  # Whether all campaigns have `SMALL` extent, instead of one that is drawn
    traits: Mapping[str, float] = field(default_factory=dict)  # Part of the cases that has each of `TRAITS`
    measured: bool = False  # Whether the cases are measured campaigns with an element added

    def to_dict(self) -> dict[str, Any]:
        """The settings as plain data."""
        drawn = {**asdict(self), "severity": list(self.severity)}
        return drawn if self.measured else {k: v for k, v in drawn.items() if k != "measured"}


def settings(
    cases: int, seed: int, mix: str | None = None, severity: tuple[float, float] = (0.3, 2.0), small: bool = False
) -> Settings:
    """
    Settings of a trial from what a user gives.

    >>> settings(500, 1).mix
    {'none': 150, 'outside': 60, 'pair': 40, 'single': 250}
    >>> settings(12, 1, "none=3,pair=1").mix
    {'none': 3, 'outside': 0, 'pair': 1, 'single': 8}
    >>> settings(12, 1, "none=3,drifting=12,structure=0").traits["drifting"]
    1.0
    """
    if cases < 1:
        raise ParameterError(f"--cases {cases}: a trial has at least one case")
    if seed < 0:
        raise ParameterError(f"--seed {seed}: must not be negative")
    if not 0.0 < severity[0] <= severity[1] < float("inf"):
        raise ParameterError(f"--severity {severity[0]:g}:{severity[1]:g}: needs 0 < LO <= HI, both finite")
    given = {} if mix is None else _counts(mix)
    counts = {kind: round(share * cases) for kind, share in SHARES.items()}
    if any(kind in given for kind in SHARES):
        counts = {kind: given.get(kind, 0) for kind in SHARES}
    traits = {name: given[name] / cases if name in given else share for name, share in TRAITS.items()}
    for name, share in traits.items():
        if share > 1:
            raise ParameterError(f"--mix {mix}: {name} in {given[name]} of {cases} cases")
    singles = cases - sum(counts.values())
    if singles < 0:
        raise ParameterError(f"--mix {mix}: asks for {cases - singles} cases, --cases for {cases}")
    return Settings(cases, seed, {**counts, "single": singles}, severity, small, traits)


def _counts(mix: str) -> dict[str, int]:
    counts: dict[str, int] = {}
    known = (*SHARES, *TRAITS)
    for part in mix.split(","):
        kind, _, number = part.partition("=")
        if kind.strip() not in known or not number.strip().isdecimal():
            raise ParameterError(f"--mix {mix}: give KIND=NUMBER for {', '.join(known)}, such as none=150,outside=60")
        counts[kind.strip()] = int(number)
    return counts


def requests(asked: Settings, causes: Sequence[str], outside: Sequence[str]) -> tuple[Request, ...]:
    """The cases of a trial."""
    rng, dealer = np.random.default_rng(asked.seed), np.random.default_rng([asked.seed, 1])
    seeds = np.random.SeedSequence(asked.seed).generate_state(asked.cases, np.uint32)
    choices: dict[str, Sequence[str]] = {"single": causes, "outside": outside}
    drawn: list[tuple[Kind, str | None, tuple[str, ...]]] = []
    for kind in KINDS:
        names = choices.get(kind, ())
        order, count = rng.permutation(len(names)), asked.mix[kind]
        having = {name: set(dealer.permutation(count)[: round(share * count)]) for name, share in asked.traits.items()}
        for i in range(count):
            cause = names[order[i % len(names)]] if len(names) else None
            drawn.append((kind, cause, tuple(name for name, own in having.items() if i in own)))
    dealt = [drawn[k] for k in rng.permutation(asked.cases)]
    return tuple(
        Request(int(seed), kind, cause, asked.severity, asked.small, traits)
        for seed, (kind, cause, traits) in zip(seeds, dealt, strict=True)
    )


def command_of(asked: Mapping[str, Any]) -> str:
    """
    The command that makes a trial's cases.

    >>> command_of(settings(12, 9, "none=6,outside=1", small=True).to_dict())[:59]
    'cutvib blind run --cases 12 --seed 9 --mix none=6,outside=1'
    >>> from dataclasses import replace
    >>> command_of(replace(settings(12, 9), measured=True).to_dict())
    'cutvib blind measured DIR --seed 9'
    """
    if asked.get("measured"):
        return f"cutvib blind measured DIR --seed {asked['seed']}"
    mix = ",".join(f"{kind}={n}" for kind, n in asked["mix"].items() if kind != "single")
    mix += "".join(f",{name}={round(share * asked['cases'])}" for name, share in (asked.get("traits") or {}).items())
    low, high = asked["severity"]
    small = " --small" if asked.get("small") else ""
    return f"cutvib blind run --cases {asked['cases']} --seed {asked['seed']} --mix {mix} --severity {low:g}:{high:g}{small}"


def neutral_name(salt: bytes, index: int) -> str:
    """A name for a case that tells neither its kind nor its turn."""
    return hmac.new(salt, str(index).encode(), hashlib.sha256).hexdigest()[:12]
