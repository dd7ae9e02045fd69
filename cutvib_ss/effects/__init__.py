"""The catalogue of unmodelled effects, one file each: a frozen dataclass that fills a slot of a model."""
