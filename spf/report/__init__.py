"""A run as one HTML file that opens anywhere, offline: what was tracked, how well, with which settings, and how to repeat it."""

from spf.report.page import report_html, write_report

__all__ = ["report_html", "write_report"]
