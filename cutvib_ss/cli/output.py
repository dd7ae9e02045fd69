"""Where results go: tables on standard output, messages on standard error, files that are complete or absent."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from cutvib_ss.errors import ParameterError
from cutvib_ss.files import check_target, staged

_WIDTH = 110
"""Columns of tables that are read by no terminal."""


def results() -> Console:
    """Standard output for tables."""
    return Console(highlight=False, width=None if sys.stdout.isatty() else _WIDTH)


def messages() -> Console:
    """Standard error for messages and progress."""
    return Console(stderr=True, highlight=False)


@contextmanager
def working(what: str) -> Iterator[None]:
    """A sign of life on standard error, where someone is looking."""
    console = messages()
    if not console.is_terminal:
        yield
        return
    with console.status(what):
        yield


def show(console: Console, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], text: str = "") -> None:
    """
    Print a table under its title: columns of text are named in ``text`` by an ``l`` each, numbers by ``r``.

    A column that holds nothing is left out.
    """
    rows = list(rows)
    kept = [k for k in range(len(columns)) if not rows or any(row[k] for row in rows)]
    columns, text = [columns[k] for k in kept], "".join(text[k : k + 1] or "r" for k in kept)
    rows = [[row[k] for k in kept] for row in rows]
    made = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=any(columns))
    for k, name in enumerate(columns):
        left = text[k : k + 1] == "l"
        made.add_column(Text(name), justify="left" if left else "right", header_style="dim", overflow="fold")
    for row in rows:
        # As Text: a unit in brackets is not markup.
        made.add_row(*(Text(cell) for cell in row))
    if title:
        say(console, Text(title, style="bold"))
    console.print(made)


def say(console: Console, line: str | Text) -> None:
    """Print a line as it stands: brackets are no markup, and whoever reads it wraps it."""
    console.print(line, markup=False, soft_wrap=not console.is_terminal)


def check_outputs(*targets: str | Path | None) -> None:
    """Refuse targets that cannot be written or are named twice, before the work begins."""
    named = [Path(t) for t in targets if t is not None and str(t) != "-"]
    for target in named:
        check_target(target)
        if named.count(target) > 1:
            raise ParameterError(f"{target}: is named for two outputs; give each a file of its own")


def write_all(writers: dict[str | Path, Callable[[Path], object]]) -> None:
    """Write several files; either all of them come to be, or none."""
    with ExitStack() as stack:
        for target, writer in writers.items():
            writer(stack.enter_context(staged(target)))


def text_writer(text: str) -> Callable[[Path], object]:
    """What writes a text to a file."""
    return lambda draft: draft.write_text(text, encoding="utf-8")


def json_text(data: Any) -> str:
    """JSON without NaN or Infinity, arrays as lists."""
    return json.dumps(_plain(data), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def give_json(data: Any, target: str | None) -> bool:
    """Write JSON where it was asked for; True where standard output is taken by it."""
    if target is None:
        return False
    if target == "-":
        sys.stdout.write(json_text(data))
        return True
    write_all({target: text_writer(json_text(data))})
    return False


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, complex):
        return [_plain(value.real), _plain(value.imag)]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
