"""What a diagnosis found beside its verdict, as sentences and rows for the report and the command line."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cutvib_ss.diagnosis.consequence_result import Consequence, Consequences, Loop
from cutvib_ss.diagnosis.findings import Band, Correlation, Distances, DynamicStiffness, Metric, ModePair, NuGap
from cutvib_ss.diagnosis.metrics import ALL
from cutvib_ss.diagnosis.result import Diagnosis, FittedParameter
from cutvib_ss.report.wording import cause_name, figure, parameter_text, place_name

NOTICES = 0.3
"""ν-gap from which a loop of ordinary robustness is no longer sure of its margins …"""
FORGIVES = 0.1
"""… and below which hardly any loop would notice."""

Row = tuple[str, ...]

_FORCE = {"stiffness": "N/m", "loss stiffness": "N/m", "damping": "N s/m", "mass": "kg", "inertia": "kg"}
_TORQUE = {
    "stiffness": "N m/rad",
    "loss stiffness": "N m/rad",
    "damping": "N m s/rad",
    "mass": "kg m²",
    "inertia": "kg m²",
}
_UNITS = {"N/m": _FORCE, "m/N": _FORCE, "N m/rad": _TORQUE, "rad/(N m)": _TORQUE}
_PLAIN = {"frequency": "Hz", "delay": "s"}
"""Units of a law's values, by the unit of the function that it explains."""


def sentences(d: Diagnosis) -> list[str]:
    """All that was found beside the verdict, for reading."""
    f = d.findings
    said = [*stiffness_sentences(f.stiffness), second_best_sentence(d)]
    if f.nu_gap is not None:
        said.append(nu_gap_sentence(f.nu_gap))
    if f.consequences is not None:
        said += [consequences_sentence(f.consequences), *(f"Note: {w}." for w in f.consequences.warnings)]
    return [s for s in said if s]


def stiffness_sentences(functions: Sequence[DynamicStiffness]) -> list[str]:
    """What the shape of each unknown dynamic stiffness says."""
    out = []
    for z in functions:
        what = f"{place_name(z.place)} ({z.label})" if z.label != z.place else place_name(z.place)
        if z.element_type is not None and len(z.levels) == 1:
            units = _UNITS.get(z.unit, {}) | _PLAIN
            values = ", ".join(
                f"{name} {parameter_text(FittedParameter(value, float('nan'), units.get(name, '')))}"
                for name, value in z.element_type.parameters.items()
            )
            said = f"looks like a {z.element_type.name} ({z.element_type.law}: {values}; {100 * z.element_type.share:.0f} % of it)"
        elif z.with_level:
            said = f"shows {z.with_level}"
        else:
            said = "follows none of the simple element types"
        out.append(f"The {z.quantity} identified at {what} {said}.")
    return out


def nu_gap_sentence(gap: NuGap) -> str:
    """Whether a controller would notice."""
    first = gap.channels[0]
    largest = max(first.before, first.models)
    if largest < FORGIVES:
        said = "hardly any controller would be affected"
    elif largest < NOTICES:
        said = "a controller with small margins would be affected"
    else:
        said = "a controller designed on the nominal model is not sure of its margins"
    condition = {
        "holds": "The winding condition holds",
        "fails": "The winding condition fails",
        "not checked": "The winding condition was not checked",
    }
    return (
        f"In {first.channel} the ν-gap from the model as given is {figure(largest)}: {said}. "
        f"{condition[gap.winding]} ({gap.why})."
    )


def nu_gap_rows(gap: NuGap) -> list[Row]:
    """The ν-gaps by channel."""
    return [
        (
            c.channel,
            *(figure(v) for v in (c.before, c.tuned, c.after, c.noise, c.models)),
            "" if c.scale is None else figure(c.scale),
        )
        for c in gap.channels
    ]


def metric_rows(metrics: Sequence[Metric], by: str) -> list[Row]:
    """Distances averaged over records, by position, level or channel."""
    single = [m for m in metrics if m.channel != ALL]
    labels = list(dict.fromkeys(getattr(m, by) for m in single))
    if by != "channel":
        labels = sorted((v for v in labels if v is not None), key=float)
    out = []
    for label in labels:
        own = [m for m in single if getattr(m, by) == label]

        def mean(side: str, name: str, rows: Sequence[Metric] = own) -> str:
            sides: list[Distances | None] = [getattr(m, side) for m in rows]
            values = [getattr(d, name) for d in sides if d is not None]
            return figure(float(np.mean(values))) if values else "-"

        out.append(
            (
                label if isinstance(label, str) else figure(label),
                *(mean(side, "mean_modulus") for side in ("before", "tuned", "after", "second")),
                figure(float(np.mean([m.noise_modulus for m in own]))),
                mean("before", "frac"),
                mean("after", "frac"),
                mean("before", "log_error_db"),
                mean("after", "log_error_db"),
            )
        )
    return out


def frac_rows(found: Sequence[Correlation]) -> tuple[list[str], list[Row]]:
    """FRAC of the model as given and with the cause, a row a position and input, two columns a channel; heads, then rows."""
    channels = list(dict.fromkeys(c.channel for c in found))
    places = list(dict.fromkeys((c.position, c.input) for c in found))
    by_key = {(c.position, c.input, c.channel): c for c in found}
    rows: list[Row] = []
    for position, struck in places:
        told = ("" if position is None else figure(position), "" if struck is None else f"force at {struck}")
        own = [by_key.get((position, struck, channel)) for channel in channels]
        values = [v for c in own for v in ((None, None) if c is None else (c.before, c.after))]
        rows.append((", ".join(part for part in told if part), *("-" if v is None else figure(v) for v in values)))
    return ["", *(f"{channel} {side}" for channel in channels for side in ("before", "after"))], rows


