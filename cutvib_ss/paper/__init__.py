"""The paper: its tables beside what this package computes, and the responses behind its figures."""

from cutvib_ss.paper.figures import PaperCurves, paper_curves
from cutvib_ss.paper.tables import Row, paper_tables

__all__ = ["PaperCurves", "Row", "paper_curves", "paper_tables"]
