"""The report's line and bar charts; times in ms, units on every axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import NDArray

from replay.report.figure import (
    BLACK,
    BLUE,
    CYCLE,
    DASHES,
    GREEN,
    GREY,
    HALF,
    ORANGE,
    SKY,
    THIRD,
    VERMILION,
    Picture,
    finish,
    house_style,
    legend_below,
    new_figure,
)
from replay.report.markup import fixed

TIME_LABEL = "time (ms)"
_MOST_REGIONS = 8
_LEAST_SHARE = 0.001  # of the whole peak internal energy; a part below is not judged by the gate
QUANTITIES = (
    ("linear_acceleration", "a{}_m_per_s2", "Linear acceleration", "m/s²"),
    ("angular_acceleration", "alpha_{}_rad_per_s2", "Angular acceleration", "rad/s²"),
    ("angular_velocity", "omega_{}_rad_per_s", "Angular velocity", "rad/s"),
)
_HEAD_QUANTITIES = (
    ("a_head_{}_m_per_s2", "Linear acceleration, skull CG", "m/s²"),
    ("omega_head_{}_rad_per_s", "Angular velocity", "rad/s"),
    ("alpha_head_{}_rad_per_s2", "Angular acceleration", "rad/s²"),
)
_LEDGER = (
    ("kinetic_J", "kinetic", BLUE, "-"),
    ("internal_J", "internal", VERMILION, "-"),
    ("external_work_J", "external work", GREEN, "--"),
    ("hourglass_J", "hourglass", ORANGE, "-."),
    ("bulk_viscosity_J", "bulk viscosity", SKY, ":"),
    ("total_J", "total", BLACK, (0, (5, 1.5))),
)


def _milliseconds(table: pd.DataFrame) -> NDArray[np.float64]:
    return 1e3 * table["time_s"].to_numpy(dtype=float)


def _vectors(table: pd.DataFrame, pattern: str) -> NDArray[np.float64]:
    return np.stack([table[pattern.format(axis)].to_numpy(dtype=float) for axis in "xyz"], axis=1)


def driver_charts(driver: pd.DataFrame, applied: pd.DataFrame, fidelity: Mapping[str, Any] | None) -> list[Picture]:
    """Target against applied resultants at the skull's centre of gravity, one chart a quantity."""
    pictures = []
    for key, pattern, title, unit in QUANTITIES:
        with house_style():
            figure, (axes,) = new_figure(THIRD)
            target, made = (np.linalg.norm(_vectors(table, pattern), axis=1) for table in (driver, applied))
            t_target, t_made = _milliseconds(driver), _milliseconds(applied)
            axes.plot(t_target, target, color=SKY, lw=4.0, alpha=0.75, label="target", solid_capstyle="round")
            axes.plot(t_made, made, color=BLACK, lw=1.2, label="applied")
            for t, values, colour, marker in ((t_target, target, BLUE, "o"), (t_made, made, BLACK, "x")):
                at = int(np.argmax(values))
                axes.plot(t[at], values[at], marker, color=colour, ms=6, mew=1.6, mfc="none")
            axes.set(xlabel=TIME_LABEL, ylabel=f"resultant ({unit})", title=title)
            axes.set_ylim(bottom=0)
            legend_below(axes, 2)
            caption = "What the driver asks for, and what the model's skull did; the marks are the peaks."
            if fidelity and fidelity.get(key):
                row = fidelity[key]
                caption += (
                    f" Peaks differ by {fixed(row['delta_peak_percent'])} %, their times by"
                    f" {fixed(row['delta_time_to_peak_ms'])} ms."
                )
            alt = (
                f"{title}: target peak {target.max():.4g} {unit} at {t_target[int(np.argmax(target))]:.3g} ms, "
                f"applied peak {made.max():.4g} {unit} at {t_made[int(np.argmax(made))]:.3g} ms."
            )
            pictures.append(finish(figure, f"driver_{key}", alt, caption))
    return pictures


