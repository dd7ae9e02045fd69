"""What a diagnosis says, in plain sentences."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from cutvib_ss.diagnosis.place import DISTURBANCE
from cutvib_ss.diagnosis.result import Cause, Diagnosis, FittedParameter, GapFigures, NextTest
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import identifying_names
from cutvib_ss.effects.catalogue import EFFECTS, is_alias
from cutvib_ss.measurement.interference import TONES
from cutvib_ss.measurement.trigger_jitter import JITTER
from cutvib_ss.units import STANDARD_GRAVITY

PLACES = {
    "none": "nowhere",
    "rail": "the rail",
    "rail_ends": "the ends of the rail",
    "head_base": "the guide between rail and head",
    "joint1": "joint 1 (head on its bearings)",
    "joint2": "joint 2 (tool in its slot)",
    "head": "the head",
    "tool": "the tool",
    "measurement": "the measuring chain",
}
"""What each place of the catalogue means; a place that is not here goes by its id."""

VERDICTS = {
    "no_gap": "No gap",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "ambiguous": "Ambiguous",
    "unknown": "Unknown cause",
}
"""Titles of the verdicts."""


def place_name(place: str) -> str:
    """
    A place in words; joined ones by "and".

    Parameters
    ----------
    place : str
        Place of the catalogue, or several joined by ``+``.

    Returns
    -------
    str
        Words.

    Examples
    --------
    >>> place_name("rail_ends+joint2")
    'the ends of the rail and joint 2 (tool in its slot)'
    """
    return " and ".join(PLACES.get(p, p) for p in place.split("+"))


def cause_name(effect: str, place: str, parameters: Mapping[str, FittedParameter] | None = None) -> str:
    """
    A cause in words, with its place.

    Parameters
    ----------
    effect, place : str
        Ids of the catalogue, or several joined by ``+``.
    parameters : mapping of str to FittedParameter, optional
        Its parameters; those that are names (which value is off, which channel is late) are told.

    Returns
    -------
    str
        Words.

    Examples
    --------
    >>> cause_name("guide_compliance", "head_base")
    'the guide between rail and head gives'
    >>> cause_name("local_resonator", "head")
    'something on the head resonates on its own'
    >>> cause_name("parameter_shift", "joint2", {"parameter": FittedParameter("k2", 0.0, "")})
    'k2 is off by more than its tolerance, at joint 2 (tool in its slot)'
    """
    if effect == "none":
        return "nothing: the model is right within its tolerances"
    known, _, last = effect.rpartition("+")
    if known and last == "unknown":
        at, _, where = place.rpartition("+")
        return f"{cause_name(known, at, parameters)}; together with: an element of unknown form at {place_name(where)}"
    if effect == "unknown":
        return "a cause outside the catalogue" + ("" if place == "none" else f", at {place_name(place)}")
    parts = []
    for e, p in zip(effect.split("+"), place.split("+")):
        words = _words(e, parameters)[0] or e.replace("_", " ") + " at {place}"
        parts.append(words.format(place=PLACES.get(p, p), what=_named(e, parameters)))
    return "; together with: ".join(parts)


def inspection_text(effect: str, place: str, parameters: Mapping[str, FittedParameter] | None = None) -> str:
    """What to look at on the machine for a cause, as words without a full stop; empty where they say nothing."""
    parts = []
    for e, p in zip(effect.split("+"), place.split("+")):
        if words := _words(e, parameters)[1]:
            parts.append(words.format(place=PLACES.get(p, p), what=_named(e, parameters)))
    return "; ".join(parts)


def _words(effect: str, parameters: Mapping[str, FittedParameter] | None) -> tuple[str, str]:
    """What a cause means, and what to look at."""
    if effect not in EFFECTS:
        return "", ""
    kind, found = EFFECTS[effect], parameters or {}
    name = kind.grows().carried_by[0]
    size = found.get(name, found.get(f"{effect}.{name}"))
    if size is not None and isinstance(size.value, float) and size.value < 0.0:
        return kind.less or kind.sentence, kind.less_inspection or kind.inspection
    return kind.sentence, kind.inspection


def _named(effect: str, parameters: Mapping[str, FittedParameter] | None) -> str:
    """What a cause names: the value that is off, the channel that is late."""
    names = identifying_names(EFFECTS[effect]) if effect in EFFECTS else tuple(parameters or ())
    found = [f.value for name, f in (parameters or {}).items() if name in names]
    named = ", ".join(value for value in found if isinstance(value, str))
    return {"": "one channel" if "channel" in names else "one value", "all": "every channel"}.get(named, named)


def leaves_out_modes(diagnosis: Diagnosis) -> bool:
    """Whether modes that the model leaves out show: their size is more than the least of its prior."""
    return diagnosis.sizes.get("flexibility", 0.0) > SETTINGS.sizes["flexibility"][0][0]


def disturbances(diagnosis: Diagnosis) -> list[str]:
    """Warnings on what disturbs the records, where nothing else is at fault."""
    scores = diagnosis.findings.place_scores
    if not scores or scores[0].variant != DISTURBANCE:
        return []
    return [w for w in diagnosis.warnings if w.startswith((JITTER, TONES))]


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """
    The whole answer in one plain sentence.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.

    Returns
    -------
    str
        What may be concluded, with the figures it rests on.
    """
    gap = diagnosis.gap
    best = diagnosis.causes[0]
    name = cause_name(best.effect, best.place, best.parameters)
    if diagnosis.verdict == "no_gap":
        noisy = gap.tuned <= 1.1 * gap.noise_floor
        others = (
            "noise, drift and modes that the model leaves out" if leaves_out_modes(diagnosis) else "noise and drift"
        )
        return (
            "Model and machine agree: once the model's values are tuned within their tolerances, the error on records kept "
            f"out of the fit {'is noise' if noisy else f'does not stand out of {others}'} "
            f"({figure(gap.tuned)} {gap.unit}; noise alone {figure(gap.noise_floor)})."
        )
    if diagnosis.verdict in ("explained", "partly_explained"):
        if diagnosis.verdict == "explained":
            said = (
                f"One cause explains {_part_closed(diagnosis)}: {name}. With it in the model the mean error on records kept out "
                "of the fit"
            )
        else:
            effect, _, _ = best.effect.rpartition("+")
            at, _, rest = best.place.rpartition("+")
            said = (
                f"One known cause and something else: {cause_name(effect, at, best.parameters)}. With it and an element of "
                f"unknown form, most probably at {place_name(rest)}, the mean error on records kept out of the fit"
            )
        said += f" falls from {figure(gap.before)} to {figure(gap.after)} {gap.unit}"
        if gap.after <= 1.05 * gap.noise_floor:
            return f"{said}: no more than the noise of the measurement ({figure(gap.noise_floor)})."
        repeats = repeatability_in_gap(diagnosis)
        if repeats >= gap.after:
            return f"{said}: no more than the rig repeats to; noise alone leaves {figure(gap.noise_floor)}."
        if repeats > 0.2 * gap.after:
            return (
                f"{said}; about {figure(repeats)} of that is the rig's repeatability, and noise alone leaves "
                f"{figure(gap.noise_floor)}."
            )
        return f"{said}; noise alone leaves {figure(gap.noise_floor)}."
    if diagnosis.verdict == "ambiguous":
        few = [diagnosis.causes[i] for i in diagnosis.ambiguity_set]
        listed = "; or ".join(cause_name(c.effect, c.place, c.parameters) for c in few)
        told = f"There is a gap, and this campaign cannot tell these causes apart: {listed}."
        shifted = next((v for c in few if (v := _alias(c)) is not None), None)
        if shifted is None or all(c.effect != "unknown" for c in few):
            return told
        return f"{told} Measure {shifted} by itself, since other causes at its place show as such a value."
    if kinds := disturbances(diagnosis):
        which = ", ".join(w.partition(":")[0] for w in kinds)
        return (
            f"The measurement is disturbed ({which}), and nothing else is at fault: without that, and once the model's "
            "values are tuned within their tolerances, the error on records kept out of the fit is "
            f"{figure(gap.tuned)} {gap.unit}; noise alone leaves {figure(gap.noise_floor)}."
        )
    nearest = next((c for c in diagnosis.causes if c.effect not in ("none", "unknown")), best)
    return (
        f"There is a gap, most probably at {place_name(diagnosis.where.place)}, that no cause of the catalogue "
        f"explains: the best of them ({cause_name(nearest.effect, nearest.place, nearest.parameters)}) leaves "
        f"{figure(nearest.after)} {gap.unit}, noise alone {figure(gap.noise_floor)}."
    )


def known_floor(diagnosis: Diagnosis) -> float:
    """Error that noise and repeatability leave together, in the gap's unit."""
    repeats = repeatability_in_gap(diagnosis)
    return math.hypot(diagnosis.gap.noise_floor, repeats if math.isfinite(repeats) else 0.0)


