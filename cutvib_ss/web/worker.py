"""
A diagnosis in a process of its own: progress and outcome as lines of JSON on standard output, results as files.

    python -m cutvib_ss.web.worker CAMPAIGN OUT SEED JOBS

A process can be ended at any time, which a thread cannot. It ends by itself once its standard input closes, so that none is left
behind a server that was killed.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import traceback
from pathlib import Path
from typing import Any

from cutvib_ss.errors import CutvibError

REPORT, RESULT, MACHINE = "report.html", "diagnosis.json", "corrected-machine.toml"


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
    tell(step="Reading the campaign")
    from cutvib_ss.diagnosis.diagnose import diagnose
    from cutvib_ss.measurement.campaign import read_campaign
    from cutvib_ss.model_files import write_machine
    from cutvib_ss.report import wording
    from cutvib_ss.report.page import write_report

    measured = read_campaign(campaign)
    tell(step="Diagnosing")
    found = diagnose(measured, seed=seed, jobs=jobs, progress=lambda said: tell(step=said[:1].upper() + said[1:]))
    tell(step="Writing the report")
    write_report(found, out / REPORT)
    (out / RESULT).write_text(found.to_json() + "\n", encoding="utf-8")
    write_machine(found.corrected_machine, out / MACHINE)
    tell(
        verdict=found.verdict,
        title=wording.VERDICTS[found.verdict],
        sentence=wording.verdict_sentence(found),
        warnings=list(found.warnings),
    )


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
