"""Identification of the head from a campaign or a frequency response: first guess, bounded fit, what it determines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np

from cutvib_ss.errors import IdentificationError
from cutvib_ss.identification.bounded_fit import Bounds, HeadFit, HeadModel, bounded_fit, bounds_around
from cutvib_ss.identification.first_guess import first_guess, peaks_and_dip
from cutvib_ss.identification.fitted_data import FitWeights, Weighting, fit_data
from cutvib_ss.identification.uncertainty import Determination, determination
from cutvib_ss.measurement.estimation import estimate
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.model.machine import Machine
from cutvib_ss.parameters import HeadParameters, check_choice, table_3
from cutvib_ss.results import FloatArray, FrequencyResponse, MeasuredFrequencyResponse, read_only
from cutvib_ss.results.arrays import optional_array
from cutvib_ss.results.display import Drawn, Table, data_frame

Base: TypeAlias = Literal["held", "rail"]

_LEAKAGE = 3.0
"""Blows are damped by e to this power over a record's length, so that what is cut off at its end does not leak."""
_MISFIT = 3.0
"""Mean error over what noise and calibration explain, beyond which the model is not the data's."""


@dataclass(frozen=True, repr=False)
class IdentificationResult(Drawn):
    """
    The head's parameters identified from one record.

    Parameters
    ----------
    head : HeadParameters
        The fitted parameters.
    machine : Machine or None
        The machine with that head; None where none was given.
    base : {"held", "rail"}
        Whether the base was held, as in the paper, or rode on the machine's rail.
    first_guess : HeadParameters or None
        The guess from two peaks and the dip (Eqs. 14-20); None where the record does not show them.
    fit : HeadFit
        The bounded fit.
    determination : Determination
        What the data determine, with intervals; these allow for the machine's tolerance of calibration.
    measured : FrequencyResponse
        What was fitted: XX and ZX in the band.
    fitted : FrequencyResponse
        The fitted model's responses.
    error : array_like, shape (output,)
        Mean modulus of their difference, in the data's unit (Table 4's measure).
    noise : array_like, shape (output,)
        Mean modulus that the measurement's own noise leaves; NaN where it is not known.
    record : str
        Name of the record; empty where a frequency response was given.
    warnings : tuple of str
        What was noticed on the way.
    """

    head: HeadParameters
    machine: Machine | None
    base: Base
    first_guess: HeadParameters | None
    fit: HeadFit
    determination: Determination
    measured: FrequencyResponse
    fitted: FrequencyResponse
    error: FloatArray
    noise: FloatArray
    record: str = ""
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("error", "noise"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    @property
    def position(self) -> float:
        """Position y_b / L of the record; NaN where it is not known."""
        return float(self.measured.positions[0])

    def to_dataframe(self) -> Any:
        """
        The parameters as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each of the ten parameters: value, SI unit, status, standard deviation, lower and upper end of the
            interval; NaN where the data do not determine it.
        """
        found = self.determination.parameters
        ends = [e.interval or (np.nan, np.nan) for e in found]
        columns = {
            "value": [e.value for e in found],
            "unit": [e.unit for e in found],
            "status": [e.status for e in found],
            "std": optional_array([e.std for e in found]),
            "lower": [low for low, _ in ends],
            "upper": [high for _, high in ends],
        }
        return data_frame(columns, "parameter", [e.name for e in found])

    def _table(self) -> Table:
        rows = []
        for e in self.determination.parameters:
            low_high = "-" if e.interval is None else f"{e.interval[0]:.5g} to {e.interval[1]:.5g}"
            rows.append((e.name, f"{e.value:.5g}", e.unit, e.status, low_high))
        title = f"Identified head, base {self.base}" + (f", {self.record}" if self.record else "")
        return Table(title, ("parameter", "value", "unit", "status", "interval"), rows)


def identify(
    source: Campaign | FrequencyResponse,
    machine: Machine | None = None,
    *,
    base: Base | None = None,
    bounds: Bounds | None = None,
    start: HeadParameters | None = None,
    band: tuple[float, float] = (150.0, 300.0),
    weighting: Weighting | None = None,
    weights: FitWeights | None = None,
    level: float = 0.99,
) -> IdentificationResult:
    """
    First guess and bounded fit of the head's ten parameters, and what the data determine of them.

    Parameters
    ----------
    source : Campaign or FrequencyResponse
        Of a campaign the record nearest to the rail's end is taken, as the paper takes BR; of several there, the one
        with the least noise.
    machine : Machine, optional
        The machine around the head; by default the campaign's.
    base : {"held", "rail"}, optional
        Fit the head with its base held (Section 5), or on the machine's rail at the record's position; by default on
        the rail where there is a machine.
    bounds : tuple of HeadParameters, optional
        Lower and upper bounds; by default around the machine's head, see `bounds_around`.
    start : HeadParameters, optional
        Where the fit starts; by default both from the first guess and from the machine's head.
    band : tuple of float
        Lowest and highest frequency of the fit [Hz].
    weighting : {"paper", "variance"}, optional
        Weights of Eq. 21, or the inverse of each value's own variance; by default the latter where the variance is
        known and there is a machine. (The paper's weights all but leave out ZX, and XX alone follows every error of
        its channel.)
    weights : FitWeights, optional
        Weights of Eq. 21; the paper's by default.
    level : float
        Probability with which all intervals of one kind hold together.

    Returns
    -------
    IdentificationResult
        Parameters, responses, intervals.

    Raises
    ------
    IdentificationError
        If the campaign is of another structure, the rail is asked for without a machine, or the data carry no fit.
    """
    warnings: list[str] = []
    name = ""
    frf: FrequencyResponse
    if isinstance(source, Campaign):
        if machine is None:
            if source.machine.rail is None:
                raise IdentificationError("identify fits the cutting head; the campaign's model is another structure")
            machine = source.machine
        record, frf = _nearest_to_the_end(source, band)
        name = record.name
    else:
        frf = source
    if base is not None:
        check_choice("base", base, ("held", "rail"))
    where = base or ("held" if machine is None else "rail")
    if where == "rail" and machine is None:
        raise IdentificationError("a fit on the rail needs a machine; give one, or hold the base")
    if len(frf.positions) > 1 and not isinstance(source, Campaign):
        warnings.append(f"the responses hold {len(frf.positions)} positions; the first is fitted")
    calibration = 0.0 if machine is None else machine.tolerance.calibration
    known = isinstance(frf, MeasuredFrequencyResponse) and machine is not None and weights is None
    check_choice("weighting", weighting or "paper", ("paper", "variance"))
    data = fit_data(frf, band, weighting or ("variance" if known else "paper"), weights)
    believed = table_3() if machine is None else machine.head
    guess = _guess(data.frf, believed, band, warnings)
    limits = bounds or bounds_around(believed)
    starts = [start] if start is not None else [believed] if guess is None else [guess, believed]
    around = machine if where == "rail" else None
    fits = [bounded_fit(data, limits, s, around) for s in starts]
    best = min(fits, key=lambda fit: fit.objective)
    if best.on_bound:
        warnings.append(f"on a bound: {', '.join(f'{n} ({side})' for n, side in best.on_bound.items())}")
    values = HeadModel(data, around).evaluate(best.head)[0]
    noise = np.full(len(values), np.nan)
    if data.variance is not None:
        # The mean modulus of a complex Gaussian value is √π/2 of its standard deviation.
        noise = np.sqrt(np.pi) / 2 * np.sqrt(data.variance).mean(axis=1)
    error = np.abs(values - data.measured).mean(axis=1)
    expected = noise + calibration * np.abs(data.measured).mean(axis=1)
    if (error > _MISFIT * expected).any():
        warnings.append(
            f"the fitted head leaves {float(np.nanmax(error / expected)):.0f} times what noise and calibration would; "
            "something else is in these data, and its intervals do not hold: diagnose the campaign"
        )
    return IdentificationResult(
        head=best.head,
        machine=None if machine is None else replace(machine, head=best.head),
        base=where,
        first_guess=guess,
        fit=best,
        determination=determination(best, data, level, calibration),
        measured=data.frf,
        fitted=replace(data.frf, data=values[None, :, None, :]),
        error=error,
        noise=noise,
        record=name,
        warnings=tuple(warnings),
    )


def _nearest_to_the_end(campaign: Campaign, band: tuple[float, float]) -> tuple[Record, MeasuredFrequencyResponse]:
    placed = [(min(r.position, 1.0 - r.position), r) for r in campaign.records if r.position is not None]
    placed = [(gap, r) for gap, r in placed if "tool_x" in r.channels]
    if not placed:
        raise IdentificationError("no record has a position and the response tool_x; identify needs both")
    nearest = min(gap for gap, _ in placed)
    there = [(r, _response(r)) for gap, r in placed if gap <= nearest + 1e-9]
    return min(there, key=lambda pair: _relative_noise(pair[1], band))


def _response(record: Record) -> MeasuredFrequencyResponse:
    if record.frf is not None:
        # A window on the response alone: the force is short, so the quotient is the response at s = σ + jω.
        return replace(record.frf, decay_rate=record.exponential_decay)
    if record.kind == "impact":
        return estimate(record, decay_rate=_LEAKAGE / max(h.duration for h in record.histories))
    return estimate(record)


def _relative_noise(frf: MeasuredFrequencyResponse, band: tuple[float, float]) -> float:
    inside = (frf.freq >= band[0]) & (frf.freq <= band[1])
    part = frf.sel(output="tool_x")
    power = float(np.mean(np.abs(part.data[0, 0, 0, inside]) ** 2)) if inside.any() else 0.0
    spread = float(np.mean(part.variance[0, 0, 0, inside])) if inside.any() else np.inf
    return spread / power if power > 0 and np.isfinite(spread) else np.inf


def _guess(
    frf: FrequencyResponse, believed: HeadParameters, band: tuple[float, float], warnings: list[str]
) -> HeadParameters | None:
    try:
        peaks, dip = peaks_and_dip(frf, band=band)
        return first_guess(peaks, dip, length=(believed.l1 + believed.l2) / 2, tool_mass=believed.m2)
    except IdentificationError as error:
        warnings.append(f"no first guess: {error}")
        return None