def _part_closed(diagnosis: Diagnosis) -> str:
    """How much of the gap the cause closes, in words: all, where hardly more than noise and repeatability is left."""
    gap, known = diagnosis.gap, known_floor(diagnosis)
    if gap.after < 1.5 * known:
        return "the gap"
    return "most of the gap" if gap.after - known < 0.5 * (gap.before - known) else "part of the gap"


def repeatability_in_gap(diagnosis: Diagnosis) -> float:
    """
    Mean modulus of what repetitions differ by beyond noise, in the gap's unit; NaN where nothing repeats.

    A deviation in proportion to the response, complex Gaussian, of root mean square R·|H|: its mean modulus is √π/2·R·|H|.
    """
    r = diagnosis.repeatability
    sizes = [
        np.abs(c.measured.data) / (STANDARD_GRAVITY if c.measured.units[0] == "m/s^2/N" else 1.0)
        for c in diagnosis.comparisons
    ]
    if not sizes or not math.isfinite(r):
        return math.nan
    return float(0.5 * math.sqrt(math.pi) * r * np.mean([np.mean(s) for s in sizes]))


def _alias(cause: Cause) -> str | None:
    """Name of the shifted value as which other causes appear, if that is the cause."""
    named = {name: p.value for name, p in cause.parameters.items() if isinstance(p.value, str)}
    return next(iter(named.values()), None) if is_alias(cause.effect, named) else None


