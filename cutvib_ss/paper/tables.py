"""Every table of the paper beside what this package computes (`cutvib paper`)."""

from __future__ import annotations

from dataclasses import replace
from math import degrees
from typing import TypeAlias

import numpy as np

from cutvib_ss.absorber import WORKING_FREQUENCY, check_absorber, misprinted_absorber, parametric_study
from cutvib_ss.identification.bounded_fit import bounded_fit
from cutvib_ss.identification.first_guess import PAPER_DIP, PAPER_PEAKS, first_guess, resonances, stiffness_ratio
from cutvib_ss.identification.fitted_data import fit_data
from cutvib_ss.identification.held_head import held_natural_frequencies, held_peaks, held_response
from cutvib_ss.identification.rail_mass import recover_rail_mass
from cutvib_ss.identification.uncertainty import determination
from cutvib_ss.model.head import HEAD_PARAMETERS
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.rail import natural_frequencies
from cutvib_ss.paper.objective import least_of_eq_21
from cutvib_ss.parameters import (
    PAPER_POSITIONS,
    TABLE_7_PRINTED,
    HeadParameters,
    recovered_rail,
    table_1,
    table_2,
    table_3,
    table_4,
    table_5,
    table_6,
    table_7,
)
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modes import modes
from cutvib_ss.units import STANDARD_GRAVITY

# A line of a table: name with unit, printed (None where the paper has no number), computed (None where what is printed does
# not allow it), note.
Row: TypeAlias = dict[str, str | float | None]

_UNITS = ("kg", "kg", "m", "m", "deg", "deg", "N m/rad", "N m/rad", "N m s/rad", "N m s/rad")
_NO_PART = 1e-6
"""Part of a unit direction below which a parameter has none in it."""
_PLACES = {1 / 2: "FC or BC, L/2", 1 / 3: "CC, L/3"}


def paper_tables() -> dict[str, list[Row]]:
    """
    Tables 1 to 7, the first guess, the rail's mass and Fig. 20's effect: printed and computed.

    Returns
    -------
    dict of str to list of dict
        By ``"1"`` to ``"7"``, ``"first_guess"``, ``"rail"`` and ``"fig20"``: rows with ``name``, ``printed`` (None where the
        paper has no number), ``computed`` (None where what is printed does not allow it) and ``note``.

    Examples
    --------
    >>> [row["computed"] for row in paper_tables()["5"]]
    [31.7, 126.8, 285.3, 507.2]
    """
    return {
        "1": _table_1(),
        "2": _table_2(),
        "3": _table_3(),
        "4": _table_4(),
        "5": _table_5(),
        "6": _table_6(),
        "7": _table_7(),
        "first_guess": _first_guess(),
        "rail": _rail(),
        "fig20": _fig20(),
    }


def _row(name: str, printed: float | None, computed: float | None, note: str = "") -> Row:
    return {
        "name": name,
        "printed": None if printed is None else float(printed),
        "computed": None if computed is None else float(computed),
        "note": note,
    }


def _head_values(head: HeadParameters) -> dict[str, float]:
    """The ten parameters as the tables print them, angles in degrees."""
    values = {name: float(getattr(head, name)) for name in HEAD_PARAMETERS}
    return {name: degrees(v) if name.startswith("theta") else v for name, v in values.items()}


def _table_1() -> list[Row]:
    notes = {
        "m1": "Eqs. 15 and 19: κ m2 with κ from the two peaks; Eq. 15 with the printed k1 gives 25 kg",
        "m2": "chosen",
        "l1": "chosen",
        "l2": "chosen",
        "theta01": "assumed",
        "theta02": "assumed",
        "k1": "Eq. 18: κ k2; the printed value is κ = 50, the printed peaks give κ = 47.8",
        "k2": "Eq. 16",
        "c1": "Eq. 20 with ζ = 0.1; the printed value is ζ = 0.05 with m1 = 26 kg",
        "c2": "Eq. 20 with ζ = 0.1; the printed value is half of it, ζ = 0.05",
    }
    printed, computed = _head_values(table_1()), _head_values(first_guess(PAPER_PEAKS, PAPER_DIP))
    held = held_natural_frequencies(table_1())
    own = "held frequency of the printed values: Table 1 was made to meet the measured peaks"
    return [
        _row(f"{name} [{unit}]", printed[name], computed[name], notes[name])
        for name, unit in zip(HEAD_PARAMETERS, _UNITS, strict=True)
    ] + [_row(f"resonance {k + 1} [Hz]", PAPER_PEAKS[k], held[k], own) for k in range(2)]


