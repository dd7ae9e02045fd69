"""A case of a trial: what was wrong, what the diagnosis said, and whether that is the same."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from cutvib_ss.validation.files import read_json
from cutvib_ss.validation.plan import Kind
from cutvib_ss.validation.seal import Trial

OneCause: TypeAlias = tuple[str, str]
Causes: TypeAlias = frozenset[OneCause]
"""Causes that act together, each an effect and a place."""

ELEMENT: OneCause = ("unknown", "")
"""An element of a kind that is not known: where it sits is scored by place, not by name."""

NONE: Causes = frozenset({("none", "none")})
UNKNOWN: Causes = frozenset({ELEMENT})

LEAST = 1e-4
"""Probability that counts for what is not listed, in log scores: one such case costs 9.2 nats."""

FEW_PLACES = 3
"""A stated set of places up to this size says where to look."""

EQUIVALENT: Mapping[tuple[str, str], OneCause] = {
    ("parameter_shift", "m1"): ("added_mass", "head"),
    ("parameter_shift", "m2"): ("added_mass", "tool"),
}
"""Effect and shifted parameter that are on the cutting machine exactly another cause, and which name stands for both."""

OUTSIDE = "outside:"
"""Prefix of the effect in the label of a cause outside the catalogue."""


@dataclass(frozen=True)
class Truth:
    """What is wrong with the machine."""

    kind: Kind  # Of the case
    causes: Causes  # What a right answer names: the causes, none, or unknown
    name: str  # The cause in words of the label
    place: frozenset[str]  # Where
    gap_sigma: float  # Size of the gap over the measurement's noise
    label: Mapping[str, Any]  # The whole label

    @property
    def accepted(self) -> frozenset[str]:
        """The place, and those that are physically the same."""
        return self.place | frozenset(self.label.get("equivalent_places") or ())

    @property
    def grade(self) -> int:
        """How far the form of the cause is from the catalogue's: 0 its own, 1 near it, 2 another, 3 of its kind only."""
        return int(self.label.get("grade") or 0)

    @property
    def drifting(self) -> bool:
        """Whether the machine moves during the campaign."""
        moves = (self.label.get("conditions") or {}).get("repeatability") or {}
        return any(moves.get(name) for name in ("drift", "within", "temperature"))

    @property
    def machine(self) -> str:
        """Kind of the machine."""
        return str(self.label.get("machine") or "cutting_machine")

    @property
    def oracle(self) -> Mapping[Causes, float] | None:
        """What a method that knows the rig would state; None where the oracle does not cover the case."""
        told = self.label.get("oracle")
        if told is None:
            return None
        odds: dict[Causes, float] = {}
        for row in told["causes"]:
            named = causes_of(row["effect"], row["place"], {})
            odds[named] = odds.get(named, 0.0) + float(row["probability"])
        return odds

    @property
    def hidden(self) -> bool:
        """Whether even the oracle takes the machine for sound: tolerance hides the gap, and to say none is no miss."""
        odds = self.oracle
        return odds is not None and self.kind != "none" and odds.get(NONE, 0.0) >= 0.5

    def holds(self, causes: Causes) -> bool:
        """
        Whether an answer that names these causes is right.

        Outside the catalogue every answer with an unknown element is: what a known cause beside it closes is closed. In another
        form than the catalogue's a cause may leave a rest: it is right with or without an unknown element.
        """
        if self.kind == "outside":
            return ELEMENT in causes
        right = (self.causes, *self.others)
        return causes in right or (self.grade > 0 and causes - UNKNOWN in right)

    @property
    def every(self) -> Causes:
        """Every cause that is part of a right answer."""
        return self.causes.union(*self.others)

    @property
    def others(self) -> tuple[Causes, ...]:
        """
        Other names under which the truth is right: where a measured rig's documented cause has several, and slip at one torque.
        """
        named = list(self.label.get("or") or ())
        if (self.label.get("effect"), self.label.get("form")) == ("joint_slip", "jenkins"):
            # Without a spread of its slip torques it goes by this name.
            named.append({"effect": "dry_friction", "place": self.label["place"]})
        return tuple(causes_of(one["effect"], one["place"], {}) for one in named)


@dataclass(frozen=True)
class Entry:
    """One row of a diagnosis, equivalent causes under one name."""

    causes: Causes  # The causes
    probability: float  # Stated probability
    reduced_chi2: float  # χ² a degree of freedom on held-out records; NaN where not judged


@dataclass(frozen=True)
class Answer:
    """What a diagnosis said."""

    # ``"no_gap"``, ``"explained"``, ``"partly_explained"``, ``"ambiguous"``, ``"unknown"``; ``"failed"`` where there
    # is no diagnosis
    verdict: str
    entries: tuple[Entry, ...]  # As the diagnosis ranked them
    likely: frozenset[Causes]  # The distinct causes of the 95 % set
    place: frozenset[str]  # Where it says the gap lies
    diagnosis: Mapping[str, Any]  # The JSON
    # The places that carry 0.95 of the probability; the place alone where the diagnosis does not say
    place_set: frozenset[str] = frozenset()

    @property
    def first(self) -> Causes | None:
        """The causes named first; None without a diagnosis."""
        return self.entries[0].causes if self.entries else None

    @property
    def confidence(self) -> float:
        """Probability stated for what is named first, all rows of that name together."""
        return 0.0 if self.first is None else self.probability_of(self.first)

    def probability_of(self, causes: Causes) -> float:
        """Probability stated for some causes."""
        return float(sum(e.probability for e in self.entries if e.causes == causes))

    def probability_that(self, truth: Truth) -> float:
        """Probability stated for all answers that are right."""
        return float(sum(e.probability for e in self.entries if truth.holds(e.causes)))

    @property
    def flagged(self) -> bool:
        """Whether it says that something is at work that it does not know."""
        return self.verdict in ("unknown", "partly_explained")


