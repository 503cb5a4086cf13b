"""One look for every figure, and the same bytes each time one is drawn.

Colours are Okabe and Ito's, told apart by people with any colour vision; lines differ in
dash as well. No clock, version or random id goes into a file.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

BLUE, VERMILION, GREEN, PINK = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY, BLACK, GREY = "#E69F00", "#56B4E9", "#1b1f24", "#8a9099"
CYCLE = (BLUE, VERMILION, GREEN, PINK, ORANGE, SKY, BLACK, GREY)
DASHES = ("-", "--", "-.", ":", (0, (5, 1.5)), (0, (3, 1, 1, 1)), "-", "--")
HALF, THIRD = (5.0, 3.0), (3.7, 3.0)

_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 8,
    "axes.labelsize": 9,
    "axes.labelcolor": "#3c434b",
    "axes.edgecolor": "#b4bac2",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e8eb",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "xtick.color": "#5b626b",
    "ytick.color": "#5b626b",
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.handlelength": 2.4,
    "figure.facecolor": "white",
    "figure.dpi": 100,
    "savefig.dpi": 160,
    "svg.hashsalt": "replay",
    "svg.fonttype": "path",
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
}


@dataclass(frozen=True)
class Picture:
    """A finished figure.

    Parameters
    ----------
    name
        File name without ending.
    ending
        ``svg`` or ``png``.
    data
        Its bytes.
    alt
        What it shows, for a reader who cannot see it.
    caption
        One or two sentences under it.
    """

    name: str
    ending: str
    data: bytes
    alt: str
    caption: str


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in the report's own style, whatever the user's matplotlib settings are."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)  # type: ignore[arg-type]
        yield


def new_figure(size: tuple[float, float] = HALF, rows: int = 1, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure and its axes, row by row; no window system is touched."""
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False)
    return figure, list(axes.ravel())


def finish(figure: Figure, name: str, alt: str, caption: str, *, ending: str = "svg") -> Picture:
    """Render a figure to bytes that depend on nothing but its content."""
    out = io.BytesIO()
    if ending == "svg":
        metadata = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        FigureCanvasSVG(figure).print_figure(out, format="svg", metadata=metadata)
    else:
        FigureCanvasAgg(figure).print_figure(out, format="png", dpi=160, metadata={"Software": None})
    return Picture(name, ending, out.getvalue(), alt, caption)


def legend_below(axes: Axes, columns: int) -> None:
    """Put the legend under the axes, where it covers no line."""
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=columns, columnspacing=1.4)
