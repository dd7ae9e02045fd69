"""The family of plants over positions: linear parameter-varying, exact and as a table, in common states."""

from cutvib_ss.plant.family import PlantSchedule, schedule
from cutvib_ss.plant.table import PlantMatrices, PlantTable

__all__ = ["PlantMatrices", "PlantSchedule", "PlantTable", "schedule"]