def kinematics_charts(
    kinematics: pd.DataFrame, t0_s: float | None, window_s: tuple[float, float] | None
) -> list[Picture]:
    """Reconstructed head motion in head axes, with the window and t0."""
    pictures = []
    names = ("x anterior", "y left", "z superior")
    for pattern, title, unit in _HEAD_QUANTITIES:
        with house_style():
            figure, (axes,) = new_figure(THIRD)
            t, vectors = _milliseconds(kinematics), _vectors(kinematics, pattern)
            if window_s is not None:
                axes.axvspan(1e3 * window_s[0], 1e3 * window_s[1], color="#eef3f8", zorder=0, label="window")
            if t0_s is not None:
                axes.axvline(1e3 * t0_s, color=GREY, lw=1.0, ls=":", label="t₀")
            sparse = {"marker": "o", "ms": 2.4} if len(t) < 80 else {}
            for column, name, colour, dash in zip(vectors.T, names, CYCLE, DASHES):
                axes.plot(t, column, color=colour, ls=dash, lw=1.2, label=name, **sparse)  # type: ignore[arg-type]
            resultant = np.linalg.norm(vectors, axis=1)
            axes.plot(t, resultant, color=BLACK, lw=1.9, label="resultant")
            axes.set(xlabel=TIME_LABEL, ylabel=unit, title=title)
            legend_below(axes, 2)
            at = int(np.nanargmax(resultant)) if np.isfinite(resultant).any() else 0
            alt = f"{title} in head axes; the resultant peaks at {resultant[at]:.4g} {unit} at {t[at]:.4g} ms."
            pictures.append(finish(figure, f"kinematics_{pattern.split('_head')[0]}", alt, f"{title}, in head axes."))
    return pictures


def both_modes_chart(kinematics: pd.DataFrame, t0_s: float | None) -> Picture:
    """Angular velocity as both modes reconstruct it: the samples of the one, the other with its 95 % band."""
    with house_style():
        figure, (axes,) = new_figure(HALF)
        t = _milliseconds(kinematics)
        protocol, posterior, low, high = (
            kinematics[name].to_numpy(dtype=float)
            for name in ("omega_rad_per_s", *(f"posterior_omega_rad_per_s{end}" for end in ("", "_lo", "_hi")))
        )
        axes.fill_between(t, low, high, color=SKY, alpha=0.35, lw=0, label="posterior, 95 % band")
        axes.plot(t, posterior, color=BLUE, lw=1.8, label="posterior")
        axes.plot(t, protocol, color=VERMILION, lw=1.1, ls="--", marker="o", ms=2.6, label="protocol")
        if t0_s is not None:
            axes.axvline(1e3 * t0_s, color=GREY, lw=1.0, ls=":", label="t₀")
        axes.set(xlabel=TIME_LABEL, ylabel="resultant (rad/s)", title="Angular velocity, both modes")
        # a band that footage cannot hold would flatten both curves
        highest = float(np.nanmax([protocol, posterior]))
        axes.set_ylim(0, min(1.6 * highest, 1.08 * max(float(np.nanmax(high)), highest)))
        legend_below(axes, 4)
        widest = float(np.nanmax(high - low))
        alt = (
            f"Angular velocity: protocol mode up to {np.nanmax(protocol):.3g} rad/s, posterior mode at the frames "
            f"up to {np.nanmax(posterior):.3g} rad/s; its band is at most {widest:.3g} rad/s wide."
        )
        caption = (
            "The same clicks, read frame by frame with the article's filters, and as one estimate over the clip."
            " The band says how well the footage holds the curve; what happens between frames is in the peaks' bands."
        )
        return finish(figure, "angular_velocity_both_modes", alt, caption)


