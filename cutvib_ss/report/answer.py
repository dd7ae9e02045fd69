"""How sure a diagnosis is and why, what to do, and what limits it: sentences and rows for the report and the command line."""

from __future__ import annotations

import math

from cutvib_ss.diagnosis.observations import SPOILT
from cutvib_ss.diagnosis.result import Diagnosis, Limit
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.plot.diagnosis import probability_text
from cutvib_ss.report.wording import (
    cause_name,
    disturbances,
    figure,
    inspection_text,
    known_floor,
    leaves_out_modes,
    next_test_sentence,
    place_name,
    repeatability_in_gap,
    shrinkage_text,
)
from cutvib_ss.units import percent

Row = tuple[str, ...]

SAVE = "--save-machine writes them"
"""Where the values of the corrected model are to be had."""


def why_sentences(d: Diagnosis) -> list[str]:
    """How sure the answer is, and what that rests on."""
    best = d.causes[0]
    rivals = [c for c in d.causes[1:] if c.probability >= 1e-3]
    what = "that the model lacks nothing, against" if best.effect == "none" else "of this answer, among"
    said = [
        f"Probability {probability_text(best.probability)} {what} the causes of the catalogue and elements of unknown form"
    ]
    if rivals:
        c = rivals[0]
        said[0] += f"; next comes {probability_text(c.probability)}: {cause_name(c.effect, c.place, c.parameters)}"
    said[0] += "."
    if d.verdict != "no_gap":
        share, interval = shrinkage_text(d.gap)
        line = f"Of the error of the model as given {share} is closed on records that were not fitted"
        line += f" ({interval})." if interval else "."
        if tuning_suffices(d):
            line += (
                " Tuning alone leaves hardly more than noise and repeatability, so the size of the residual does not tell "
                "them apart: it has to move the model's values further than their tolerances make credible."
            )
        elif math.isfinite(best.share):
            taken = f"{100 * best.share:.0f} %"
            line += f" Of what stands above noise and repeatability once the model is tuned, the cause takes {taken}."
        said.append(line)
        said.append(place_set_sentence(d))
        said += independent_sentences(d)
    if math.isfinite(best.reduced_chi2):
        said.append(_left_over(d))
    return [s for s in said if s]


def _left_over(d: Diagnosis) -> str:
    """Whether the answer leaves more than noise and repeatability: by χ², and by the size of the error itself."""
    best, known = d.causes[0], known_floor(d)
    what = "The tuned model" if d.verdict == "no_gap" else "It"
    chi2 = f"χ² per datum {figure(best.reduced_chi2)} on records kept out of the fit"
    if best.reduced_chi2 >= 1.2:
        return f"{what} leaves more than noise and repeatability ({chi2})."
    if d.gap.after > 1.5 * known and math.isfinite(known):
        # χ² counts the discrepancy that the fit itself asks for: a law of the wrong form can reach 1 with it.
        return (
            f"{what} leaves {figure(d.gap.after / known)} times what noise and repeatability explain; only the model "
            f"discrepancy that is allowed for covers it ({chi2})."
        )
    return f"{what} leaves no more than noise and repeatability ({chi2})."


def tuning_suffices(d: Diagnosis) -> bool:
    """Whether the tuned model without any cause leaves less than a tenth above noise and repeatability, though it is not right."""
    return d.verdict != "no_gap" and not disturbances(d) and d.gap.tuned < 1.1 * known_floor(d)


def place_set_sentence(d: Diagnosis) -> str:
    """Which places cannot be told apart."""
    places = [p for p in d.where.place_set if p != "none"]
    if not places:
        return ""
    if len(places) == 1:
        return f"One place carries 95 % of the probability: {place_name(places[0])}."
    return f"These places cannot be told apart, together they carry 95 %: {'; '.join(place_name(p) for p in places)}."


def independent_sentences(d: Diagnosis) -> list[str]:
    """Whether the search without a hypothesis points to the same place."""
    scores = d.findings.place_scores
    if len(scores) < 2:
        return []
    first, second = scores[0], scores[1]
    figures = f"it leaves {figure(first.left)} times the noise there, {figure(second.left)} times at the next place"
    if first.place in d.where.place.split("+"):
        return [
            f"A search without a hypothesis (an unknown dynamic stiffness at each place) points to the same place: {figures}."
        ]
    return [
        f"A search without a hypothesis points elsewhere, to {place_name(first.place)} ({figures}): look there too."
    ]


def to_do(d: Diagnosis) -> list[str]:
    """What to inspect on the machine, and what to measure next."""
    steps = []
    if d.verdict == "no_gap":
        low, high = d.gap.band_hz
        steps.append(
            f"No inspection is needed: the model holds from {figure(low)} to {figure(high)} Hz as far as was measured."
        )
        steps += [f"This does not cover what was left out: {w}." for w in d.warnings if SPOILT in w]
        if d.gap.before > 1.2 * d.gap.tuned:
            steps.append(
                f"Work with the tuned values ({SAVE}): the model as given errs by {figure(d.gap.before)} {d.gap.unit}, tuned by "
                f"{figure(d.gap.tuned)}."
            )
        return steps
    for i in d.ambiguity_set:
        c = d.causes[i]
        words = inspection_text(c.effect, c.place, c.parameters)
        if words:
            steps.append(f"Inspect: {words}.")
    if d.verdict in ("unknown", "partly_explained"):
        place = d.where.place if d.verdict == "unknown" else d.causes[0].place.rpartition("+")[2]
        if said := disturbances(d):
            steps += [f"Measure again without {w}." for w in said]
        elif place == "measurement":
            steps.append("Look at the measuring chain: sensors and how they are mounted, cables, ranges, filters.")
        else:
            steps.append(
                f"Look at {place_name(place)} for what the model lacks; the dynamic stiffness below shows how it must behave."
            )
    if d.next_test is not None:
        steps.append(f"Next test: {next_test_sentence(d.next_test)}")
    elif (check := confirming_test(d)) != "":
        steps.append(check)
    return list(dict.fromkeys(steps))


