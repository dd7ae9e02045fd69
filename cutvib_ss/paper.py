"""Every table of the paper beside what this package computes (`cutvib paper`)."""

from __future__ import annotations

from dataclasses import replace
from math import degrees
from typing import TypeAlias

import numpy as np

from cutvib_ss.absorber import WORKING_FREQUENCY, absorber_of, check_absorber, parametric_study, printed_absorber
from cutvib_ss.identification.bounded_fit import bounded_fit
from cutvib_ss.identification.first_guess import PAPER_DIP, PAPER_PEAKS, first_guess, resonances, stiffness_ratio
from cutvib_ss.identification.fitted_data import fit_data
from cutvib_ss.identification.held_head import held_natural_frequencies, held_response
from cutvib_ss.identification.rail_mass import recover_rail_mass
from cutvib_ss.identification.uncertainty import determination
from cutvib_ss.model.head import HEAD_PARAMETERS
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.rail import natural_frequencies
from cutvib_ss.parameters import (
    TABLE_7_PRINTED,
    HeadParameters,
    recovered_rail,
    table_1,
    table_2,
    table_3,
    table_5,
    table_6,
    table_7,
)
from cutvib_ss.response.modes import modes

# A line of a table: name with unit, printed (None where the paper has no number), computed, note.
Row: TypeAlias = dict[str, str | float | None]

_UNITS = ("kg", "kg", "m", "m", "deg", "deg", "N m/rad", "N m/rad", "N m s/rad", "N m s/rad")
_PLACES = {1 / 2: "FC or BC, L/2", 1 / 3: "CC, L/3"}


def paper_tables() -> dict[str, list[Row]]:
    """
    Tables 1, 3, 5, 6 and 7, the first guess, the rail's mass and Fig. 20's effect: printed and computed.

    Returns
    -------
    dict of str to list of dict
        By ``"1"``, ``"3"``, ``"5"``, ``"6"``, ``"7"``, ``"first_guess"``, ``"rail"`` and ``"fig20"``: rows with
        ``name``, ``printed``, ``computed`` and ``note``.

    Examples
    --------
    >>> [row["computed"] for row in paper_tables()["5"]]
    [31.7, 126.8, 285.3, 507.2]
    """
    return {
        "1": _table_1(),
        "3": _table_3(),
        "5": _table_5(),
        "6": _table_6(),
        "7": _table_7(),
        "first_guess": _first_guess(),
        "rail": _rail(),
        "fig20": _fig20(),
    }


def _row(name: str, printed: float | None, computed: float, note: str = "") -> Row:
    return {
        "name": name,
        "printed": None if printed is None else float(printed),
        "computed": float(computed),
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
    return [
        _row(f"{name} [{unit}]", printed[name], computed[name], notes[name])
        for name, unit in zip(HEAD_PARAMETERS, _UNITS, strict=True)
    ]


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
    known = {e.name: e.status for e in determination(fit, data).parameters}
    printed, computed = _head_values(table_3()), _head_values(fit.head)
    rows = [
        _row(f"{name} [{unit}]", printed[name], computed[name], f"fitted to the responses of Table 3; {known[name]}")
        for name, unit in zip(HEAD_PARAMETERS, _UNITS, strict=True)
    ]
    gap = "undamped, base held; printed: measured in BR. A sim-to-real gap of the paper's own"
    natural = held_natural_frequencies(table_3())
    return rows + [_row(f"resonance {k + 1} [Hz]", PAPER_PEAKS[k], natural[k], gap) for k in range(2)]


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
    return [_row("mass of the rail [kg]", None, found.mass, note)]


def _table_7() -> list[Row]:
    a = table_7()
    misprint = absorber_of(a.mass, TABLE_7_PRINTED["stiffness"], TABLE_7_PRINTED["damping"])
    best = parametric_study(published_machine()).best
    study = f"chosen; at {WORKING_FREQUENCY:g} Hz alone the study's grid is best at"
    return [
        _row("f_N [Hz]", 212.0, a.frequency, f"{study} {best.frequency:g} Hz"),
        _row("ζ_a", 0.04, a.damping_ratio, f"{study} {best.damping_ratio:g}"),
        _row("m_a [kg]", 0.08, a.mass, "chosen"),
        _row("c_a [N s/m]", TABLE_7_PRINTED["damping"], a.damping, "Eq. 26 with the computed k_a"),
        _row(
            "k_a [N/m]", TABLE_7_PRINTED["stiffness"], a.stiffness,
            f"Eq. 25; the printed value is a tenth, a misprint: it would tune the absorber to {misprint.frequency:.0f} "
            "Hz, and Eq. 26 gives the printed c_a only with the computed one",
        ),
    ]  # fmt: skip


def _fig20() -> list[Row]:
    right = check_absorber(published_machine(), table_7())
    wrong = check_absorber(published_machine(), printed_absorber())
    at = f"accelerance XX at {right.working_frequency:g} Hz"
    rows = []
    for k, position in enumerate(right.positions):
        place = "L/2" if position == 0.5 else "L/3"
        peaks = ", ".join(f"{f:.0f}" for f in right.peaks_after[k])
        rows += [
            _row(f"{at}, {place}, without [m/s^2/N]", None, right.before[k]),
            _row(f"{at}, {place}, with the absorber [m/s^2/N]", None, right.after[k], f"new peaks at {peaks} Hz"),
            _row(f"reduction, {place}", None, right.reduction[k], "k_a of Eq. 25: about two thirds"),
            _row(f"reduction, {place}, k_a as printed", None, wrong.reduction[k], "the misprint does next to nothing"),
        ]
    return rows
