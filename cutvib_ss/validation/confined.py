"""
The diagnosing process: `python -m cutvib_ss.validation.confined OUT FORBIDDEN [FORBIDDEN…] -- COMMAND…`.

Runs a `cutvib` command as a user would, in a process that is refused every file below the forbidden folders, and leaves in the
file OUT what the trial wants to know of it: which code ran, and how long on one core.
"""

from __future__ import annotations

import importlib
import os
import sys
import time
from pathlib import Path

from cutvib_ss.validation.files import code_hash, write_json

_WATCHED = frozenset({"open", "os.listdir", "os.scandir", "os.chdir", "os.link", "os.symlink", "os.rename"})


def forbid(folders: list[str]) -> None:
    """
    Refuse this process every file below some folders, from now on and for good.

    An audit hook: it cannot be taken away again, and it sees what Python opens, imports and lists. Compiled code that opens
    files by itself is not seen. It is a tripwire for the package's own code, not a jail for hostile code.
    """
    forbidden = [os.path.realpath(folder) for folder in folders]

    def watch(event: str, arguments: tuple[object, ...]) -> None:
        if event not in _WATCHED:
            return
        for argument in arguments:
            if isinstance(argument, str | bytes | os.PathLike):
                path = os.path.realpath(os.fsdecode(argument))
                if any(path == folder or path.startswith(folder + os.sep) for folder in forbidden):
                    raise PermissionError(f"{path}: belongs to a sealed trial; a diagnosis may not look at it")

    sys.addaudithook(watch)


def main(arguments: list[str]) -> int:
    """Run a command confined."""
    cut = arguments.index("--")
    usage, forbidden, command = Path(arguments[0]), arguments[1:cut], arguments[cut + 1 :]
    code = code_hash()
    forbid(forbidden)
    # The command line lies above this room: it is called by name, as any outsider calls it.
    status = int(importlib.import_module("cutvib_ss.cli").main(command))
    write_json(usage, {"cpu_seconds": time.process_time(), "code_sha256": code})
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
