"""machine.toml, both kinds, with absorbers and effects, read and written."""

from cutvib_ss.model_files.reading import read_machine
from cutvib_ss.model_files.writing import write_machine

__all__ = ["read_machine", "write_machine"]
