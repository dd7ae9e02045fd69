"""How results show themselves: as a short table in print and notebooks, as a picture, as xarray and pandas objects."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from html import escape
from importlib import import_module
from typing import Any, NamedTuple

from cutvib_ss.errors import CutvibError

_MOST_ROWS = 12
"""Rows of a printed table; of longer ones the first are shown and the others counted."""


class Table(NamedTuple):
    """A short table: a line that says what it is, names of columns, rows of text."""

    title: str
    columns: tuple[str, ...] = ()
    rows: Sequence[Sequence[str]] = ()


class Displayed:
    """Base of what prints as a short table, in a terminal and in a notebook."""

    def _table(self) -> Table:
        """What `print` and a notebook show."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return str(self)

    def __str__(self) -> str:
        table = self._table()
        shown, left = _shortened(table)
        widths = [max(len(row[k]) for row in [table.columns, *shown]) for k in range(len(table.columns))]
        lines = ["  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True)).rstrip() for row in shown]
        if table.columns:
            lines.insert(0, "  ".join(f"{c:<{w}}" for c, w in zip(table.columns, widths, strict=True)).rstrip())
        return "\n".join([table.title, *(f"  {line}" for line in lines), *left])

    def _repr_html_(self) -> str:
        table = self._table()
        shown, left = _shortened(table)
        head = "".join(f"<th>{escape(c)}</th>" for c in table.columns)
        body = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in shown)
        below = "".join(f"<div>{escape(line.strip())}</div>" for line in left)
        return f"<div><b>{escape(table.title)}</b></div><table><tr>{head}</tr>{body}</table>{below}"


class Drawn(Displayed):
    """Base of results that draw themselves too."""

    def plot(self, **options: Any) -> Any:
        """Draw the result with the function that `cutvib_ss.plot` has for its type; no window is opened."""
        # Drawing is above results in the order of imports: the package is asked for it when a picture is wanted.
        return sys.modules[__name__.partition(".")[0]].plot.draw(self, **options)


def _shortened(table: Table) -> tuple[list[Sequence[str]], list[str]]:
    rows = list(table.rows)
    return rows[:_MOST_ROWS], [f"  … {len(rows) - _MOST_ROWS} more"] if len(rows) > _MOST_ROWS else []


def span(values: Any, unit: str = "") -> str:
    """A range of numbers as text."""
    low, high = float(values[0]), float(values[-1])
    text = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
    return f"{text} {unit}".rstrip()


def optional(module: str, asked: str) -> Any:
    """A package of the extra `data`, or an error that says how to install it."""
    try:
        return import_module(module)
    except ImportError as error:
        raise CutvibError(
            f"{asked} needs the package {module}, which is not installed: pip install 'cutvib_ss[data]'"
        ) from error


def data_frame(columns: Mapping[str, Any], index: str, values: Any) -> Any:
    """Columns as a table of pandas (extra `data`), its rows named by the values of an index."""
    pandas = optional("pandas", "to_dataframe")
    return pandas.DataFrame(dict(columns), index=pandas.Index(values, name=index))


def finite(value: Any) -> Any:
    """Plain data as JSON has it: None in place of NaN and Infinity."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [finite(v) for v in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
