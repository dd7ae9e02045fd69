"""The rig's process: `python -m cutvib_ss.validation.draw REQUEST` makes one case in the current folder."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cutvib_ss.validation.files import write_json
from cutvib_ss.validation.plan import SMALL
from cutvib_ss.validation.workers import CAMPAIGN, FRESH, LABEL

FRESH_POSITIONS = 2
"""Positions of the records on which it is checked how far the gap really shrank."""
QUIET = 0.01
"""Their noise, as a part of the campaign's: next to none, but a variance to work with."""


def main(request: dict[str, Any], folder: Path) -> None:
    """Make a case: its campaign, its label, and records for the score that the diagnosis never has."""
    from cutvib_ss.validation.rig import draw_case, write_campaign

    case = draw_case(
        request["seed"],
        request["kind"],
        request["cause"],
        tuple(request["severity"]),
        SMALL if request["small"] else None,
        request.get("traits") or (),
    )
    (folder / CAMPAIGN).mkdir()
    write_campaign(case, folder / CAMPAIGN)
    if request["kind"] in ("single", "pair"):
        write_fresh(case, folder / FRESH)
    write_json(folder / LABEL, case.label | judged_by_oracle(case, tuple(request["severity"])))


def judged_by_oracle(case: Any, severity: tuple[float, float]) -> dict[str, Any]:
    """The posterior that a perfect method would state; None where the oracle does not cover the case, or failed and why."""
    from cutvib_ss.validation.rig.oracle import knows, posterior

    if not knows(case):
        return {"oracle": None}
    try:
        return {"oracle": posterior(case, severity=severity).to_dict()}
    except (ArithmeticError, ValueError) as error:  # of linear algebra too
        return {"oracle": None, "oracle_failed": str(error)}


def write_fresh(case: Any, folder: Path) -> None:
    """Records of the same machine at other positions, with hardly any noise, no calibration errors and nothing that drifts."""
    from cutvib_ss.validation.rig import files
    from cutvib_ss.validation.rig.campaign import Campaign
    from cutvib_ss.validation.rig.repeatability import Repeatability

    class TrueCampaign(Campaign):
        """A campaign with perfect sensors; what is wrong with the chain as a cause stays."""

        @cached_property
        def errors(self) -> Any:
            return np.ones_like(super().errors)

    usual = case.conditions
    conditions = replace(
        usual, positions=between(usual.positions), file_format="tdms", blows=1, hit_twice=0.0, overloads=0, bits=24,
        wander=0.0, noise=tuple(QUIET * n for n in usual.noise), force_noise=QUIET * usual.force_noise,
        repeatability=Repeatability(), coupling=(0.0, 0.0), bad=(), resolved=usual.noise,
    )  # fmt: skip
    files.write(TrueCampaign(case.rig, conditions, case.seed + 1), case.nominal, folder)


def between(positions: Sequence[float | None]) -> tuple[float | None, ...]:
    """
    Positions in the middle of the widest gaps that a campaign leaves.

    >>> between((0.02, 0.1, 0.4, 0.5, 0.9))
    (0.25, 0.7)
    """
    if any(p is None for p in positions):
        return (None,)
    measured = np.sort([p for p in positions if p is not None])
    widest = np.argsort(-np.diff(measured), kind="stable")[:FRESH_POSITIONS]
    return tuple(float(round((measured[k] + measured[k + 1]) / 2, 4)) for k in sorted(widest))


if __name__ == "__main__":
    main(json.loads(sys.argv[1]), Path.cwd())
