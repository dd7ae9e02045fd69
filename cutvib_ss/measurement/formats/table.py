"""A table of numbers in a text file of any program: encoding, separator, decimal sign and headings recognised."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.names import looks_like_unit
from cutvib_ss.measurement.formats.raw import TextOptions
from cutvib_ss.results import FloatArray

_DELIMITERS = (";", "\t", ",", "|", None)  # None: blanks
_MISSING = {"", "nan", "-nan", "+nan", "n/a", "na", "#n/a", "#nv", "null", "none", "-", "--", "1.#qnan", "-1.#ind"}
_NUMBER = re.compile(r"^[+-]?(\d+(\.\d*)?|\.\d+)([eEdD][+-]?\d+)?$|^[+-]?(inf|infinity)$", re.IGNORECASE)
_PROBED = 12  # rows from which separator and decimal sign are told


@dataclass(frozen=True)
class TextTable:
    """Headings, units of a line of their own, lines above them, and numbers (NaN where a cell is empty)."""

    headings: tuple[str, ...]
    units: tuple[str | None, ...]
    preamble: tuple[str, ...]
    values: FloatArray


def read_table(path: Path, options: TextOptions) -> TextTable:
    """The table of a text file; refused where rows are cut short or hold what is no number."""
    lines = _decoded(path, options.encoding).splitlines()
    try:
        start, delimiter, decimal = _first_row(path, lines, options)
    except DataFormatError:
        lines = _without_text(lines, options)
        if not lines:
            raise
        start, delimiter, decimal = _first_row(path, lines, options)
    given = options.header_lines
    if (
        given
        and given == start
        and len(cells_of(lines[given - 1], delimiter)) == len(cells_of(lines[start], delimiter))
    ):
        options = replace(options, header_lines=given - 1)  # the line of headings was counted, too
    headings, units, preamble = _headings(lines[:start], delimiter, options)
    rows = [line for line in lines[start:] if line.strip()]
    named = len(headings) - (1 if headings and not headings[-1].strip() else 0)
    values = _numbers(path, rows, delimiter, decimal, start, named)
    width = values.shape[1]
    if headings and len(headings) == width + 1 and not headings[-1].strip():
        headings, units = headings[:-1], units[:-1]
    if len(headings) < width and np.all(np.isnan(values[:, len(headings) :])) and headings:
        values = values[:, : len(headings)]  # separators at the ends of the rows
        width = values.shape[1]
    if headings and len(headings) > width and all(not h.strip() for h in headings[width:]):
        headings, units = headings[:width], units[:width]
    if headings and len(headings) != width:
        raise DataFormatError(
            f"{path}: rows have {width} columns, the first line names {len(headings)}; export it again"
        )
    if not headings:
        headings, units = tuple(str(k + 1) for k in range(width)), (None,) * width
    return TextTable(headings, units, preamble, values)


def _decoded(path: Path, encoding: str | None) -> str:
    content = path.read_bytes()
    if encoding is None:
        encoding = _encoding(path, content)
    try:
        return content.decode(encoding).lstrip("\ufeff")
    except UnicodeError as error:
        raise DataFormatError(
            f"{path}: not a CSV text file in {encoding} ({error}); state its encoding under [csv]"
        ) from error


def _encoding(path: Path, content: bytes) -> str:
    for mark, name in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if content.startswith(mark):
            return name
    head = content[:4000]
    if b"\0" in head:
        if len(head) > 3 and not head[0::2].count(0) and head[1::2].count(0) > 0.9 * len(head[1::2]):
            return "utf-16-le"
        if len(head) > 3 and not head[1::2].count(0) and head[0::2].count(0) > 0.9 * len(head[0::2]):
            return "utf-16-be"
        raise DataFormatError(f"{path}: not a CSV text file (it holds zero bytes); export the record as text")
    try:
        content.decode("utf-8")
        return "utf-8"
    except UnicodeDecodeError:
        pass
    # Windows programs write their own code page; what it does not define, latin-1 does
    return "latin-1" if any(byte in content for byte in b"\x81\x8d\x8f\x90\x9d") else "cp1252"


def cells_of(line: str, delimiter: str | None) -> list[str]:
    """Cells of a line; quotes are taken off."""
    if delimiter is None:
        return line.split()
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader(io.StringIO(line), delimiter=delimiter), [])]
    return [cell.strip() for cell in line.split(delimiter)]


def _candidates(options: TextOptions) -> Iterator[tuple[str | None, str]]:
    stated: Sequence[str | None] = _DELIMITERS if options.delimiter is None else (options.delimiter,)
    for delimiter in stated:
        for decimal in (".", ",") if options.decimal is None else (options.decimal,):
            if delimiter != decimal:
                yield delimiter, decimal


def _is_row(line: str, delimiter: str | None, decimal: str) -> int:
    """Number of cells of a line of numbers; 0 where it is none."""
    cells = cells_of(line, delimiter)
    numbers = 0
    for cell in cells:
        text = cell.replace(decimal, ".") if decimal == "," and "." not in cell else cell
        if _NUMBER.match(text):
            numbers += 1
        elif cell.lower() not in _MISSING:
            return 0
    return len(cells) if numbers else 0


def _without_text(lines: Sequence[str], options: TextOptions) -> list[str]:
    """Lines whose columns of text (a date, a remark) are blanked in the rows of numbers; none where that is no table."""
    filled = [line for line in lines if line.strip()]
    middle = filled[len(filled) // 2 :][:_PROBED]
    for delimiter, decimal in _candidates(options):
        rows = [cells_of(line, delimiter) for line in middle]
        if delimiter is None or len({len(row) for row in rows}) != 1:
            continue
        numeric = [{k for k, cell in enumerate(row) if _is_row(cell, None, decimal)} for row in rows]
        numbers = set.intersection(*numeric)
        if len(numbers) < 2 or any(found != numbers for found in numeric):
            continue
        blanked = []
        for line in lines:
            cells = cells_of(line, delimiter)
            is_row = len(cells) == len(rows[0]) and all(_is_row(cells[k], None, decimal) for k in numbers)
            kept = [cell if k in numbers else "nan" for k, cell in enumerate(cells)]
            blanked.append(delimiter.join(kept) if is_row else line)
        return blanked
    return []


def _first_row(path: Path, lines: Sequence[str], options: TextOptions) -> tuple[int, str | None, str]:
    """Line of the first row of numbers, separator and decimal sign: those under which most lines are rows of one width."""
    filled = [k for k, line in enumerate(lines) if line.strip()]
    if not filled:
        raise DataFormatError(f"{path}: not a CSV text file (it holds blank lines alone); export the record again")
    middle = filled[len(filled) // 2 :][:_PROBED] + filled[-2:]
    best: tuple[int, int, int] | None = None
    choice: tuple[str | None, str] = (",", ".")
    for order, (delimiter, decimal) in enumerate(_candidates(options)):
        widths = [_is_row(lines[k], delimiter, decimal) for k in middle]
        common = max(set(widths), key=widths.count)
        if common == 0 or (common == 1 and len(filled) > 1 and delimiter != options.delimiter):
            continue
        score = (widths.count(common), -order, common)
        if best is None or score > best:
            best, choice = score, (delimiter, decimal)
    delimiter, decimal = choice
    if options.header_lines is not None:
        wanted = [k for k in filled if k >= options.header_lines]
        if not wanted:
            raise DataFormatError(
                f"{path}: there are no rows under line {options.header_lines + 1}; correct csv.header_lines"
            )
        first = next((k for k in wanted if _is_row(lines[k], delimiter, decimal)), wanted[0])
        return first, delimiter, decimal
    if best is None:
        # the separator of the line with the most cells still tells what the headings are
        delimiter = max((d for d in _DELIMITERS if d), key=lambda d: lines[filled[0]].count(d))
        if len(filled) == 1:
            raise DataFormatError(f"{path}: there are no rows under its first line; export the record again")
        bad = next((k for k in filled[1:] if not _is_row(lines[k], delimiter, decimal)), filled[1])
        raise DataFormatError(
            f"{path}: truncated or not numeric (line {bad + 1}: {lines[bad][:60]!r}); export the file again, or state "
            "delimiter, decimal and header_lines under [csv]"
        )
    width = best[2]
    start = next(
        (
            k
            for k in filled
            if _is_row(lines[k], delimiter, decimal) == width and _goes_on(lines, k, delimiter, decimal)
        ),
        None,
    )
    if start is None:
        raise DataFormatError(f"{path}: there are no rows under its first line; export the record again")
    return start, delimiter, decimal


def _goes_on(lines: Sequence[str], start: int, delimiter: str | None, decimal: str) -> bool:
    """Whether the next line holds numbers, too (or there is none): a number among the headings is not yet the table."""
    following = next((line for line in lines[start + 1 :] if line.strip()), None)
    return following is None or _is_row(following, delimiter, decimal) > 0 or start == 0 or _wordy(lines[start - 1])


def _wordy(line: str) -> bool:
    return sum(character.isalpha() for character in line) >= 3


def _headings(
    above: Sequence[str], delimiter: str | None, options: TextOptions
) -> tuple[tuple[str, ...], tuple[str | None, ...], tuple[str, ...]]:
    """The line of headings, a line of units under it where there is one, and what stands above."""
    filled = [line for line in above if line.strip()]
    if options.header_lines is not None:
        filled = [line for line in above[options.header_lines :] if line.strip()]
        preamble = list(above[: options.header_lines])
    else:
        preamble = []
    if not filled:
        return (), (), tuple(preamble)
    if options.header_lines is not None:
        headings, below = cells_of(filled[0], delimiter), filled[1:]
    else:
        headings, below = cells_of(filled[-1], delimiter), []
        preamble = filled[:-1]
        if len(filled) > 1 and _are_units(headings):
            upper = cells_of(filled[-2], delimiter)
            if len(upper) == len(headings):
                headings, below, preamble = upper, [filled[-1]], filled[:-2]
    units: list[str | None] = [None] * len(headings)
    for line in below[:1]:
        cells = cells_of(line, delimiter)
        if _are_units(cells):
            units = [(cell.strip("[]()") or None) for cell in cells[: len(headings)]]
            units += [None] * (len(headings) - len(units))
    return tuple(headings), tuple(units), tuple(preamble)


def _are_units(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell.strip()]
    return bool(filled) and all(looks_like_unit(cell) for cell in filled)


def _numbers(
    path: Path, rows: Sequence[str], delimiter: str | None, decimal: str, start: int, named: int
) -> FloatArray:
    """Rows as numbers; a separator at the end of every row belongs to no column, where the headings name one less."""
    if not rows:
        raise DataFormatError(f"{path}: there are no rows under its first line; export the record again")
    text = [row.replace(",", ".") for row in rows] if decimal == "," else list(rows)
    ended = delimiter is not None and all(row.rstrip(" ").endswith(delimiter) for row in text[:3])
    if delimiter is not None and ended and len(cells_of(text[0], delimiter)) != named:
        text = [row.rstrip(" ")[:-1] if row.rstrip(" ").endswith(delimiter) else row for row in text]
    try:
        values = np.loadtxt(text, delimiter=delimiter, ndmin=2, comments=None, quotechar='"')
        return np.asarray(values, dtype=np.float64)
    except ValueError as error:
        first = error
    width = len(cells_of(text[0], delimiter))
    table = np.full((len(text), width), np.nan)
    for k, row in enumerate(text):
        cells = cells_of(row, delimiter)
        if len(cells) != width:
            raise DataFormatError(
                f"{path}: truncated, row {k + 1} (line {start + k + 1} or below) has {len(cells)} of {width} columns; "
                "export the file again"
            ) from first
        for j, cell in enumerate(cells):
            if cell.lower() in _MISSING:
                continue
            try:
                table[k, j] = float(cell.replace("D", "E").replace("d", "e"))
            except ValueError:
                raise DataFormatError(
                    f"{path}: not numeric, row {k + 1} holds {cell!r} in column {j + 1}; export the file again"
                ) from first
    return table