def confirming_test(d: Diagnosis) -> str:
    """The record that would confirm a fixed cause: where the re-tuned model's error was largest over the noise."""
    rows = [r for r in d.where.by_position if r.label is not None]
    if not d.where.by_channel:
        return ""
    channel = max(d.where.by_channel, key=lambda r: r.error / max(r.noise, 1e-300)).label
    at = f" with the head at y/L = {figure(float(max(rows, key=lambda r: r.error).label))}" if rows else ""  # type: ignore[arg-type]
    return f"Next test: once it is fixed, measure again{at} and look at {channel}: there the error was largest."


def size_rows(d: Diagnosis) -> list[Row]:
    """What separates a right model from the measurement: noise, repeatability, discrepancy; size and source of each."""
    rows: list[Row] = []
    unit = d.gap.unit
    factor = d.sizes.get("noise", math.nan)
    said = "the scatter of the blows or averages behind each estimate"
    if math.isfinite(factor) and factor > 1.05:
        said += f"; its variance had to be taken {figure(factor)} times larger than the records state"
    rows.append(("noise", f"{figure(d.gap.noise_floor)} {unit}", said))
    if math.isfinite(d.repeatability):
        rows.append(
            (
                "repeatability",
                f"{percent(d.repeatability)}, about {figure(repeatability_in_gap(d))} {unit}",
                "difference beyond noise between records of the same configuration",
            )
        )
    else:
        rows.append(
            (
                "repeatability",
                "not measured",
                "no two records are of the same configuration; measure one position twice",
            )
        )
    for key, name, words in (
        ("drift", "drift", "change of stiffnesses and gains between sessions (standard deviation)"),
        ("within", "drift within sessions", "the same from record to record of a session"),
        ("nominal", "discrepancy, nominal", "error of the tuned nominal elements in dynamic stiffness"),
        ("cause", "discrepancy, cause", "error of the named cause's model in dynamic stiffness"),
    ):
        if math.isfinite(value := d.sizes.get(key, math.nan)):
            least = " or less" if value <= 3e-5 else ""
            rows.append((name, f"{percent(value)}{least}", words))
    position, point, angle = 1e3 * SETTINGS.set_up_position, 1e3 * SETTINGS.set_up_point, SETTINGS.set_up_angle
    for key, name, units, words in (
        ("placing", "position", ((position, "mm"),), "error of the head's position (standard deviation)"),
        (
            "aim",
            "aim",
            ((angle, "rad"), (point, "mm")),
            "tilt of the force, and offset from its point (standard deviations)",
        ),
    ):
        if math.isfinite(value := d.sizes.get(key, math.nan)):
            least = " or less" if value <= SETTINGS.sizes[key][0][0] else ""
            rows.append((name, " and ".join(f"{value * size:.2g} {unit}" for size, unit in units) + least, words))
    for key, name, words in (
        ("parts", "parts", "error of single springs and masses, or frequencies of the rail (standard deviation)"),
        ("losses", "losses", "error of the damping of single modes (standard deviation)"),
    ):
        if math.isfinite(value := d.sizes.get(key, math.nan)):
            rows.append((name, f"{value:.2g} of the tolerance", words))
    if math.isfinite(value := d.sizes.get("flexibility", math.nan)):
        words = (
            "flexibility of modes that the model leaves out, of what the ports' masses give way at their frequencies"
        )
        rows.append(
            ("residual flexibility", f"{100 * value:.3g} %" + ("" if leaves_out_modes(d) else " or less"), words)
        )
    return rows


def sizes_sentence(d: Diagnosis) -> str:
    """What limits the answer, in one sentence."""
    gap, repeats = d.gap, repeatability_in_gap(d)
    parts = [f"noise accounts for {figure(gap.noise_floor)} {gap.unit}"]
    if math.isfinite(repeats):
        parts.append(f"repeatability for about {figure(repeats)}")
    known = known_floor(d)
    if gap.after <= known:
        told = "noise" if len(parts) == 1 else "noise and repeatability"
        return f"The {figure(gap.after)} {gap.unit} that are left are no more than {told} would leave ({figure(known)} {gap.unit})."
    rest = math.sqrt(max(gap.after**2 - known**2, 0.0))
    parts.append(
        f"what remains, about {figure(rest)}, is discrepancy of the model"
        if rest > 0.3 * gap.after
        else "nothing that stands out remains"
    )
    return f"Of the {figure(gap.after)} {gap.unit} that are left, {', '.join(parts[:-1])}; {parts[-1]} (squares add)."


def limit_rows(d: Diagnosis) -> list[Row]:
    """What the data still allow of causes that were not named."""
    return [
        (cause_name(x.effect, x.place), x.parameter, _bound(x, x.allowed), _bound(x, x.visible))
        for x in d.limits
    ]  # fmt: skip


def _bound(limit: Limit, value: object) -> str:
    """A bound, or a pair of bounds of a signed value."""
    unit = "" if limit.unit in ("", "1") else f" {limit.unit}"
    if isinstance(value, tuple | list):
        return f"{figure(float(value[0]))} to {figure(float(value[1]))}{unit}"
    return f"{figure(float(value))}{unit}"  # type: ignore[arg-type]
