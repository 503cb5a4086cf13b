"""The damage variable on the page: how much, where, when, at what action, and how much of it is choice."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from replay.report.figure import CYCLE, DASHES, Picture, finish, house_style, legend_below, new_figure
from replay.report.head_view import sections_picture
from replay.report.markup import absent, figure, number, table, text
from replay.report.model import ReportInput

_LEVELS = ("0.001", "0.34")
#: What the article's Figure 8 shows, then the whole.
_SHOWN = ("right_occipital", "right_amygdala", "left_amygdala", "brain")
_CONSTANT = {
    "run": "the run itself",
    "none": "the run's constants, integrated at history times",
    "triaxiality_cap": "cap of the Cocks-Ashby argument",
    "pore_growth_exponent": "m_CA",
    "pore_shear_sensitivity": "K_pore",
}


def damage_section(report: ReportInput, pictures: list[Picture]) -> str:
    """Return damage in space (article, Figure 6), by region against time and action, and what assumed constants do."""
    if report.damage is None:
        return absent("The brain of this run keeps no damage variable, or the replay was not run.")
    drawn = [damage_chart(report.damage, "time_s"), damage_chart(report.damage, "head_J_s")]
    pictures.extend(drawn)
    maps = ""
    if report.mesh is not None and report.damage_snapshots is not None:
        pictures.append(sections_picture(report.mesh, report.damage_snapshots, "brain_damage_sections"))
        maps = figure(pictures[-1], wide=True)
    rows = []
    for region, given in report.damage.groupby("region", sort=False):
        last = given.iloc[-1]
        row = [_region(str(region)), number(1e6 * float(last["volume_m3"]), 3)]
        for level in _LEVELS:
            column = f"volume_phi_{level}_m3"
            begun = given.loc[given[column] > 0]
            row.append(number(1e6 * float(last[column]), 3))
            row.append(number(1e3 * float(begun["time_s"].iloc[0]) if len(begun) else None, 3))
            row.append(number(float(begun["head_J_s"].iloc[0]) if len(begun) else None, 3))
        rows.append([*row, number(float(last["phi_mean"]), 3), number(float(last["phi_max"]), 3)])
    head = ["Region", "Volume (cm³)"]
    for level in _LEVELS:
        head += [f"φ ≥ {level} at the end (cm³)", "first at (ms)", "at an action of (J·s)"]
    note = (
        "φ is the pore volume fraction of the brain's law (HV57): a diagnostic that the stress does not feel, and no"
        " measure of injury. Amygdala: a region of interest, not a segmentation."
    )
    content = maps + f'<div class="figures">{"".join(figure(picture) for picture in drawn)}</div>'
    content += table("Damaged volume by region", [*head, "φ, mean", "φ, max"], rows, numeric=range(1, 10), note=note)
    return content + _sensitivity(report.damage_sensitivity)


def _region(name: str) -> str:
    return "whole brain" if name == "brain" else text(name.replace("_", " "))


def _sensitivity(found: pd.DataFrame | None) -> str:
    if found is None:
        return ""
    rows: list[list[str]] = []
    for row in found.to_dict("records"):
        changed = row["constant"] not in ("run", "none")
        rows.append(
            [
                text(_CONSTANT.get(str(row["constant"]), row["constant"])),
                number(float(row["value"])) if changed else number(None),
                *(number(1e6 * float(row[f"volume_phi_{level}_m3"]), 3) for level in _LEVELS),
                number(float(row["phi_mean"]), 3),
                number(float(row["phi_max"]), 3),
            ]
        )
    head = ["Changed", "to", "φ ≥ 0.001 (cm³)", "φ ≥ 0.34 (cm³)", "φ, mean", "φ, max"]
    note = (
        "Whole brain at the end of the run. φ has no feedback, so every row but the first is integrated beside the run"
        " from stress, plastic strain and deformation at history times; the second row shows what that sampling costs."
    )
    return table("What the assumed constants of pore growth decide", head, rows, numeric=range(1, 6), note=note)


def damage_chart(damage: pd.DataFrame, against: str) -> Picture:
    """Damaged volume of the article's regions against time or mechanical action (its Figure 8)."""
    action = against == "head_J_s"
    with house_style():
        fig, (axes,) = new_figure()
        most = 0.0
        for k, region in enumerate(r for r in _SHOWN if (damage["region"] == r).any()):
            rows = damage[damage["region"] == region]
            x = rows[against].to_numpy(float) * (1.0 if action else 1e3)
            share: Any = 100 * rows["volume_phi_0.001_m3"] / rows["volume_m3"]
            axes.plot(x, share, color=CYCLE[k], ls=DASHES[k], label=_region(region))
            critical: Any = 100 * rows["volume_phi_0.34_m3"] / rows["volume_m3"]
            axes.plot(x, critical, color=CYCLE[k], ls=DASHES[k], lw=0.8)
            most = max(most, float(np.max(share)))
        axes.set(
            xlabel="mechanical action of the head (J·s)" if action else "time (ms)", ylabel="damaged volume (%)",
            title="Damage against action" if action else "Damage over time",
        )  # fmt: skip
        axes.set_ylim(0, max(1.05 * most, 1.0))
        if most == 0.0:
            axes.text(0.5, 0.5, "no element reaches φ = 0.001", transform=axes.transAxes, ha="center", va="center")
        legend_below(axes, 2)
        caption = "Share of each region's volume with φ ≥ 0.001, and thin with φ ≥ 0.34 (article, Figure 8)."
        name = "damage_against_action" if action else "damage_over_time"
        return finish(fig, name, f"Damaged volume: up to {most:.3g} % of a region with φ ≥ 0.001.", caption)
