"""TDMS (National Instruments): a group per blow, channels with ``unit_string`` and ``wf_increment``."""

from __future__ import annotations

import logging
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import nptdms
import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.names import TIME_NAMES, split_heading
from cutvib_ss.measurement.formats.raw import (
    Contents,
    Layout,
    RawHistory,
    Signal,
    TextOptions,
    even_sampling,
    sampling_frequency,
)

_LEAD_IN = 28  # bytes: tag, table of contents, version, next segment, raw data
_BIG_ENDIAN = 1 << 6  # in the table of contents
_OPEN = 2**64 - 1  # next segment of a file that its recorder did not close


def read(path: Path, frf: bool, options: TextOptions) -> Contents:
    """Groups of a TDMS file, one history each, scaled as the file says; a group without data is passed over."""
    if frf:
        raise DataFormatError(f"{path}: TDMS holds time records; give FRFs as UFF, CSV or MAT, or set kind = 'impact'")
    _check_complete(path)
    warnings: list[str] = []
    try:
        with _quiet():
            file = nptdms.TdmsFile.read(path)
            groups = file.groups()
            histories = tuple(_history(path, group, warnings) for group in groups if group.channels())
    except DataFormatError:
        raise
    except Exception as error:  # npTDMS raises whatever the damaged bytes lead it to
        raise DataFormatError(f"{path}: not a readable TDMS file ({error}); copy it again from the recorder") from error
    return Contents(histories=histories, warnings=tuple(warnings))


def write(path: Path, contents: Contents, layout: Layout) -> None:
    """Write histories as the groups of a new TDMS file."""
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


def _history(path: Path, group: nptdms.TdmsGroup, warnings: list[str]) -> RawHistory:
    where = f"{path}: group {group.name!r}"
    channels = group.channels()
    clock = next((c for c in channels if c.name.casefold() in TIME_NAMES and "wf_increment" not in c.properties), None)
    common = None if clock is None else 1 / even_sampling(np.asarray(clock[:], dtype=np.float64), where)
    signals, steps, faults = [], {}, []
    for channel in channels:
        if channel is clock:
            continue
        step = channel.properties.get("wf_increment", common)
        values = np.asarray(channel[:])
        if not isinstance(step, (int, float)) or not step > 0:
            faults.append(
                f"{where}, channel {channel.name!r}: `wf_increment` (time step) is {step!r}; set it in seconds, or record "
                "a channel `time`"
            )
        elif values.dtype.kind not in "fiu":
            faults.append(f"{where}, channel {channel.name!r} holds {values.dtype}, not numbers")
        else:
            unit = channel.properties.get("unit_string") or channel.properties.get("NI_UnitDescription")
            steps[channel.name] = float(step)
            name, stated = split_heading(channel.name)
            signals.append(Signal(name, str(unit) if unit else stated, values.astype(np.float64)))
    if faults and len(signals) < 2:
        raise DataFormatError(faults[0])
    warnings += [f"{fault}: left out" for fault in faults]
    first = next(iter(steps.values()))
    fs = sampling_frequency(first)
    signals = [
        s if abs(step / first - 1) <= 1e-9 else replace(s, fs=sampling_frequency(step))
        for s, step in zip(signals, steps.values(), strict=True)
    ]
    return RawHistory(group.name, fs, tuple(signals))


@contextmanager
def _quiet() -> Iterator[None]:
    """Without npTDMS's own lines on standard error, which hold whole stretches of a damaged file."""
    names = [name for name in logging.Logger.manager.loggerDict if name.startswith("nptdms")]
    loggers = [logging.getLogger(name) for name in names]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


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
