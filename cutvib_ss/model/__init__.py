"""The machine's parts: the equivalent robot of the head, the modal rail, and elements that attach at a port."""
