"""The models: head, rail, their elements, and what couples them."""
