"""Report: figures, tables, and one self-contained page for each play."""

from replay.report.model import MeshView, ReportInput, Snapshots
from replay.report.overview import overview_page
from replay.report.page import write_report

__all__ = ["MeshView", "ReportInput", "Snapshots", "overview_page", "write_report"]
