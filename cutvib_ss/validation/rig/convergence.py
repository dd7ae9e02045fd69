"""
Whether steps are short enough: ``python -m cutvib_ss.validation.rig.convergence --draws 3 --seed 1``.

Of every nonlinear form, of every kind outside the catalogue that is stepped in time, and of pairs of two laws and of a law with a
linear cause, machines are drawn and struck as hard as their campaign would. The response that a campaign would use is held against
that with steps a quarter as long.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from cutvib_ss.validation.rig.blows import FS, antialiased
from cutvib_ss.validation.rig.cases import Case, Kind, draw_case
from cutvib_ss.validation.rig.causes import FORMS
from cutvib_ss.validation.rig.law_forms import LAW_FORMS
from cutvib_ss.validation.rig.motion import NotConvergedError, converged_answer, nonlinear_answer
from cutvib_ss.validation.rig.outside import OUTSIDE

LINEAR = ("guide_compliance", "support_compliance", "local_resonator", "added_mass")


@dataclass(frozen=True)
class Found:
    """One blow."""

    name: str
    steps: int | None  # Steps to a sample that were taken; None where it is refused
    error: float  # What steps a quarter as long change, over the noise
    unstable: bool = False  # Whether its motion is, so that a part in a million of the force shows


def studied(name: str, case: Case) -> Found | None:
    """The first blow at the highest level; None where nothing is stepped in time."""
    campaign = case.campaign
    if case.rig.linear:
        return None
    level = int(np.argmax(case.conditions.levels))
    rig, machine = campaign.machine(level)
    blow, noise = campaign.blows[level][0], np.array(case.conditions.noise)[:, None]
    try:
        found = converged_answer(rig, machine, blow, case.conditions.noise)
    except NotConvergedError:
        return Found(name, None, np.nan)
    answer, fine = found.response, found.steps
    if found.sensitivity:
        return Found(name, fine, found.error, unstable=True)
    finer = antialiased(nonlinear_answer(rig, machine, blow.force(4 * fine), FS * 4 * fine), 4 * fine)
    error = float(np.sqrt(np.mean(((answer - finer) / noise) ** 2, axis=1)).max())
    return Found(name, fine, error)


def study(draws: int, seed: int, only: str = "") -> Iterator[Found]:
    """Every law, every form, and pairs, as many machines of each as asked; of those alone whose name holds a text."""
    seeds = np.random.SeedSequence(seed)
    asked: list[tuple[str, Kind, str, str | None]] = [
        (f"{cause}: {form.name}", "single", cause, form.name) for cause, forms in FORMS.items() for form in forms
    ]
    asked += [(f"outside: {kind}", "outside", kind, None) for kind in OUTSIDE]
    asked += [(f"{a} + {b}", "pair", f"{a}+{b}", None) for a, b in itertools.combinations(LAW_FORMS, 2)]
    asked += [(f"{a} + {b}", "pair", f"{a}+{b}", None) for a in LAW_FORMS for b in LINEAR]
    for (name, kind, cause, form), one in zip(asked, seeds.spawn(len(asked)), strict=True):
        if only not in name:
            continue
        for number in one.generate_state(draws):
            found = _first(name, int(number), kind, cause, form)
            if found is not None:
                yield found


def _first(name: str, number: int, kind: Kind, cause: str, form: str | None) -> Found | None:
    """Of a pair both of whose causes fall on one place another machine is drawn."""
    for attempt in range(20):
        try:
            case = draw_case(number + attempt, kind, cause, traits=("varied",), form=form)
        except ValueError:
            continue
        return studied(name, case)
    return None


def main(arguments: list[str] | None = None) -> None:
    """Print the study as a table in Markdown."""
    parser = argparse.ArgumentParser(prog="python -m cutvib_ss.validation.rig.convergence", description=__doc__)
    parser.add_argument("--draws", type=int, default=3, help="machines of each")
    parser.add_argument("--seed", type=int, default=1, help="everything follows from it")
    parser.add_argument("--only", default="", metavar="TEXT", help="names that hold this text, for instance freeplay")
    a = parser.parse_args(arguments)
    rows: dict[str, list[Found]] = {}
    for found in study(a.draws, a.seed, a.only):
        rows.setdefault(grouped(found.name), []).append(found)
        sys.stderr.write(f"{found.name}: {found.steps} {found.error:.2g}{' unstable' if found.unstable else ''}\n")
    sys.stdout.write(table(rows) + "\n")


def grouped(name: str) -> str:
    """The row of the table that a blow belongs to."""
    if " + " in name:
        return "a law and a linear cause" if name.split(" + ")[1] in LINEAR else "two laws"
    return name.partition(":")[0]


def table(rows: Mapping[str, list[Found]]) -> str:
    """The study as a table in Markdown."""
    lines = [
        "| what | blows | refused | unstable | steps to a sample | still wrong, of the noise |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, group in rows.items():
        taken = [f for f in group if f.steps is not None]
        counts = Counter(f.steps for f in taken if f.steps is not None)
        steps = ", ".join(f"{n} ({counts[n]})" for n in sorted(counts))
        errors = [f.error for f in taken if not f.unstable]
        worst = f"{100 * max(errors):.2g} %" if errors else "-"
        unstable = len(taken) - len(errors)
        lines.append(f"| {name} | {len(group)} | {len(group) - len(taken)} | {unstable} | {steps} | {worst} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
