"""What two players show beyond a driven head: how they met, the force between them, and how far pads went."""

from __future__ import annotations

import numpy as np
import pandas as pd

from replay.report.charts import TIME_LABEL
from replay.report.figure import BLACK, CYCLE, DASHES, Picture, finish, house_style, legend_below, new_figure
from replay.report.markup import figure, number, table, text
from replay.report.model import ReportInput

_MOST_PADS = 12
_MEAN_MS = 1.0


def collision_figures(report: ReportInput, pictures: list[Picture]) -> str:
    """Return the picture of the scene (article, Figure 5) and the chart of the blow."""
    drawn = []
    if report.scene is not None:
        alt = "The struck helmeted head and what strikes it at first contact, from outside and cut in half."
        caption = "First contact: one millimetre is left between the two (article, Figure 5)."
        drawn.append(Picture("first_contact", "png", report.scene, alt, caption))
    if report.blow is not None:
        drawn.append(blow_chart(report.blow))
    pictures.extend(drawn)
    return "".join(figure(picture, wide=True) for picture in drawn)


def blow_chart(blow: pd.DataFrame) -> Picture:
    """Force of the impactor on the struck player: components and resultant, means over a millisecond.

    Two rigid shells hand over an impulse in one step: the force of an interval is as great as the interval is short.
    It is told in words; drawn, it would flatten the blow that follows.
    """
    force = blow[[f"force_{axis}_N" for axis in "xyz"]].to_numpy(dtype=float)
    t = 1e3 * blow["time_s"].to_numpy(dtype=float)
    span = max(1, round(_MEAN_MS / max(float(t[-1] - t[0]) / max(len(t) - 1, 1), 1e-9)))
    mean = np.stack([np.convolve(f, np.full(span, 1.0 / span), mode="same") for f in force.T], axis=1)
    size = np.sqrt((mean**2).sum(axis=1))
    with house_style():
        drawing, (axes,) = new_figure((9.0, 3.0))
        for k, axis in enumerate("xyz"):
            axes.plot(t, 1e-3 * mean[:, k], color=CYCLE[k], ls=DASHES[k], lw=1.1, label=axis)
        axes.plot(t, 1e-3 * size, color=BLACK, lw=1.8, label="resultant")
        axes.set(xlabel=TIME_LABEL, ylabel="force (kN)", title="Force of the impactor on the struck player")
        legend_below(axes, 4)
        at = int(blow["force_N"].to_numpy().argmax())
        alt = f"The contact force, mean over 1 ms, peaks at {1e-3 * size.max():.4g} kN at {t[size.argmax()]:.3g} ms."
        caption = (
            "Sum over all pairs of parts of the two players, moving mean over 1 ms. In a single history interval the"
            f" greatest force is {1e-3 * blow['force_N'].iloc[at]:.3g} kN, at {t[at]:.3g} ms: rigid shells hand over an"
            " impulse in one step, and what has a meaning there is the impulse."
        )
        return finish(drawing, "blow_force", alt, caption)


def pads_table(report: ReportInput) -> str:
    """Return how far the most compressed pads went."""
    if not report.pads:
        return ""
    rows = [
        [
            text(str(pad["part"]).replace("_", " ")),
            number(100.0 * pad["compression_mean"], 3),
            number(1e3 * pad["time_s"], 3),
            number(100.0 * pad["compression_max"], 3),
        ]
        for pad in report.pads[:_MOST_PADS]
    ]
    return table(
        "Compression of the pads",
        ["Pad", "Whole pad (%)", "at (ms)", "Worst element (%)"],
        rows,
        numeric=(1, 2, 3),
        note="1 − V / V₀: the foam crushes without widening. Parts that end in 2 are the impactor's.",
    )
