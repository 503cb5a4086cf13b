"""The sections of the page that show what the stages found; each says so when its stage was not run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from replay.report import charts
from replay.report.article_tables import initial_conditions_table, parts_table, peaks_table, quality_table
from replay.report.figure import Picture
from replay.report.head_view import model_picture, sections_picture
from replay.report.markup import absent, badge, figure, label, number, paragraph, table, text, unit
from replay.report.model import ReportInput
from replay.report.verdict_view import gate_title

_CONVERGED_BRAIN_ELEMENTS = 202_800
_CONTACT_COLUMNS = {
    "peak_force_N": "Greatest force, N",
    "impulse_N_s": "Impulse, N s",
    "normal_J": "Lost in closing, J",
    "friction_J": "Lost in friction, J",
}
_CLASS_WORDS = {
    "A": "no regional strain or pressure changes by more than 5 % when the hourglass coefficient is halved",
    "B": "regional strain or pressure changes by 5 to 15 % when the hourglass coefficient is halved",
    "C": "regional strain or pressure changes by more than 15 % when the hourglass coefficient is halved",
    "unknown": "the run at half the hourglass coefficient was not made, so it is not known how far these numbers hold",
}
_ALWAYS = (
    (
        "Injury. Every number here is a diagnostic of a computed process. None is a risk, a threshold or a verdict"
        " on a person; no measure of this page has been validated against an injury outcome."
    ),
    (
        "This player, this helmet. Head, brain and helmet are open stand-ins of average size and calibrated mass,"
        " not the player's anatomy and not the maker's helmet."
    ),
)


def play_section(report: ReportInput) -> str:
    """Return facts of the play and the state of every stage."""
    facts = {k: v for k, v in report.play.items() if k != "title" and v is not None}
    listed = "".join(
        f"<div><dt>{text(str(k).replace('_', ' '))}</dt><dd>{number(v)}</dd></div>" for k, v in facts.items()
    )
    steps = "".join(
        f'<li class="{text(str(stage["state"]).replace(" ", "-"))}"><b>{text(stage["title"])}</b>'
        f"{badge(stage['state'])}<small>{text(stage.get('detail', ''))}</small></li>"
        for stage in report.stages
    )
    pipeline = f'<ol class="pipeline" aria-label="Stages of the pipeline">{steps}</ol>' if steps else ""
    return f'<dl class="facts">{listed}</dl>{pipeline}'


def _not_run(report: ReportInput, what: str) -> str:
    stopped = report.verdict.get("stopped_by")
    why = f": the gate “{report.gate_facts.get(stopped, {}).get('title', stopped)}” ended the play" if stopped else ""
    return absent(f"{what} was not run{why}.")


def _figures(pictures: list[Picture], *drawn: Picture) -> str:
    pictures.extend(drawn)
    kind = "figures thirds" if len(drawn) == 3 else "figures"
    return f'<div class="{kind}">{"".join(figure(p) for p in drawn)}</div>'


def driver_section(report: ReportInput, pictures: list[Picture]) -> str:
    """Return target against applied motion."""
    if report.driver is None or report.applied is None:
        return _not_run(report, "The replay") + peaks_table(report.fidelity)
    drawn = charts.driver_charts(report.driver, report.applied, report.fidelity)
    words = ""
    fidelity = report.fidelity or {}
    if fidelity.get("position_residual_mm") is not None:
        position, rotation = (number(fidelity[k], 2) for k in ("position_residual_mm", "rotation_residual_deg"))
        words = (
            "<p>The skull in the model is driven. What is left between the driver and the motion that was made is"
            f" at most {position} mm and {rotation} degrees.</p>"
        )
        if report.scene is not None:
            words = (
                "<p>The head in the model is free: nothing tells it the reconstructed motion, which is the target"
                f" here. Over the window the two part by up to {position} mm and {rotation} degrees.</p>"
            )
    return words + _figures(pictures, *drawn) + peaks_table(report.fidelity)


_PEAK_WORDS = {
    "omega_rad_per_s": ("Angular velocity", "rad/s", 1.0),
    "alpha_rad_per_s2": ("Angular acceleration", "rad/s^2", 1.0),
    "a_m_per_s2": ("Linear acceleration", "m/s^2", 1.0),
    "a_across_m_per_s2": ("Linear acceleration across the line of sight", "m/s^2", 1.0),
    "a_along_m_per_s2": ("Linear acceleration along the line of sight", "m/s^2", 1.0),
    "t0_s": ("Instant of peak angular acceleration", "ms", 1e3),
    "onset_s": ("Onset of the impact", "ms", 1e3),
}


def both_modes_table(report: ReportInput) -> str:
    """Peaks of protocol mode beside those of posterior mode with their bands."""
    if report.peaks is None:
        return ""
    rows = []
    for row in report.peaks.itertuples():
        words, measure, scale = _PEAK_WORDS[str(row.quantity)]
        found, noise, value, low, high = (
            scale * float(v)
            for v in (row.protocol, row.protocol_null, row.posterior, row.posterior_lo, row.posterior_hi)
        )
        band = f"{number(value, 3)} ({number(low, 3)} to {number(high, 3)})" if value == value else ""
        band += "" if row.resolved == "yes" else f"{', ' if band else ''}{text(str(row.resolved))}"
        rows.append([f"{words} ({unit(measure)})", number(found, 3), number(noise, 3), band])
    return table(
        "Peaks in both modes",
        ["Quantity", "Protocol mode", "Protocol mode, head at rest", "Posterior mode (95 % band)"],
        rows,
        numeric=(1, 2, 3),
        note="Protocol mode is the article's method; posterior mode reads between the frames and says how sure it is.",
    )


def motion_section(report: ReportInput, pictures: list[Picture]) -> str:
    """Return the reconstructed motion and its measures."""
    content = ""
    if report.kinematics is None:
        content += _not_run(report, "The reconstruction")
    else:
        if "posterior_omega_rad_per_s" in report.kinematics:
            content += _figures(pictures, charts.both_modes_chart(report.kinematics, report.t0_s))
            content += both_modes_table(report)
        content += _figures(pictures, *charts.kinematics_charts(report.kinematics, report.t0_s, report.window_s))
    if report.head_measures:
        rows = [
            [
                label(str(m["name"])),
                number(m["value"]),
                unit(m["unit"]),
                text(m["definition"]),
                f'<span class="source">{text(m["source"])}</span>',
            ]
            for m in report.head_measures
        ]
        content += table(
            "Measures of the head's motion",
            ["Measure", "Value", "Unit", "Definition", "Source"],
            rows,
            numeric=(1,),
            stack=True,
        )
    return content + quality_table(report.quality) + initial_conditions_table(report.initial_conditions)


def numerics_section(report: ReportInput, pictures: list[Picture]) -> str:
    """Return energy, time step, hourglass energy, and what contact did."""
    drawn: list[Picture] = []
    if report.energy is not None:
        drawn += charts.energy_charts(report.energy)
    if report.timestep is not None:
        drawn.append(charts.time_step_chart(report.timestep, report.time_step_floor_s, report.mass_scaling_time_step_s))
    if report.part_energy is not None:
        drawn.append(charts.hourglass_chart(report.part_energy))
    content = _figures(pictures, *drawn) if drawn else _not_run(report, "The solver")
    if report.contact:
        rows = [
            [text(pair["first"]), text(pair["second"]), *(number(pair[key]) for key in _CONTACT_COLUMNS)]
            for pair in report.contact
        ]
        content += table(
            "Contact by pair of parts",
            ["Part", "touches", *_CONTACT_COLUMNS.values()],
            rows,
            numeric=range(2, 2 + len(_CONTACT_COLUMNS)),
            note="Forces are means over a history interval. What friction and closing faces lose is in the ledger.",
            stack=True,
        )
    return content


def brain_section(report: ReportInput, pictures: list[Picture]) -> str:
    """Return strain and stress of the brain, with its convergence class beside them."""
    if report.brain_histories is None:
        return _not_run(report, "The replay, and with it the brain,")
    content = _convergence_note(report)
    if report.mesh is not None and report.snapshots is not None:
        picture = sections_picture(report.mesh, report.snapshots, "brain_strain_sections")
        pictures.append(picture)
        content += figure(picture, wide=True)
    histories, grade = report.brain_histories, report.convergence_class
    content += _figures(pictures, charts.strain_chart(histories, grade), charts.pressure_chart(histories))
    rows = []
    for region, given in histories.groupby("region", sort=False):
        peak = given.drop(columns=["time_s", "region"]).max()
        at = (
            given.loc[given["mps_green_lagrange_p95"].idxmax(), "time_s"]
            if given["mps_green_lagrange_p95"].notna().any()
            else None
        )
        rows.append(
            [
                "whole brain" if region == "brain" else text(str(region).replace("_", " ")),
                number(1e6 * peak["volume_m3"], 3),
                number(peak["mps_green_lagrange_p50"], 3),
                f"<b>{number(peak['mps_green_lagrange_p95'], 3)}</b>",
                number(None if at is None else 1e3 * float(at), 3),
                number(peak["mps_log_p95"], 3),
                number(peak["maximum_shear_strain_p95"], 3),
                number(1e-3 * peak["tensile_pressure_p95_Pa"], 3),
                number(1e-3 * peak["von_mises_p95_Pa"], 3),
                number(100 * peak["csdm15"], 3),
                number(100 * peak["csdm25"], 3),
                text(grade),
            ]
        )
    head = [
        "Region",
        "Volume (cm³)",
        "MPS, median",
        "MPS, 95th percentile",
        "at (ms)",
        "Log MPS, 95th",
        "Max shear, 95th",
        "Tensile pressure, 95th (kPa)",
        "Von Mises, 95th (kPa)",
        "CSDM15 (%)",
        "CSDM25 (%)",
        "Class",
    ]
    note = (
        "MPS: maximum principal Green-Lagrange strain. Percentiles are over undeformed volume; each column is its"
        " greatest value over time. Max shear is (E₁ − E₃) / 2."
    )
    return content + table("Peaks by region", head, rows, numeric=range(1, 11), note=note)


def _convergence_note(report: ReportInput) -> str:
    grade = report.convergence_class
    words = f"<b>Convergence class {text(grade)}</b>: {_CLASS_WORDS.get(grade, _CLASS_WORDS['unknown'])}."
    if report.mesh is not None:
        count = int((report.mesh.element_role == "brain").sum())
        words += f" The brain has {number(count)} elements;"
        words += (
            " published convergence studies need 202 800 and more: compare runs of the same mesh, and read no level."
            if count < _CONVERGED_BRAIN_ELEMENTS
            else " that is within what published convergence studies ask of strain."
        )
    return f'<p class="class">{words}</p>'


def action_section(report: ReportInput, pictures: list[Picture]) -> str:
    """Return the mechanical action."""
    if report.action is None:
        return _not_run(report, "The replay")
    return _figures(pictures, charts.action_chart(report.action, report.crossover_s))


def model_section(report: ReportInput, pictures: list[Picture]) -> str:
    """Return the model, its parts and its parameters."""
    content = ""
    if report.mesh is not None:
        picture = model_picture(report.mesh)
        pictures.append(picture)
        content += figure(picture, wide=True)
    content += parts_table(report.parts)
    if report.parameters:
        rows = [
            [
                text(str(p["material"]).replace("_", " ")),
                label(str(p["parameter"])),
                number(p["value"]),
                unit(p["unit"]),
                text(p["certainty"]),
                f'<span class="source">{text(p["source"])}</span>',
            ]
            for p in report.parameters
        ]
        content += table(
            "Parameters: measured, calibrated or assumed",
            ["Material", "Parameter", "Value", "Unit", "Certainty", "Source"],
            rows,
            numeric=(2,),
            stack=True,
        )
    return content


def cannot_show_section(report: ReportInput) -> str:
    """Return what this run cannot show."""
    sentences = [*_ALWAYS, *report.cannot_show]
    powerless: dict[str, list[str]] = {}
    for gate in report.gates:
        for check in gate["checks"]:
            if check["verdict"] == "vacuous":
                name = f"{label(check['name'], check['unit'])} ({gate_title(report, gate['gate'])})"
                powerless.setdefault(str(check.get("detail") or "no reason given"), []).append(name)
    items = [text(sentence) for sentence in sentences]
    items += [f"Not checked, because {text(reason)}: {', '.join(names)}." for reason, names in powerless.items()]
    listed = "".join(f"<li>{item}</li>" for item in items)
    return f'<ul class="limits">{listed}</ul>'


def provenance_section(report: ReportInput) -> str:
    """Return what came in and what made the results."""
    content = ""
    if report.inputs:
        rows = [[text(r["file"]), number(int(r["bytes"])), f"<code>{text(r['sha256'])}</code>"] for r in report.inputs]
        content += table("What came in", ["File", "Bytes", "SHA-256"], rows, numeric=(1,))
    content += _key_values(report.provenance.items())
    return content or paragraph("Nothing was recorded.")


def _key_values(items: Any) -> str:
    rows: Sequence[Sequence[str]] = [[text(k), f"<code>{text(v)}</code>"] for k, v in items]
    return table("Versions and hashes", ["What", "Value"], rows) if rows else ""
