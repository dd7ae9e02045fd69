"""The demonstration: the main job on a campaign that ships with the package."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cutvib_ss.cli.campaigns import diagnosis_of, give_diagnosis, print_diagnosis
from cutvib_ss.cli.output import check_outputs, results, say, show, working
from cutvib_ss.files import made_folder


def demo_command(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder to write to.")] = Path("cutvib-demo"),
) -> None:
    """The main job on data that ship with the package: pictures of the machine, and a diagnosis with its report."""
    import numpy as np

    import cutvib_ss
    from cutvib_ss.model.machine import published_machine
    from cutvib_ss.plot.response import bode
    from cutvib_ss.plot.schedule import pole_map, schedule
    from cutvib_ss.plot.style import save
    from cutvib_ss.response.frequency import frequency_response
    from cutvib_ss.response.modes import modes, track_modes

    made_folder(out)
    names = ("bode.png", "poles.png", "schedule.png", "diagnosis.json", "report.html", "corrected-machine.toml")
    targets = {name: out / name for name in names}
    check_outputs(*targets.values())

    console = results()
    machine = published_machine()
    with working("drawing the published machine"):
        lines, places = np.arange(10.0, 500.25, 0.5), np.arange(1, 100) / 100
        save(bode(frequency_response(machine, [0.02, 1 / 3, 1 / 2], lines)), targets["bode.png"])
        tracked = track_modes(machine, places)
        save(pole_map(tracked, 600.0), targets["poles.png"])
        over = frequency_response(machine, places, np.arange(5.0, 601.0), outputs=("tool_x",))
        save(schedule(tracked, over), targets["schedule.png"])
    at = {y: modes(machine, y) for y in (1 / 3, 1 / 2)}
    rows = [
        [f"{k + 1}", *(text for m in at.values() for text in (
            f"{m.natural_freq[k]:.1f}", f"{100 * m.damping_ratio[k]:.2f}"
        ))]
        for k in range(6)
    ]  # fmt: skip
    columns = ["mode", "L/3 [Hz]", "damping [%]", "L/2 [Hz]", "damping [%]"]
    show(console, "The published machine", columns, rows)
    say(console, "")
    found = diagnosis_of(Path(cutvib_ss.__file__).parent / "data" / "demo", None, None, 0, 1)
    give_diagnosis(found, str(targets["diagnosis.json"]), targets["report.html"], targets["corrected-machine.toml"])
    print_diagnosis(found, console)
    say(console, "")
    say(console, f"written to {out}: {', '.join(names)}")
