"""The sim-to-real gap: where it lies, which cause it has, how far it closes."""