FAILED = Answer("failed", (), frozenset(), frozenset(), {})
"""Where the diagnosis crashed or took too long: an answer that is never right."""


@dataclass(frozen=True)
class Case:
    """A case of an opened trial."""

    name: str  # Its campaign
    truth: Truth  # What is wrong
    answer: Answer  # What was said
    run: Mapping[str, Any]  # Record of the diagnosis
    # Part of the nominal model's error that the corrected one closes on fresh records; NaN where that is not known
    achieved: float = float("nan")

    @property
    def right(self) -> bool:
        """Whether the first answer is the truth: all causes of it, and no more."""
        return self.answer.first is not None and self.truth.holds(self.answer.first)

    @property
    def lost(self) -> float:
        """Log probability that the oracle states for the truth over that of the diagnosis [nats]; NaN where there is no oracle."""
        odds = self.truth.oracle
        if odds is None:
            return float("nan")
        return _log(odds.get(self.truth.causes, 0.0)) - _log(self.answer.probability_that(self.truth))

    @property
    def right_place(self) -> bool:
        """
        Whether it says where to look.

        Right is a place that is true or physically the same; a set of few places with a true one among them; of several places
        named (a pair, a cause with an unknown element) each must be true, but that of an unknown element beside a true one.
        """
        named, true = self.answer.place, self.truth.accepted
        if named and named <= true:
            return True
        if self.answer.flagged and len(named) == 2 and named & true:
            return True
        few = self.answer.place_set
        return 1 < len(few) <= FEW_PLACES and bool(few & true)


def _log(probability: float) -> float:
    return math.log(min(max(probability, LEAST), 1.0))


def truth_of(label: Mapping[str, Any]) -> Truth:
    """A label, read."""
    effect, place = str(label["effect"]), str(label["place"])
    sigma = float("nan") if label.get("gap_sigma") is None else float(label["gap_sigma"])
    places = frozenset(place.split("+"))
    if effect == "none":
        return Truth("none", NONE, "none", frozenset({"none"}), sigma, label)
    if effect.startswith(OUTSIDE):
        return Truth("outside", UNKNOWN, effect, places, sigma, label)
    causes = causes_of(effect, place, label.get("parameters") or {})
    return Truth("pair" if len(causes) > 1 else "single", causes, name_of(causes), places, sigma, label)


def answer_of(diagnosis: Mapping[str, Any], shifts: Mapping[str, Sequence[str]] | None = None) -> Answer:
    """A diagnosis, read; `shifts` are the values whose shift is on this structure exactly another cause, and which."""
    equivalent = {**EQUIVALENT, **{("parameter_shift", k): (e, p) for k, (e, p) in (shifts or {}).items()}}
    rows: Sequence[Mapping[str, Any]] = diagnosis["causes"]
    entries = tuple(
        Entry(
            UNKNOWN
            if row["effect"] == "unknown"
            else causes_of(row["effect"], row["place"], row.get("parameters") or {}, equivalent),
            float(row["probability"]),
            float("nan") if row.get("reduced_chi2") is None else float(row["reduced_chi2"]),
        )
        for row in rows
    )
    return Answer(
        verdict=diagnosis["verdict"],
        entries=entries,
        likely=frozenset(entries[i].causes for i in diagnosis["ambiguity_set"]),
        place=frozenset(str(diagnosis["where"]["place"]).split("+")),
        diagnosis=diagnosis,
        place_set=frozenset(p for one in diagnosis["where"].get("place_set") or () for p in str(one).split("+")),
    )


def causes_of(
    effect: str, place: str, parameters: Mapping[str, Any], equivalent: Mapping[tuple[str, str], OneCause] = EQUIVALENT
) -> Causes:
    """
    Causes of a label or of a diagnosis' row, under the names that count.

    >>> sorted(causes_of("parameter_shift", "tool", {"parameter": "m2", "factor": 1.05}))
    [('added_mass', 'tool')]
    >>> sorted(causes_of("support_compliance+cubic_stiffness", "rail_ends+joint2", {}))
    [('cubic_stiffness', 'joint2'), ('support_compliance', 'rail_ends')]
    >>> sorted(causes_of("cubic_stiffness+unknown", "joint2+rail", {}))
    [('cubic_stiffness', 'joint2'), ('unknown', '')]
    """
    out = set()
    for one, at in zip(effect.split("+"), place.split("+"), strict=True):
        shifted = parameters.get(f"{one}.parameter", parameters.get("parameter"))
        if isinstance(shifted, Mapping):
            shifted = shifted.get("value")
        out.add(ELEMENT if one == "unknown" else equivalent.get((one, str(shifted)), (one, at)))
    return frozenset(out)


def name_of(causes: Causes) -> str:
    """Causes in words, as in the catalogue."""
    if causes in (UNKNOWN, NONE):
        return next(iter(causes))[0]
    return " + ".join(f"{effect} ({place})" if place else effect for effect, place in sorted(causes))


def read_cases(trial: Trial, labels: Mapping[str, Any]) -> tuple[Case, ...]:
    """All cases of an opened trial."""
    out = []
    for name in sorted(labels):
        run = read_json(trial.run(name))
        shifts = labels[name].get("equivalent_shifts")
        answer = answer_of(read_json(trial.diagnosis(name)), shifts) if run["status"] == "done" else FAILED
        out.append(Case(name, truth_of(labels[name]), answer, run))
    return tuple(out)
