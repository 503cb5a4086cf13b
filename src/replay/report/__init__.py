"""Report: figures, tables, and one self-contained page for each play."""

from replay.report.ensemble import ensemble_page, ensemble_rows
from replay.report.model import MeshView, ReportInput, Snapshots
from replay.report.overview import overview_page
from replay.report.page import write_report
from replay.report.season import season_page

__all__ = [
    "MeshView",
    "ReportInput",
    "Snapshots",
    "ensemble_page",
    "ensemble_rows",
    "overview_page",
    "season_page",
    "write_report",
]