def energy_charts(energy: pd.DataFrame) -> list[Picture]:
    """Draw the energy ledger and its ratio."""
    t = _milliseconds(energy)
    with house_style():
        figure, (axes,) = new_figure()
        for column, name, colour, dash in _LEDGER:
            axes.plot(t, energy[column], color=colour, ls=dash, label=name)
        axes.set(xlabel=TIME_LABEL, ylabel="energy (J)", title="Energy ledger")
        legend_below(axes, 3)
        last = energy.iloc[-1]
        alt = "Energies over time; at the end " + ", ".join(f"{name} {last[c]:.3g} J" for c, name, *_ in _LEDGER) + "."
        ledger = finish(figure, "energy_ledger", alt, "Every term of the energy balance, and their sum.")
    with house_style():
        figure, (axes,) = new_figure()
        ratio = energy["ratio"].to_numpy(dtype=float)
        axes.axhspan(0.99, 1.01, color="#e3f2ec", zorder=0, label="passes")
        for edge in (0.95, 1.05):
            axes.axhline(edge, color=VERMILION, lw=1.0, ls="--", label="fails beyond" if edge < 1 else None)
        axes.plot(t, ratio, color=BLACK, label="energy ratio")
        axes.set(xlabel=TIME_LABEL, ylabel="ratio (1)", title="Energy ratio")
        finite = ratio[np.isfinite(ratio)]
        reach = max(0.06, 1.1 * float(np.abs(finite - 1).max(initial=0.0)))
        axes.set_ylim(1 - min(reach, 1.0), 1 + min(reach, 1.0))
        legend_below(axes, 3)
        alt = (
            f"Energy ratio over time, between {finite.min():.5f} and {finite.max():.5f}."
            if finite.size
            else "No ratio."
        )
        caption = "Total energy over initial energy and external work. One means that every joule is accounted for."
        return [ledger, finish(figure, "energy_ratio", alt, caption)]


def time_step_chart(timestep: pd.DataFrame, floor_s: float | None, mass_scaling_s: float | None) -> Picture:
    """Draw the stable time step over the run with its floor."""
    with house_style():
        figure, (axes,) = new_figure()
        t, step = _milliseconds(timestep), 1e6 * timestep["time_step_s"].to_numpy(dtype=float)
        axes.plot(t, step, color=BLUE, label="time step")
        if mass_scaling_s:
            axes.axhline(1e6 * mass_scaling_s, color=GREY, lw=1.1, ls="-.", label="mass-scaling target")
        if floor_s:
            axes.axhline(1e6 * floor_s, color=VERMILION, lw=1.1, ls="--", label="floor")
        axes.set(xlabel=TIME_LABEL, ylabel="time step (µs)", title="Stable time step")
        axes.set_ylim(bottom=0)
        legend_below(axes, 3)
        alt = f"Time step over the run: between {step.min():.3g} and {step.max():.3g} microseconds."
        return finish(figure, "time_step", alt, f"The step the solver took; never below {step.min():.3g} µs.")


def hourglass_chart(part_energy: pd.DataFrame) -> Picture:
    """Peak hourglass energy over peak internal energy by part; a fluid part's over that of the whole model."""
    peaks = part_energy.groupby("part", sort=False)[["internal_J", "hourglass_J"]].max()
    whole = peaks["internal_J"].sum()
    fluid = pd.Series(False, index=peaks.index)
    if "fluid" in part_energy:
        fluid = part_energy.groupby("part", sort=False)["fluid"].max().astype(bool)
    own = peaks["internal_J"].where(~fluid, whole)
    judged = (peaks["internal_J"] + peaks["hourglass_J"]) > _LEAST_SHARE * whole
    share = (100 * peaks["hourglass_J"] / own.where(own > 0))[judged].fillna(100.0).clip(upper=100.0)
    names = [str(n).replace("_", " ") + (" (of all)" if fluid[n] else "") for n in share.index]
    with house_style():
        figure, (axes,) = new_figure((HALF[0], max(2.0, 0.27 * len(share) + 1.1)))
        places = np.arange(len(share))[::-1]
        colours = [VERMILION if s > 10 else ORANGE if s > 5 else BLUE for s in share]
        axes.barh(places, share, color=colours, height=0.62)
        for limit, dash in ((5, ":"), (10, "--")):
            axes.axvline(limit, color=BLACK, lw=0.9, ls=dash)
        for place, value in zip(places, share):
            around = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"}
            axes.annotate(
                f"{value:.2g} %",
                (value, place),
                (4, 0),
                textcoords="offset points",
                va="center",
                fontsize=8,
                bbox=around,
            )
        axes.set_yticks(places, names)
        axes.set_xlim(0, max(12.0, 1.15 * float(share.to_numpy().max(initial=0.0))))
        axes.grid(axis="y", visible=False)
        axes.set(xlabel="peak hourglass / peak internal energy (%)", title="Hourglass energy by part")
        alt = "Hourglass share by part: " + ", ".join(f"{n} {v:.2g} %" for n, v in zip(names, share)) + "."
        caption = (
            "Lines at 5 % (warns) and 10 % (fails). “Of all”: a fluid part is judged by its share of the whole model."
            " Parts with less than 0.1 % of the energy are left out."
        )
        return finish(figure, "hourglass_by_part", alt, caption)


