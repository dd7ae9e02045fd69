"""
A diagnosis in a process of its own: progress and outcome as lines of JSON on standard output, results as files.

    python -m cutvib_ss.web.worker CAMPAIGN OUT SEED JOBS

A process can be ended at any time, which a thread cannot. It ends by itself once its standard input closes, so that none is left
behind a server that was killed.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
import traceback
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from cutvib_ss.errors import CutvibError

REPORT, RESULT, MACHINE = "report.html", "diagnosis.json", "corrected-machine.toml"
_PERIOD = 0.4
_DIAGNOSIS = "cutvib_ss.diagnosis."
_DEPTH = 2


def tell(**line: Any) -> None:
    """One line to whoever started the process."""
    sys.stdout.write(json.dumps(line, ensure_ascii=False) + "\n")
    sys.stdout.flush()


def main(arguments: list[str]) -> int:
    """Diagnose; 0 done, 2 the input cannot be used, 1 a fault of the program."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    campaign, out, seed, jobs = Path(arguments[0]), Path(arguments[1]), int(arguments[2]), int(arguments[3])
    try:
        _diagnose(campaign, out, seed, jobs)
    except CutvibError as error:
        tell(error=" ".join(str(error).split()))
        return 2
    except Exception as error:
        traceback.print_exc()
        tell(fault=f"{type(error).__name__}: {' '.join(str(error).split())}")
        return 1
    return 0


def _diagnose(campaign: Path, out: Path, seed: int, jobs: int) -> None:
    tell(stage="Reading the campaign")
    from cutvib_ss.diagnosis.diagnose import diagnose
    from cutvib_ss.measurement.campaign import read_campaign
    from cutvib_ss.model_files import write_machine
    from cutvib_ss.report import wording
    from cutvib_ss.report.page import write_report

    measured = read_campaign(campaign)
    tell(stage="Diagnosing")
    logging.getLogger("cutvib_ss").addHandler(_Messages())
    logging.getLogger("cutvib_ss").setLevel(logging.INFO)
    done = threading.Event()
    watch = threading.Thread(target=_watch, args=(threading.get_ident(), done), daemon=True)
    watch.start()
    try:
        found = diagnose(measured, seed=seed, jobs=jobs)
    finally:
        done.set()
        watch.join()
    tell(stage="Writing the report")
    write_report(found, out / REPORT)
    (out / RESULT).write_text(found.to_json() + "\n", encoding="utf-8")
    write_machine(found.corrected_machine, out / MACHINE)
    tell(
        verdict=found.verdict,
        title=wording.VERDICTS[found.verdict],
        sentence=wording.verdict_sentence(found),
        warnings=list(found.warnings),
    )


class _Messages(logging.Handler):
    """What the package logs, as progress."""

    def emit(self, record: logging.LogRecord) -> None:
        """One record, one line."""
        tell(step=record.getMessage())


def _watch(thread: int, done: threading.Event) -> None:
    """Tell the step that the diagnosis is at: the docstring of the function that it is in, whenever that changes."""
    last = ""
    while not done.wait(_PERIOD):
        step = step_of(sys._current_frames().get(thread))
        if step and step != last:
            last = step
            tell(step=step)


def step_of(frame: FrameType | None) -> str:
    """What the outermost functions of the diagnosis that a thread is in say of themselves."""
    texts = [text for code in _codes(frame) if (text := _summary(code))]
    return ": ".join(texts[:_DEPTH])


def _codes(frame: FrameType | None) -> list[CodeType]:
    """The functions of the diagnosis on the stack, outermost first, below the diagnosis itself."""

    def upwards() -> Iterator[FrameType]:
        here = frame
        while here is not None:
            yield here
            here = here.f_back

    found = [f.f_code for f in upwards() if str(f.f_globals.get("__name__", "")).startswith(_DIAGNOSIS)]
    return [code for code in reversed(found) if not code.co_name.startswith("<")][1:]


def _summary(code: CodeType) -> str:
    """First sentence of a function's docstring."""
    doc = code.co_consts[0] if code.co_consts else None
    if not isinstance(doc, str) or not doc.strip():
        return ""
    line = doc.strip().splitlines()[0].replace("`", "")
    return line.split(". ")[0].split("; ")[0].rstrip(".")


def _end_with_parent() -> None:
    """End the process and those that it started once standard input closes."""
    # The descriptor, not the stream: whose lock a thread that still waits would hold while the interpreter ends.
    while os.read(0, 1024):
        pass
    if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
        os.killpg(os.getpgrp(), 9)
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
