"""Figures and page of the laboratory: tissue curves beside the data they come from, and a specimen between platens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from replay.files import atomic_path, write_text
from replay.report.figure import CYCLE, DASHES, HALF, Picture, finish, house_style, legend_below, new_figure
from replay.report.markup import figure, number, paragraph, table, text

_MARKERS = ("o", "s", "^", "D", "v", "P")


@dataclass(frozen=True)
class TissueCurve:
    """A computed curve and the points it is held against.

    Parameters
    ----------
    label
        Test and rate.
    strain, stress_kpa : (n,) float64
        Computed.
    points : (k, 3) float64
        Strain, stress [kPa] and its standard deviation [kPa] (NaN where unknown); k may be 0.
    status
        How the points came to be: said in the legend.
    """

    label: str
    strain: NDArray[np.float64]
    stress_kpa: NDArray[np.float64]
    points: NDArray[np.float64]
    status: str


def curves_picture(
    name: str, title: str, panels: Mapping[str, Sequence[TissueCurve]], caption: str, *, strain: str, stress: str
) -> Picture:
    """Draw panels of curves side by side, on one scale of stress.

    Parameters
    ----------
    name
        File name.
    title
        Over the figure.
    panels
        Title of each panel -> its curves.
    caption
        Under it.
    strain, stress
        Labels of the axes.
    """
    with house_style():
        fig, axes = new_figure((HALF[0] * max(len(panels), 1), 1.25 * HALF[1]), columns=len(panels))
        most = 0.0
        for panel, (heading, curves) in zip(axes, panels.items()):
            for k, curve in enumerate(curves):
                _draw(panel, curve, k)
                most = max([most, float(curve.stress_kpa.max()), *curve.points[:, 1].tolist()])
            panel.set(xlabel=strain, ylabel=stress, title=heading)
            legend_below(panel, 1)
        for panel in axes:
            panel.set_ylim(0, 1.05 * most)
        said = "; ".join(c.label for curves in panels.values() for c in curves)
        return finish(fig, name, f"{title}: {said}.", caption)


def _draw(panel: Axes, curve: TissueCurve, k: int) -> None:
    panel.plot(curve.strain, curve.stress_kpa, color=CYCLE[k], ls=DASHES[k], label=f"model, {curve.label}")
    if len(curve.points):
        x, y, deviation = curve.points.T
        panel.errorbar(
            x, y, yerr=np.where(np.isfinite(deviation), deviation, 0.0), fmt=_MARKERS[k % len(_MARKERS)],
            color=CYCLE[k], ms=4, capsize=2, lw=0.9, ls="none", label=f"data, {curve.label} ({curve.status})",
        )  # fmt: skip


def specimen_picture(
    squeezes: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64], Mapping[float, NDArray[np.float64]]]],
    caption: str,
) -> Picture:
    """Draw a specimen's shapes and its mean diameter over strain (the article's Figure 4).

    Parameters
    ----------
    squeezes
        Name of the ends -> strains, mean diameters over the first, and strain -> profile (k, 2) of relative height and
        radius.
    caption
        Under it.
    """
    with house_style():
        fig, (shape, diameter) = new_figure((2 * HALF[0], 1.25 * HALF[1]), columns=2)
        for k, (ends, (strains, diameters, profiles)) in enumerate(squeezes.items()):
            for at, profile in profiles.items():
                z, r = profile.T
                name = ends if at == min(profiles) else None
                shape.plot(r, z - z.mean(), color=CYCLE[k], ls=DASHES[k], label=name)
                if k == 0:
                    shape.annotate(
                        f"strain {at:g}", (r.max(), 0.0), (3, 0), textcoords="offset points", rotation=90, va="center",
                        fontsize=7,
                    )  # fmt: skip
            diameter.plot(strains, diameters, color=CYCLE[k], ls=DASHES[k], label=f"model, {ends}")
        e = np.linspace(0, max(float(s.max()) for s, _, _ in squeezes.values()), 50)
        diameter.plot(e, (1 - e) ** -0.5, color=CYCLE[6], lw=0.9, ls=":", label="incompressible, no barrel")
        shape.set(title="Free surface", xlabel="radius over first", ylabel="height over first, from the middle")
        diameter.set(title="Mean diameter", xlabel="nominal compressive strain", ylabel="diameter over first")
        legend_below(shape, 3)
        legend_below(diameter, 2)
        return finish(fig, "figure_4_hopkinson", "Shapes and mean diameter of a specimen between platens.", caption)


def write_pictures(folder: Path, pictures: Sequence[Picture]) -> None:
    """Write figures beside one another."""
    for picture in pictures:
        with atomic_path(folder / f"{picture.name}.{picture.ending}") as temporary:
            temporary.write_bytes(picture.data)


def write_page(
    path: Path, title: str, words: Sequence[str], pictures: Sequence[Picture],
    tables: Sequence[tuple[str, Sequence[str], Sequence[Sequence[object]]]],
) -> None:  # fmt: skip
    """Write a page of the laboratory: paragraphs, figures inside the page, tables.

    Parameters
    ----------
    path
        The HTML file.
    title, words
        Heading and paragraphs.
    pictures
        Figures, whose bytes go into the page.
    tables
        Caption, headings and rows of each; numbers are set as a person reads them.
    """
    css = Path(__file__).with_name("page.css").read_text(encoding="utf-8")
    body = "".join(paragraph(line) for line in words) + "".join(figure(picture, wide=True) for picture in pictures)
    for caption, head, rows in tables:
        cells = [[number(v, 4) if not isinstance(v, str) else text(v) for v in row] for row in rows]
        body += table(caption, head, cells, numeric=range(1, len(head)))
    write_text(
        path,
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; img-src data:; '
        "style-src 'unsafe-inline'\">"
        f"<title>{text(title)}</title><style>\n{css}</style></head><body><main><section><h1>{text(title)}</h1>{body}"
        "</section></main></body></html>\n",
    )
