"""The report of a diagnosis: one page, self-contained, that reads from the answer to its reasons."""

from cutvib_ss.report.page import report_html, write_report
from cutvib_ss.report.wording import cause_name, place_name, verdict_sentence

__all__ = ["cause_name", "place_name", "report_html", "verdict_sentence", "write_report"]
