"""Report: figures, tables, and one self-contained page for each play."""

from replay.report.model import MeshView, ReportInput, Snapshots
from replay.report.page import write_report

__all__ = ["MeshView", "ReportInput", "Snapshots", "write_report"]
