"""The rig's process: `python -m cutvib_ss.blind.draw REQUEST` makes one case in the current folder."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from cutvib_ss.blind.files import write_json
from cutvib_ss.blind.workers import CAMPAIGN, LABEL


def main(request: dict[str, Any], folder: Path) -> None:
    """
    Make a case.

    Parameters
    ----------
    request : dict
        Fields of `plan.Request`.
    folder : Path
        Where the campaign and its label go.
    """
    from cutvib_ss.blind.rig import draw_case, write_campaign

    case = draw_case(request["seed"], request["kind"], cause=request["cause"], severity=tuple(request["severity"]))
    (folder / CAMPAIGN).mkdir()
    write_campaign(case, folder / CAMPAIGN)
    write_json(folder / LABEL, case.label)


if __name__ == "__main__":
    main(json.loads(sys.argv[1]), Path.cwd())