def strain_chart(histories: pd.DataFrame, convergence_class: str) -> Picture:
    """95th percentile of maximum principal strain, by region, over time."""
    peaks = histories.groupby("region", sort=False)["mps_green_lagrange_p95"].max().sort_values(ascending=False)
    shown = [r for r in peaks.index if r == "brain"] + [r for r in peaks.index if r != "brain"][: _MOST_REGIONS - 1]
    with house_style():
        figure, (axes,) = new_figure((HALF[0], 3.6))
        for region, colour, dash in zip(shown, (BLACK, *[c for c in CYCLE if c != BLACK]), DASHES):
            rows = histories[histories["region"] == region]
            width = 2.4 if region == "brain" else 1.4
            label = "whole brain" if region == "brain" else region.replace("_", " ")
            axes.plot(_milliseconds(rows), rows["mps_green_lagrange_p95"], color=colour, ls=dash, lw=width, label=label)
        axes.set(xlabel=TIME_LABEL, ylabel="MPS, 95th percentile (1)", title="Brain strain by region")
        axes.set_ylim(bottom=0)
        legend_below(axes, 2)
        alt = "Peak of the 95th percentile of strain: " + ", ".join(f"{r} {peaks[r]:.3g}" for r in shown) + "."
        caption = (
            "Maximum principal Green-Lagrange strain, 95th percentile over volume."
            f" Convergence class {convergence_class}: see the note above."
        )
        return finish(figure, "brain_strain", alt, caption)


def pressure_chart(histories: pd.DataFrame) -> Picture:
    """Draw tensile pressure and von Mises stress of the whole brain over time."""
    rows = histories[histories["region"] == "brain"]
    with house_style():
        figure, (axes,) = new_figure((HALF[0], 3.6))
        t = _milliseconds(rows)
        axes.plot(t, rows["tensile_pressure_p95_Pa"] / 1e3, color=BLUE, label="tensile pressure, 95th percentile")
        axes.plot(t, rows["von_mises_p95_Pa"] / 1e3, color=VERMILION, ls="--", label="von Mises, 95th percentile")
        axes.set(xlabel=TIME_LABEL, ylabel="stress (kPa)", title="Brain stress")
        axes.set_ylim(bottom=0)
        legend_below(axes, 1)
        alt = (
            f"Brain stress over time: tensile pressure up to {rows['tensile_pressure_p95_Pa'].max() / 1e3:.3g} kPa, "
            f"von Mises up to {rows['von_mises_p95_Pa'].max() / 1e3:.3g} kPa."
        )
        return finish(figure, "brain_stress", alt, "Whole brain, 95th percentile over volume.")


def action_chart(action: pd.DataFrame, crossover_s: float | None = None) -> Picture:
    """Mechanical action of the bodies over time, and where head and impactor cross."""
    with house_style():
        figure, (axes,) = new_figure()
        t = _milliseconds(action)
        ends = []
        for column, name, colour, dash in (
            ("head_J_s", "head", BLUE, "-"),
            ("helmet_J_s", "helmet", VERMILION, "--"),
            ("impactor_J_s", "impactor", GREEN, "-."),
        ):
            if column in action and action[column].notna().any():
                axes.plot(t, action[column], color=colour, ls=dash, label=name)
                ends.append(f"{name} {action[column].iloc[-1]:.4g} J·s")
        if crossover_s is not None:
            axes.axvline(1e3 * crossover_s, color=GREY, lw=1.0, ls=":", label=f"crossover {1e3 * crossover_s:.3g} ms")
        axes.set(xlabel=TIME_LABEL, ylabel="mechanical action (J·s)", title="Mechanical action")
        axes.set_ylim(bottom=0)
        legend_below(axes, 3)
        caption = "Time integral of kinetic energy (article, Figure 7)."
        if "impactor_J_s" not in action or not action["impactor_J_s"].notna().any():
            caption += " There is no impactor: the skull is driven, so there is no crossover with one."
        return finish(figure, "mechanical_action", f"Mechanical action at the end: {', '.join(ends)}.", caption)


def plain_axes(axes: Axes) -> None:
    """Take frame and ticks off the axes of a picture."""
    axes.set_aspect("equal")
    axes.set_axis_off()