def mode_rows(found: Sequence[ModePair]) -> list[Row]:
    """Modes of the corrected model beside those of the nominal one."""
    return [
        (
            "" if m.position is None else figure(m.position),
            "-" if m.nominal_hz is None else f"{m.nominal_hz:.4g}",
            f"{m.corrected_hz:.4g}",
            "-" if m.nominal_damping is None else f"{100 * m.nominal_damping:.2g}",
            f"{100 * m.corrected_damping:.2g}",
            "new" if m.mac is None else f"{m.mac:.3f}",
        )
        for m in found
    ]


def band_rows(bands: Sequence[Band]) -> list[Row]:
    """The error by bands."""
    return [
        (
            f"{b.low:.4g}-{b.high:.4g}",
            *(figure(v) for v in (b.before, b.tuned, b.after, b.second, b.noise)),
            _band_remarks(b),
        )
        for b in bands
    ]


def _band_remarks(b: Band) -> str:
    if not b.stands_out:
        return ""
    said = []
    if b.moves_with_position:
        centres = [c for _, c in b.centres]
        said.append(f"moves with the position, {min(centres):.4g} to {max(centres):.4g} Hz")
    if b.moves_with_level:
        said.append("moves with the level")
    if np.isfinite(b.coherence) and b.coherence >= 0.005:
        said.append(f"{100 * b.coherence:.0f} % is common to all records of a position")
    return "; ".join(said)


def second_judged(d: Diagnosis) -> bool:
    """Whether another answer was judged on records kept out of the fit: else its column would hold dashes alone."""
    return any(m.second is not None for m in d.findings.metrics) or any(np.isfinite(b.second) for b in d.findings.bands)


def second_best_sentence(d: Diagnosis) -> str:
    """What the choice of the best cause is worth against the second-best."""
    judged = [c for c in d.causes if c.effect not in ("none", "unknown") and np.isfinite(c.after)]
    if len(judged) < 2:
        return ""
    best, second = judged[:2]
    worth = (
        "no more than the best"
        if second.after <= 1.02 * best.after
        else f"{second.after / best.after:.3g} times the best's"
    )
    return (
        f"The second-best cause ({cause_name(second.effect, second.place, second.parameters)}) leaves "
        f"{figure(second.after)} {d.gap.unit} on held-out records: {worth}."
    )


def changes_vibration(consequences: Consequences) -> bool:
    """Whether fixing a cause changes the vibration: not without a cause, nor where it lies in the measurement."""
    return any(o.fixed != o.now for o in consequences.vibration)


def consequence_rows(consequences: Consequences) -> list[Row]:
    """The vibration now and with the cause fixed."""
    rows = []
    for o in consequences.vibration:
        row: Row = (
            "-" if o.position is None else figure(o.position),
            "-" if o.measured is None else figure(o.measured),
            _with_interval(o.now, o.now_interval),
        )
        rows.append(
            (*row, _with_interval(o.fixed, o.fixed_interval), _change(o)) if changes_vibration(consequences) else row
        )
    return rows


def _with_interval(value: float, interval: tuple[float, float]) -> str:
    low, high = interval
    # As many digits as tell the ends of the interval apart.
    digits = int(np.clip(1 - np.floor(np.log10(max((high - low) / max(abs(value), 1e-300), 1e-12))), 2, 5))
    return f"{value:.{digits}g} ({low:.{digits}g} to {high:.{digits}g})"


def _change(o: Consequence) -> str:
    low, high = (100 * (ratio - 1.0) for ratio in o.ratio_interval)
    return f"{100 * (o.fixed / o.now - 1.0):+.1f} % ({low:+.1f} to {high:+.1f} %)"


def loop_rows(loops: Sequence[Loop]) -> list[Row]:
    """A controller on both models."""
    return [
        (
            "-" if loop.position is None else figure(loop.position),
            figure(loop.nominal_margin),
            f"{loop.nominal_attenuation_db:.1f}",
            figure(loop.corrected_margin) if loop.stable else "unstable",
            f"{loop.corrected_attenuation_db:.1f}" if loop.stable else "-",
        )
        for loop in loops
    ]


def consequences_sentence(consequences: Consequences) -> str:
    """The figures that matter most, in one sentence."""
    if not consequences.vibration:
        return ""

    def over(pick: Callable[[Consequence], float]) -> str:
        values = [pick(o) for o in consequences.vibration]
        low, high = figure(min(values)), figure(max(values))
        return low if low == high else f"{low} to {high}"

    said = f"At {figure(consequences.frequency)} Hz {consequences.channel} responds with {over(lambda o: o.now)}"
    said += f" {consequences.unit} now"
    said += f", and with the cause fixed with {over(lambda o: o.fixed)}." if changes_vibration(consequences) else "."
    if consequences.loops:
        unstable = sum(not loop.stable for loop in consequences.loops)
        worst = min((loop.corrected_attenuation_db for loop in consequences.loops if loop.stable), default=float("nan"))
        meant = min(loop.nominal_attenuation_db for loop in consequences.loops)
        if unstable:
            said += f" A controller designed on the nominal model is unstable at {unstable} of {len(consequences.loops)} positions."
        else:
            said += f" A controller designed on the nominal model attenuates {worst:.1f} dB at worst, {meant:.1f} dB intended."
    return said
