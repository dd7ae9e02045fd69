"""A package outside cutvib_ss that offers effects of its own."""