def next_test_sentence(test: NextTest) -> str:
    """What to measure next, in one sentence."""
    steps = [] if test.position is None else [f"put the head at y/L = {test.position:.3g}"]
    steps += [] if test.peak_force is None else [f"give blows of about {figure(test.peak_force)} N"]
    steps.append(f"look at {test.channel}")
    told = steps[0] if len(steps) == 1 else f"{', '.join(steps[:-1])} and {steps[-1]}"
    return f"{told[0].upper()}{told[1:]}: {test.why.rstrip('.')}."


def shrinkage_text(gap: GapFigures) -> tuple[str, str]:
    """How much of the error is closed, and its interval."""
    if not math.isfinite(gap.shrinkage):
        return "not known", ""
    low, high = gap.shrinkage_interval
    interval = f"95 % interval {100 * low:.1f} to {100 * high:.1f} %" if math.isfinite(low + high) else ""
    return f"{100 * gap.shrinkage:.1f} %", interval


def excess_text(gap: GapFigures) -> str:
    """How much is closed of what stands above the noise, as the end of a sentence."""
    excess = gap.before - gap.noise_floor
    if not math.isfinite(excess) or excess < 0.1 * gap.before:
        return ""
    closed = min(max((gap.before - gap.after) / excess, 0.0), 1.0)
    return f"; of what stood above the noise, {100 * closed:.0f} %"


def bands_text(bands: tuple[tuple[float, float], ...]) -> str:
    """Bands of frequency for reading."""
    return ", ".join(f"{low:.4g}-{high:.4g} Hz" for low, high in bands) or "none"


def figure(value: float) -> str:
    """A figure with three significant digits."""
    return f"{value:.3g}" if math.isfinite(value) else "-"


def parameter_text(parameter: FittedParameter) -> str:
    """
    A fitted value with its standard deviation, rounded to it, and its unit.

    Examples
    --------
    >>> parameter_text(FittedParameter(1.31e7, 2.4e5, "N/m"))
    '(1.310 ± 0.024)·10⁷ N/m'
    >>> parameter_text(FittedParameter(0.97, 0.012, "1"))
    '0.970 ± 0.012'
    >>> parameter_text(FittedParameter(True, 0.0, ""))
    'yes'
    """
    value, std = parameter.value, parameter.std
    if isinstance(value, str):  # the name of a channel, or of the value that is off
        return value
    if isinstance(value, bool):
        return "yes" if value else "no"
    unit = _unit(parameter)
    if not math.isfinite(value):
        return "not determined"
    shift = _shift(max(abs(value), std if math.isfinite(std) else 0.0))
    mantissa = value / 10.0**shift
    if not math.isfinite(std) or std <= 0:
        text = f"{mantissa:.4g}"
    else:
        error = std / 10.0**shift
        digits = min(max(0, 1 - math.floor(math.log10(error))), 8)
        text = f"{mantissa:.{digits}f} ± {error:.{digits}f}"
    return (f"({text}){_power(shift)}" if "±" in text and shift else f"{text}{_power(shift)}") + unit


def interval_text(parameter: FittedParameter) -> str:
    """
    The 95 % interval of a fitted value; empty where there is none.

    Examples
    --------
    >>> interval_text(FittedParameter(7.923e9, 1.9e7, "N m/rad^3"))
    '(7.886 to 7.960)·10⁹ N m/rad³'
    """
    value, std = parameter.value, parameter.std
    if isinstance(value, str) or not math.isfinite(std) or std <= 0:
        return ""
    low, high = value - 1.96 * std, value + 1.96 * std
    shift = _shift(max(abs(low), abs(high)))
    text = f"{low / 10.0**shift:.4g} to {high / 10.0**shift:.4g}"
    if shift:
        digits = min(max(0, 1 - math.floor(math.log10(std / 10.0**shift))), 8)
        text = f"({low / 10.0**shift:.{digits}f} to {high / 10.0**shift:.{digits}f}){_power(shift)}"
    return text + _unit(parameter)


def _unit(parameter: FittedParameter) -> str:
    return "" if parameter.unit in ("", "1", "-") else f" {parameter.unit.replace('^2', '²').replace('^3', '³')}"


def _shift(largest: float) -> int:
    """Power of ten that is written apart: that of large and of small values."""
    power = math.floor(math.log10(largest)) if largest > 0 else 0
    return power if power >= 5 or power <= -4 else 0


def _power(shift: int) -> str:
    raised = str(shift).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"·10{raised}" if shift else ""


def parameters_text(cause: Cause) -> list[tuple[str, str]]:
    """All parameters of a cause for reading."""
    return [(name, parameter_text(parameter)) for name, parameter in cause.parameters.items()]