def _table_2() -> list[Row]:
    """The limits follow from Table 1, but for dampings of a first guess before its rounding."""
    guess = _head_values(table_1())
    # ζ = 0.05 in both joints, m1 = 26 kg in the first: what Table 1 rounds, or mistakes.
    damping = {"c1": 0.1 * (table_1().k1 * 26.0 * table_1().l1 ** 2) ** 0.5}
    damping["c2"] = 0.1 * (table_1().k2 * table_1().m2 * table_1().l2 ** 2) ** 0.5
    plus = {"m1": 1.0, "m2": 0.1}
    share = {"l1": 0.1, "l2": 0.1, "k1": 0.1, "k2": 0.1, "c1": 0.2, "c2": 0.2}
    rows = []
    for sign, limit, table in ((-1.0, "lower", table_2()[0]), (1.0, "upper", table_2()[1])):
        for (name, value), unit in zip(_head_values(table).items(), _UNITS, strict=True):
            if name in damping:
                made, note = damping[name] * (1 + sign * share[name]), "±20 % of Eq. 20 with ζ = 0.05"
                note += ", m1 = 26 kg" if name == "c1" else ""
            elif name in share:
                made, note = guess[name] * (1 + sign * share[name]), f"Table 1 ±{100 * share[name]:g} %"
            elif name in plus:
                made, note = guess[name] + sign * plus[name], f"Table 1 ±{plus[name]:g} kg"
            else:
                above = {"theta01": 10.0, "theta02": 20.0}[name]
                made, note = guess[name] + (above if sign > 0 else 0.0), f"Table 1 +{above:g} deg, upward only"
            rows.append(_row(f"{name} [{unit}], {limit}", value, made, note))
    return rows


def _table_4() -> list[Row]:
    """Errors against measurements that are not printed: only what the model itself answers can be computed."""
    freq = np.arange(150.0, 300.25, 0.5)
    machine = published_machine()
    rows = []
    for name, printed in table_4().items():
        frf = frequency_response(machine, PAPER_POSITIONS[name], freq, outputs=["tool_x", "tool_z"])
        size = np.abs(frf.data[0, :, 0]).mean(axis=1) / STANDARD_GRAVITY
        why = "not reproducible: the measured responses are printed as curves only, and which responses were averaged is not said"
        rows.append(_row(f"mean error, {name} [g/N]", printed, None, why))
        for axis, value in zip(("XX", "ZX"), size, strict=True):
            share = f"the printed error is {100 * printed / value:.0f} % of it"
            if name.endswith("R"):
                share += f"; the position is not printed, y/L = {PAPER_POSITIONS[name]:g} is assumed"
            rows.append(_row(f"mean modulus of the model's {axis}, {name} [g/N]", None, value, share))
    return rows


def _first_guess() -> list[Row]:
    kappa = stiffness_ratio(PAPER_PEAKS, PAPER_DIP)
    printed_kappa = table_1().k1 / table_1().k2
    low, high = resonances(PAPER_DIP, kappa)
    as_printed = first_guess(PAPER_PEAKS, PAPER_DIP, damping_ratio=0.05, ratio=printed_kappa)
    heavy = replace(as_printed, m1=26.0)
    return [
        _row("κ = k1/k2", printed_kappa, kappa, "Eq. 19 solved for the interval between the peaks; printed: Table 1"),
        _row("f2 - f1 [Hz]", PAPER_PEAKS[1] - PAPER_PEAKS[0], high - low, "Eq. 19; κ is found from this"),
        _row("f1 [Hz]", PAPER_PEAKS[0], low, "Eq. 19 with that κ: the dip fixes the middle, not the peaks themselves"),
        _row("f2 [Hz]", PAPER_PEAKS[1], high, "Eq. 19 with that κ"),
        _row("k1 [N m/rad]", table_1().k1, as_printed.k1, "Eq. 18 with κ = 50"),
        _row("k2 [N m/rad]", table_1().k2, as_printed.k2, "Eq. 16"),
        _row("c1 [N m s/rad]", table_1().c1, 0.1 * (heavy.k1 * heavy.m1 * heavy.l1**2) ** 0.5, "ζ = 0.05, m1 = 26 kg"),
        _row("c2 [N m s/rad]", table_1().c2, as_printed.c2, "Eq. 20 with ζ = 0.05"),
    ]


def _table_3() -> list[Row]:
    """Table 3 from the responses that it gives, since the measured ones are not printed; the fit starts at Table 1."""
    data = fit_data(held_response(table_3(), np.arange(150.0, 300.5, 0.5)))
    fit = bounded_fit(data, table_2(), table_1())
    known: dict[str, str] = {e.name: e.status for e in determination(fit, data).parameters}
    # Parameters that the two open directions (of no singular value) leave where they are.
    open_directions = np.linalg.svd(fit.jacobian, full_matrices=False)[2][-2:]
    for name, part in zip(HEAD_PARAMETERS, np.abs(open_directions).max(axis=0), strict=True):
        if part < _NO_PART:
            known[name] = f"determined by the data, {known[name]}"
    printed, computed = _head_values(table_3()), _head_values(fit.head)
    rows = [
        _row(f"{name} [{unit}]", printed[name], computed[name], f"fitted to the responses of Table 3; {known[name]}")
        for name, unit in zip(HEAD_PARAMETERS, _UNITS, strict=True)
    ]
    natural, peaks = held_natural_frequencies(table_3()), held_peaks(table_3())
    own = "printed: measured peak in BR. A sim-to-real gap of the paper's own"
    rows += [
        _row(f"peak {k + 1} of XX [Hz]", PAPER_PEAKS[k], peaks[k], f"Table 3, damped, base held; {own}")
        for k in range(2)
    ]
    rows += [
        _row(f"resonance {k + 1} [Hz]", None, natural[k], "Table 3, undamped, base held: not what a peak shows")
        for k in range(2)
    ]
    determined = determination(fit, data).n_determined
    open_ones = (
        "of ten; open are a common scale of lengths and joints, and θ01 against θ02 at a fixed sum. m2 is determined"
    )
    rows.append(_row("directions that the data determine", None, determined, open_ones))
    return rows + _eq_21()


