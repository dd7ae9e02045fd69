"""LabVIEW measurement files (SignalExpress text), read only: a segment per blow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import lvm_read
import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.names import split_heading
from cutvib_ss.measurement.formats.raw import Contents, Layout, RawHistory, Signal, TextOptions, sampling_frequency


def read(path: Path, frf: bool, options: TextOptions) -> Contents:
    """Segments of a LabVIEW measurement file, one history each."""
    if frf:
        raise DataFormatError(f"{path}: LVM holds time records; give FRFs as UFF, CSV or MAT, or set kind = 'impact'")
    try:
        # from text: given a path, the library loads a pickle that lies beside the file, even where told not to (1.26)
        content = lvm_read.read_str(_text(path, options))
        segments = [content[k] for k in range(content["Segments"])]
    except Exception as error:  # the library raises whatever the damaged text leads it to
        raise DataFormatError(f"{path}: not a readable LVM file ({error}); export it again as text") from error
    return Contents(histories=tuple(_history(path, k, s, content) for k, s in enumerate(segments)))


def write(path: Path, contents: Contents, layout: Layout) -> None:
    """Refuse: this format is read only."""
    raise DataFormatError(f"{path}: LVM is read only; write tdms, uff, csv or mat")


def _text(path: Path, options: TextOptions) -> str:
    content = path.read_bytes()
    if options.encoding is not None:
        return content.decode(options.encoding, errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def _history(path: Path, number: int, segment: dict[str, Any], content: dict[str, Any]) -> RawHistory:
    where = f"{path}: segment {number + 1}"
    for key in ("Channels", "Channel names", "Delta_X", "data"):
        if key not in segment:
            raise DataFormatError(f"{where} has no {key!r}; export the file again as text")
    count = int(segment["Channels"])
    names = [str(name).strip() for name in segment["Channel names"]]
    table = np.asarray(segment["data"], dtype=float)
    # the columns: one X column for all (or none), or one before every channel
    names = names[: table.shape[1]] if table.ndim == 2 else names
    kept = [k for k, name in enumerate(names) if name not in ("X_Value", "Comment", "")]
    if table.ndim != 2 or len(kept) != count:
        raise DataFormatError(f"{where}: {count} channels are announced, columns are {names}; export the file again")
    kinds = {str(x).strip() for x in segment.get("X_Dimension", [])[:count]}
    if not kinds <= {"Time", ""}:
        raise DataFormatError(f"{where}: its abscissa is {sorted(kinds)}, not Time; export the time records")
    steps = [float(step) for step in segment["Delta_X"][:count]]
    if not all(step > 0 for step in steps) or max(steps) - min(steps) > 1e-9 * max(steps):
        raise DataFormatError(f"{where}: time steps Delta_X {steps} must be positive and equal; record on one clock")
    samples = [int(n) for n in segment.get("Samples", [])[:count] if np.isfinite(n)]
    if samples and (min(samples) != max(samples)):
        raise DataFormatError(f"{where}: channels have different lengths {samples}; record them alike")
    if samples and table.shape[0] < samples[0]:
        raise DataFormatError(f"{where}: truncated, {table.shape[0]} of {samples[0]} samples are there; copy it again")
    units = [str(u).strip() for u in segment.get("Y_Unit_Label", [])] or [""] * count
    signals = tuple(
        Signal(
            split_heading(names[k])[0],
            (units[i] if i < len(units) and units[i] else None) or split_heading(names[k])[1],
            np.ascontiguousarray(table[:, k]),
        )
        for i, k in enumerate(kept)
    )
    return RawHistory(f"segment {number + 1}", sampling_frequency(steps[0]), signals)
