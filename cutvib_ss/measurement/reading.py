"""A measurement file read under the model's channel names: its format, then ``[channels]`` and ``[dofs]``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from cutvib_ss.measurement.formats import read_raw
from cutvib_ss.measurement.formats.raw import Contents, Layout, TextOptions
from cutvib_ss.measurement.mapping import assign
from cutvib_ss.measurement.schema import ChannelTable


def read_file(
    path: Path,
    frf: bool,
    layout: Layout,
    channels: Mapping[str, ChannelTable] | None = None,
    options: TextOptions | None = None,
) -> Contents:
    """Contents of a measurement file of any format, its columns named as the model's channels, in the file's units."""
    return assign(read_raw(path, frf, options), layout, channels or {}, str(path))
