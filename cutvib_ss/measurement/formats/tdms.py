"""TDMS (National Instruments): a group per blow, channels with ``unit_string`` and ``wf_increment``."""

from __future__ import annotations

import struct
from pathlib import Path

import nptdms
import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.raw import Contents, Layout, RawHistory, Signal, sampling_frequency

_LEAD_IN = 28  # bytes: tag, table of contents, version, next segment, raw data
_BIG_ENDIAN = 1 << 6  # in the table of contents
_OPEN = 2**64 - 1  # next segment of a file that its recorder did not close


def read(path: Path, frf: bool, layout: Layout) -> Contents:
    """
    Groups of a TDMS file, one history each.

    Parameters
    ----------
    path : Path
        File.
    frf : bool
        Must be False: TDMS files hold time records.
    layout : Layout
        Not used; channels bear their names.

    Returns
    -------
    Contents
        One history per group, scaled as the file says.

    Raises
    ------
    DataFormatError
        If the file is truncated, damaged, or lacks time steps.
    """
    if frf:
        raise DataFormatError(f"{path}: TDMS holds time records; give FRFs as UFF, CSV or MAT, or set kind = 'impact'")
    _check_complete(path)
    try:
        file = nptdms.TdmsFile.read(path)
        groups = file.groups()
        histories = tuple(_history(path, group) for group in groups)
    except DataFormatError:
        raise
    except Exception as error:  # npTDMS raises whatever the damaged bytes lead it to
        raise DataFormatError(f"{path}: not a readable TDMS file ({error}); copy it again from the recorder") from error
    return Contents(histories=histories)


def write(path: Path, contents: Contents, layout: Layout) -> None:
    """
    Write histories as the groups of a new TDMS file.

    Parameters
    ----------
    path : Path
        File to write.
    contents : Contents
        Histories, in the units that their signals name.
    layout : Layout
        Not used.

    Raises
    ------
    DataFormatError
        If the contents are frequency responses, which have no form in TDMS here.
    """
    if contents.frf is not None:
        raise DataFormatError(f"{path.name}: TDMS holds time records only; write FRFs as uff, csv or mat")
    objects: list[object] = [nptdms.RootObject(properties={})]
    for history in contents.histories:
        objects.append(nptdms.GroupObject(history.name))
        for signal in history.signals:
            properties = {
                "unit_string": signal.unit or "",
                "wf_increment": 1 / history.fs,
                "wf_start_offset": 0.0,
                "wf_samples": signal.values.size,
            }
            values = np.ascontiguousarray(signal.values)
            objects.append(nptdms.ChannelObject(history.name, signal.name, values, properties=properties))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(objects)


def _history(path: Path, group: nptdms.TdmsGroup) -> RawHistory:
    where = f"{path}: group {group.name!r}"
    channels = group.channels()
    steps = {}
    for channel in channels:
        step = channel.properties.get("wf_increment")
        if not isinstance(step, (int, float)) or not step > 0:
            raise DataFormatError(
                f"{where}, channel {channel.name!r}: `wf_increment` (time step) is {step!r}; set it in seconds"
            )
        steps[channel.name] = float(step)
    if not steps:
        raise DataFormatError(f"{where} holds no channels; each group is one blow with `force` and responses")
    first = next(iter(steps.values()))
    if any(abs(step / first - 1) > 1e-9 for step in steps.values()):
        raise DataFormatError(f"{where}: channels have different time steps {steps}; record them on one clock")
    signals = []
    for channel in channels:
        values = np.asarray(channel[:])
        if values.dtype.kind not in "fiu":
            raise DataFormatError(f"{where}, channel {channel.name!r} holds {values.dtype}, not numbers")
        unit = channel.properties.get("unit_string")
        signals.append(Signal(channel.name, str(unit) if unit else None, values.astype(np.float64)))
    return RawHistory(group.name, sampling_frequency(first), tuple(signals))


def _check_complete(path: Path) -> None:
    """Walk from segment to segment: npTDMS reads a file that was cut short without a word."""
    size = path.stat().st_size
    position = 0
    with path.open("rb") as file:
        while position < size:
            file.seek(position)
            head = file.read(_LEAD_IN)
            if head[:4] != b"TDSm":
                what = "not a TDMS file" if position == 0 else "truncated or damaged TDMS file"
                raise DataFormatError(f"{path}: {what} (no segment at byte {position}); copy it again")
            if len(head) < _LEAD_IN:
                raise DataFormatError(f"{path}: truncated TDMS file; copy it again from the recorder")
            (contents,) = struct.unpack_from("<I", head, 4)
            (following,) = struct.unpack_from(">Q" if contents & _BIG_ENDIAN else "<Q", head, 12)
            if following == _OPEN:
                raise DataFormatError(f"{path}: the recorder stopped before it closed this TDMS file; record again")
            position += _LEAD_IN + following
    if position != size:
        raise DataFormatError(f"{path}: truncated TDMS file ({size} bytes of {position}); copy it again")
