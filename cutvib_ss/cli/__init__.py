"""The command line: `cutvib`. Each command reads, calls one function of the package, and prints or draws its result."""

from cutvib_ss.cli.app import main

__all__ = ["main"]