def _eq_21() -> list[Row]:
    """Eq. 21 as printed over Table 2's box, the measurement being Table 3's own responses."""
    found = least_of_eq_21()
    misses = (
        "as printed, a signed difference of squares: on Table 2's box it has a minimum, but at the wrong place, where both "
        "resonances leave the band"
    )
    return [
        _row(
            "Eq. 21 at Table 3 [(m/s^2/N)^2]",
            None,
            found.at_table_3,
            "as printed; measurement: Table 3's own responses",
        ),
        _row("Eq. 21, least value [(m/s^2/N)^2]", None, found.least, misses),
        *(
            _row(
                f"resonance {k + 1} at that least value [Hz]",
                None,
                f,
                "the squared differences are least at Table 3 itself",
            )
            for k, f in enumerate(held_natural_frequencies(found.head))
        ),
    ]


def _table_5() -> list[Row]:
    computed = natural_frequencies(recovered_rail())
    return [_row(f"mode {k + 1} [Hz]", f, computed[k], "Eq. 8") for k, f in enumerate(table_5())]


def _table_6() -> list[Row]:
    rows = []
    for position, printed in table_6().items():
        computed = modes(published_machine(), position).natural_freq
        rows += [_row(f"{_PLACES[position]}, mode {k + 1} [Hz]", f, computed[k]) for k, f in enumerate(printed)]
    return rows


def _rail() -> list[Row]:
    found = recover_rail_mass()
    worst = f"the worst of its frequencies is {100 * found.worst_error:.2f} % off"
    note = f"not printed; least squares over Table 6, ± {found.std:.2g} kg; {worst}"
    first = modes(published_machine(), 1 / 2).natural_freq[0]
    measured = "printed: the peak measured on the Y-rail (Fig. 9); Table 6 has 24.5 Hz at L/2"
    return [_row("mass of the rail [kg]", None, found.mass, note), _row("first mode, L/2 [Hz]", 23.0, first, measured)]


def _table_7() -> list[Row]:
    a, study = table_7(), parametric_study(published_machine())
    best, chosen = study.best, study.worst[study.tuning == a.frequency, np.argmin(np.abs(study.damping_ratio - 0.04))]
    missed = f"not the best of its own study: at {WORKING_FREQUENCY:g} Hz {best.frequency:g} Hz with {best.damping_ratio:g} is"
    misprint = (
        "Eq. 25; the printed value is a tenth, a misprint: it would tune the absorber to "
        f"{misprinted_absorber().frequency:.0f} Hz, and Eq. 26 gives the printed c_a only with the computed one"
    )
    left = f"largest accelerance XX at {WORKING_FREQUENCY:g} Hz over L/2 and L/3"
    return [
        _row("f_N [Hz]", a.frequency, best.frequency, missed),
        _row("ζ_a", a.damping_ratio, best.damping_ratio, missed),
        _row("m_a [kg]", a.mass, a.mass, "chosen"),
        _row("c_a [N s/m]", TABLE_7_PRINTED["damping"], a.damping, "Eq. 26 with the computed k_a"),
        _row("k_a [N/m]", TABLE_7_PRINTED["stiffness"], a.stiffness, misprint),
        _row("what Table 7 leaves [m/s^2/N]", None, float(chosen[0]), left),
        _row("what the study's best leaves [m/s^2/N]", None, float(study.worst.min()), left),
    ]


def _fig20() -> list[Row]:
    places = {name: PAPER_POSITIONS[name] for name in ("CC", "FC", "BR")}
    right = check_absorber(published_machine(), table_7(), list(places.values()))
    wrong = check_absorber(published_machine(), misprinted_absorber(), list(places.values()))
    at = f"accelerance XX at {right.working_frequency:g} Hz"
    rows = []
    for k, (name, y) in enumerate(places.items()):
        place = {"CC": "CC, L/3", "FC": "FC, L/2"}.get(name, f"lateral (R), y/L = {y:g} assumed")
        peaks = ", ".join(f"{f:.0f}" for f in right.peaks_after[k])
        rows += [
            _row(f"{at}, {place}, without [m/s^2/N]", None, right.before[k]),
            _row(f"{at}, {place}, with the absorber [m/s^2/N]", None, right.after[k], f"new peaks at {peaks} Hz"),
            _row(f"reduction, {place}", None, right.reduction[k], "k_a of Eq. 25"),
            _row(f"reduction, {place}, k_a as printed", None, wrong.reduction[k], "the misprint does next to nothing"),
        ]
    return rows
