"""
Blocks of estimated responses of blows that do not say how long theirs were.

A block of 1/Δf cuts off what has not died out by its end. One to which zeros were appended, a fitted response or one of other
excitation shows lightly damped modes as if nothing had been cut off. Where the two differ, whichever the records bear out is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.lasting import over_noise
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.prediction import Prediction, light_poles
from cutvib_ss.diagnosis.records import Entry, Records, merged
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model

UNCUT = (
    "estimated responses of blows: no `block` is stated, and one of 1/Δf = {:.3g} s would cut off what rings on; they look as if "
    "nothing was cut off, and are taken so; state `block`, or the excitation if it was another"
)
"""What a warning says where blocks are taken to be longer than by default."""


def longer_blocks(nominal: Model, observed: Observations) -> Observations | None:
    """
    The records, where no block is stated one in which all modes die out; None where the responses look cut off after 1/Δf.

    The tuned model is no judge of records with a cause that it lacks: this is for records that no linear cause explains.
    """
    entries = observed.entries
    longer = tuple(_longer(nominal, e) for e in entries)
    guessed = [(e, other) for e, other in zip(entries, longer, strict=True) if other is not e]
    if not guessed or _differ(nominal, [e for e, _ in guessed], [e for _, e in guessed]) <= SETTINGS.record_lasting:
        return None

    def evidence(each: tuple[Entry, ...]) -> float:
        # What rings on shows at any of its lines.
        few = Records(each).coarse(SETTINGS.search_coarse_lines, 0.0)
        return fit(nominal, few, Hypothesis()).log_evidence

    if evidence(longer) <= evidence(entries):
        return None
    word = UNCUT.format(guessed[0][0].estimator.block)
    return replace(observed, entries=longer, warnings=(*observed.warnings, word))


def _longer(nominal: Model, e: Entry) -> Entry:
    """A record that states no block, of one in which all modes die out."""
    block = e.estimator.block
    poles = light_poles(nominal, np.array([np.nan if e.position is None else e.position]))[0]
    if e.block_stated or not poles.size:
        return e
    count = int(np.ceil(SETTINGS.tail_died_out / float(poles.real.max()) / block))
    if count < 2:
        return e
    replay = e.replay
    if replay is not None:
        forces = tuple(np.pad(f, (0, (count - 1) * f.size)) for f in replay.forces)
        replay = replace(replay, forces=forces, lines=count * replay.lines)
    estimator = replace(e.estimator, block=count * block)
    return replace(e, response=replace(e.response, estimator=estimator), replay=replay)


def _differ(nominal: Model, entries: Sequence[Entry], others: Sequence[Entry]) -> float:
    """Squares of what the nominal model shows of some records through either of their blocks, over the noise."""
    total = 0.0
    for one, other in zip(merged(entries, apart=True), merged(others, apart=True), strict=True):
        total += over_noise(Prediction(nominal, one).data - Prediction(nominal, other).data, one.variance)
    return total
