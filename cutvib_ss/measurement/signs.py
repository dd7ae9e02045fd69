"""Hammers and sensors the wrong way round: the driving point tells, and the nominal model tells which."""

from __future__ import annotations

import numpy as np

from cutvib_ss.measurement.estimation import measured_response
from cutvib_ss.measurement.inputs import port_of, response_to
from cutvib_ss.measurement.records import MachineLike, Record
from cutvib_ss.model.protocol import Model
from cutvib_ss.results import FloatArray, MeasuredFrequencyResponse

_TURNED = -0.5  # of a sign or correlation between -1 and 1; models far off their machine still stay above zero


def turned_signs(
    record: Record, machine: MachineLike, where: str, frf: MeasuredFrequencyResponse | None = None
) -> list[str]:
    """
    A word on every channel of a record whose sign is turned.

    That something is turned is certain from the driving point alone (`sign_at_driving_point`). Whether it is the force
    (a hammer that acts along -X turns every channel) or one sensor is read from the correlation with the nominal model.
    """
    if frf is None:
        frf = measured_response(record)
    against = _against_nominal(frf, record, machine)
    turned = []
    for k, name in enumerate(record.channels):
        at_force = machine.input_quantity == "force" and machine.channels[name].port == port_of(record.input, machine)
        sign = sign_at_driving_point(frf, name) if at_force else against[k]
        # under feedback or friction, or from a sweep cut into blocks, the driving point may lie; the model's sign stays right
        if sign < _TURNED and not (at_force and against[k] > 0.0):
            turned.append((name, at_force))
    driven = [name for name, at_force in turned if at_force]
    if driven and np.all(~(against > -_TURNED)):
        struck = record.kind == "impact" or record.excitation == "impact"
        acts = "the hammer acts" if struck else "a channel is late (in closed loop), or the force acts"
        return [
            f"{where}: force and motion have opposite signs at the driving point {driven[0]} (Im of accelerance is "
            f"negative at its peaks), and no channel contradicts: {acts} along the negative axis, or its "
            "sensor is turned; turn the sign of `force` (`sign` under [channels]; in UFF: reference direction -1)"
        ]
    return [
        f"{where}: {name} has the sign opposite to "
        + ("the force at the driving point" if at_force else "the nominal model's throughout")
        + f": its sensor is the wrong way round; turn the sign of {name} (`sign` under [channels]; in UFF: response direction -1)"
        for name, at_force in turned
    ]


def sign_at_driving_point(frf: MeasuredFrequencyResponse, output: str) -> float:
    """
    Sign of a driving point's response: +1 where force and motion are counted in one direction.

    A passive structure takes up power at every frequency, so that Im(accelerance) is positive at every peak of a
    driving point. Lines within ten times the noise are left out. A late channel turns the phase of the mass line first,
    which is real; this is why the peaks decide.
    """
    part = frf.sel(output=output).to_form("accelerance")
    h, variance = part.data[0, 0, 0], part.variance[0, 0, 0]
    clear = np.isfinite(h) & (part.freq > 0)
    clear[clear] = np.abs(h[clear]) ** 2 > 100 * variance[clear]
    if not np.any(clear):
        return 0.0
    across = h.imag[clear] / np.max(np.abs(h.imag[clear]))
    return float(np.sum(np.sign(across) * across**4) / np.sum(across**4))


def _against_nominal(frf: MeasuredFrequencyResponse, record: Record, machine: MachineLike) -> FloatArray:
    """Correlation of each channel with the nominal model over the lines that are clear of noise; NaN where unknown."""
    against = np.full(len(record.channels), np.nan)
    if not isinstance(machine, Model):
        return against
    # a free body has no response at 0 Hz; it is left out below
    above = np.where(frf.freq > 0, frf.freq, np.max(frf.freq))
    nominal = response_to(record.input, machine, record.position, above, record.channels).data[0, :, 0]
    for k, (h, model) in enumerate(zip(frf.data[0, :, 0], nominal, strict=True)):
        clear = (np.abs(h) ** 2 > 100 * frf.variance[0, k, 0]) & np.isfinite(model) & (frf.freq > 0)
        if np.count_nonzero(clear) >= 8:
            size = float(np.linalg.norm(h[clear]) * np.linalg.norm(model[clear]))
            against[k] = np.vdot(model[clear], h[clear]).real / size if size > 0 else np.nan
    return against
