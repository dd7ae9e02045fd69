"""
The pages' programs, files and commands run as they stand, and print what the pages show.

In a page, a block ``python`` is run, in one namespace a page; of a block ``bash`` every line that starts with ``cutvib`` is
run, others by the shell; a block ``toml`` whose first line is ``# name.toml`` is written to that file; a block ``text`` right
after one of these is what it prints, with ``...`` for what is left out and figures within one unit of the last place. A block
after ``<!-- slow -->`` takes long, or needs one that does: it is run by ``make test-all`` only. One after ``<!-- not run -->``
never is.
"""

import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from cutvib_ss.cli import main
from cutvib_ss.effects.catalogue import EFFECTS

DOCS = Path(__file__).parents[2] / "docs"
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
FENCE = re.compile(r"(?:^<!-- (slow|not run) -->\n)?^```(\w+)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)


class Block(NamedTuple):
    """A block of a page, and the output that follows it."""

    line: int
    language: str
    text: str
    mark: str
    output: str


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    found: list[Block] = []
    end = -1
    for match in FENCE.finditer(text):
        mark, language, body = match.groups()
        if language == "text" and found and not text[end : match.start()].strip():
            found[-1] = found[-1]._replace(output=body)
        elif language in ("python", "bash", "toml") and mark != "not run":
            found.append(Block(text[: match.start()].count("\n") + 1, language, body, mark or "", ""))
        end = match.end()
    return found


PAGES = [
    DOCS.parent / "README.md",
    DOCS / "quick_start.md",
    DOCS / "when_not_to_believe_it.md",
    *sorted((DOCS / "tutorials").glob("*.md")),
    *(page for page in sorted((DOCS / "howto").glob("*.md")) if blocks(page)),
]


def matches(shown: str, printed: str, part: float = 0.0) -> bool:
    """Whether a page shows what was printed: blanks count as one, ``...`` stands for anything, figures are rounded.

    Beyond rounding, figures may differ by a part of themselves: those of a diagnosis move with the libraries.
    """
    pattern, numbers = "", []
    for piece in re.split(r"(\.\.\.|\s+)", shown.strip()):
        if piece == "...":
            pattern += r".*?"
        elif not piece.strip():
            pattern += r"\s+" if piece else ""
        else:
            last = 0
            for number in NUMBER.finditer(piece):
                pattern += re.escape(piece[last : number.start()]) + f"({NUMBER.pattern})"
                numbers.append(number.group())
                last = number.end()
            pattern += re.escape(piece[last:])
    pattern = pattern.replace(r"\s+.*?\s+", r"\s.*?")
    found = re.fullmatch(pattern, printed.strip(), flags=re.DOTALL)
    return found is not None and all(near(a, b, part) for a, b in zip(numbers, found.groups(), strict=True))


def near(shown: str, printed: str, part: float) -> bool:
    """Whether two figures differ by one unit of the last place at most, or by that part of themselves."""
    mantissa, _, exponent = shown.partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(shown) - float(printed)) <= max(1.001 * unit, part * abs(float(shown)))


def run(block: Block, page: Path, names: dict[str, object]) -> None:
    if block.language == "python":
        exec(compile("\n" * block.line + block.text, str(page), "exec"), names)
    elif block.language == "toml":
        name = re.match(r"# (\S+\.toml)", block.text)
        if name:
            Path(name.group(1)).write_text(block.text, encoding="utf-8")
    else:
        for line in re.sub(r"\\\n\s*", "", block.text).splitlines():
            words = shlex.split(line, comments=True)
            if words[:1] == ["cutvib"]:
                assert main(words[1:]) == 0, line
            elif words[:1] == ["cd"]:
                os.chdir(words[1])
            elif words:
                subprocess.run(line, shell=True, check=True)


@pytest.fixture(autouse=True)
def own_effects() -> Iterator[None]:
    """Effects that a page registers, and modules that it writes, are its own."""
    effects, modules, path = list(EFFECTS), set(sys.modules), list(sys.path)
    yield
    for name in [n for n in EFFECTS if n not in effects]:
        EFFECTS.remove(name)
    for name in set(sys.modules) - modules:
        if str(getattr(sys.modules[name], "__file__", None) or "").startswith(tempfile.gettempdir()):
            del sys.modules[name]
    sys.path[:] = path


def run_page(page: Path, slow: bool, capfd: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {"__name__": "page"}
    for block in blocks(page):
        if block.mark == "slow" and not slow:
            continue
        capfd.readouterr()
        run(block, page, names)
        printed = capfd.readouterr().out
        where = f"{page.name}, line {block.line}"
        assert not block.output or matches(block.output, printed, 0.2 if block.mark else 0.0), (
            f"{where}: the page shows other output than\n{printed}"
        )


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert blocks(page)
    run_page(page, False, capfd)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [p for p in PAGES if any(b.mark == "slow" for b in blocks(p))], ids=lambda page: page.stem
)
def test_whole_page_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run_page(page, True, capfd)


def test_output_is_compared() -> None:
    assert matches("mode 24.5 Hz\n...\n", "mode  24.52 Hz\nmore\n")
    assert not matches("mode 24.5 Hz", "mode 24.8 Hz")
    assert not matches("mode 24.5 Hz", "pole 24.5 Hz")
