"""The numbers of a data set 58, with what other vendors' files ask for: adjoining fields, blanks, D exponents, 58b."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.results import ComplexArray, FloatArray

_MARK = re.compile(rb"    -1(?=[ ]*(?:\r|\n|\Z))")
_HEADER_LINES = 13  # the opening mark, the set's number, and records 1 to 11


def split_blocks(path: Path) -> list[bytes]:
    """Data sets of a universal file, each from its opening mark to before its closing one."""
    content = path.read_bytes()
    marks = [match.start() for match in _MARK.finditer(content)]
    if not marks:
        raise DataFormatError(
            f"{path}: not a universal file (no `    -1` marks); export it as universal file data set 58"
        )
    if len(marks) % 2:
        raise DataFormatError(f"{path}: truncated universal file (its last data set is not closed); export it again")
    return [content[start:end] for start, end in zip(marks[::2], marks[1::2], strict=True)]


def data_values(block: bytes, header: dict[str, Any], where: str) -> tuple[FloatArray, ComplexArray]:
    """
    Abscissa and ordinate of a data set 58.

    Formats are those of the universal file definition: single precision 6E13.5; double precision 4E20.12 for even
    abscissae, 2(E13.5,E20.12) and E13.5,2E20.12 for uneven ones; binary IEEE in the byte order of record 1.
    """
    order = int(header["ord_data_type"])
    if order not in (2, 4, 5, 6):
        raise DataFormatError(f"{where}: ordinate data type {order} is not defined (2, 4, 5 or 6); export it again")
    points = int(header["num_pts"])
    even = int(header["abscissa_spacing"]) == 1
    width = (2 if order in (5, 6) else 1) + (0 if even else 1)
    body = b"".join(block.splitlines(keepends=True)[_HEADER_LINES:])
    if header.get("binary"):
        values = _binary(body, order, int(header.get("byte_ordering", 1)), points * width)
    else:
        values = _ascii(body, order, even, where)
    if values.size < points * width or points < 1:
        raise DataFormatError(
            f"{where}: truncated, {values.size // width} of {points} points are there; export the file again"
        )
    table = values[: points * width].reshape(points, width)
    abscissa: FloatArray
    if even:
        abscissa = float(header["abscissa_min"]) + float(header["abscissa_inc"]) * np.arange(points, dtype=np.float64)
    else:
        abscissa, table = np.array(table[:, 0], dtype=np.float64), table[:, 1:]
    ordinate = np.zeros(points, dtype=np.complex128)
    ordinate.real = table[:, 0]
    if table.shape[1] == 2:
        ordinate.imag = table[:, 1]
    return abscissa, ordinate


def _binary(body: bytes, order: int, byte_order: int, count: int) -> FloatArray:
    kind = np.dtype(("<" if byte_order == 1 else ">") + ("f4" if order in (2, 5) else "f8"))
    # some programs break a line after the data: only whole values count
    usable = min(len(body) // kind.itemsize, count)
    return np.frombuffer(body, dtype=kind, count=usable).astype(np.float64)


def _ascii(body: bytes, order: int, even: bool, where: str) -> FloatArray:
    lines = body.replace(b"D", b"E").replace(b"d", b"e").splitlines()
    if order in (2, 5):
        fields = [13] * 6
    elif even:
        fields = [20] * 4
    else:
        fields = [13, 20, 13, 20] if order == 4 else [13, 20, 20]
    length = sum(fields)
    lines = [line[:length].ljust(length) for line in lines if line.strip()]
    if not lines:
        return np.empty(0)
    table = np.frombuffer(b"".join(lines), dtype=np.dtype([(f"f{k}", f"S{w}") for k, w in enumerate(fields)]))
    cells = np.stack([np.char.strip(table[name].astype("S20")) for name in table.dtype.names or ()], axis=1).ravel()
    try:
        return np.asarray(cells[cells != b""], dtype=np.float64)
    except ValueError as error:
        odd = next(cell for cell in cells if not _is_number(cell)).decode("ascii", "replace")
        width = "/".join(str(w) for w in dict.fromkeys(fields))
        raise DataFormatError(
            f"{where}: not a number among its values: {odd!r}, where its ordinate data type says {width} characters; "
            "export the file again"
        ) from error


def _is_number(cell: bytes) -> bool:
    """Whether a field holds a number, or nothing."""
    try:
        float(cell or b"0")
    except ValueError:
        return False
    return True
