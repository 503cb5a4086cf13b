"""The article's Tables 1 to 4, filled from this run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from replay.report.markup import absent, fixed, number, scientific, table, text, unit
from replay.report.model import Row

_QUANTITY_WORDS = {
    "linear_acceleration": "Linear acceleration",
    "angular_acceleration": "Angular acceleration",
    "angular_velocity": "Angular velocity",
}


def parts_table(parts: Sequence[Row]) -> str:
    """Table 1: material, mesh and mass of every part."""
    if not parts:
        return absent("Table 1 is empty: no model was assembled.")
    rows = [
        [
            text(str(part["part"]).replace("_", " ")),
            text(str(part["material"]).replace("_", " ")),
            number(part["density_kg_per_m3"]),
            number(None if part.get("youngs_modulus_pa") is None else float(part["youngs_modulus_pa"]) / 1e6),
            number(part.get("poisson_ratio")),
            number(int(part["elements"])),
            number(int(part["nodes"])),
            scientific(float(part["volume_m3"])),
            f"{float(part['mass_kg']):.3f}",
        ]
        for part in parts
    ]
    total = [
        "all parts",
        "",
        "",
        "",
        "",
        number(sum(int(p["elements"]) for p in parts)),
        "",
        scientific(sum(float(p["volume_m3"]) for p in parts)),
        f"{sum(float(p['mass_kg']) for p in parts):.3f}",
    ]
    head = ["Part", "Material", "Density (kg/m³)", "Modulus E (MPa)", "Poisson ν", "Elements", "Nodes", "Volume (m³)"]
    html = table(
        "Table 1. Material properties, mesh and mass of every part",
        [*head, "Mass (kg)"],
        [*rows, total],
        numeric=range(2, 9),
        note="A dash: the material is not described by that constant. Nodes shared by two parts count in both.",
    )
    last = html.rindex("<tr>")
    return html[:last] + '<tr class="total">' + html[last + len("<tr>") :]


def quality_table(quality: Sequence[Row]) -> str:
    """Table 2: reconstruction quality."""
    if not quality:
        return absent("Table 2 does not apply: the motion was not reconstructed from video, or never got that far.")
    rows = [
        [
            text(row["metric"]) + (f" ({unit(row['unit'])})" if row.get("unit") else ""),
            number(row.get("median"), 3),
            "–" if row.get("q1") is None else f"{number(row['q1'], 3)} to {number(row['q3'], 3)}",
            number(row.get("p95"), 3),
            text(row.get("limit", "")),
        ]
        for row in quality
    ]
    return table(
        "Table 2. Reconstruction quality over the frames of the window",
        ["Metric", "Median", "Interquartile range", "95th percentile", "Acceptance limit"],
        rows,
        numeric=(1, 2, 3, 4),
    )


def initial_conditions_table(rows: Sequence[Row]) -> str:
    """Table 3: initial conditions."""
    if not rows:
        return absent("Table 3 is empty: no initial conditions were derived.")
    return table(
        "Table 3. Initial conditions at the start of the window, from the reconstruction and as applied",
        ["Item", "Real play (reconstruction)", "Applied to the model"],
        [
            [
                f"{text(row['item'])} ({unit(row['unit'])})",
                _vector(row.get("reconstruction")),
                _vector(row.get("applied")),
            ]
            for row in rows
        ],
        numeric=(1, 2),
        note="Global frame, z up. The driven skull follows its whole history; these are its first values.",
    )


def _vector(values: Any) -> str:
    if values is None:
        return "–"
    if isinstance(values, str):
        return text(values)
    return "[" + ", ".join(number(float(v)) for v in values) + "]"


def peaks_table(fidelity: Mapping[str, Any] | None) -> str:
    """Table 4: peaks of the target and of the model."""
    if not fidelity:
        return absent("Table 4 is empty: no replay was run.")
    rows = []
    for key, words in _QUANTITY_WORDS.items():
        row = fidelity[key]
        rows.append(
            [
                f"{words} ({unit(row['unit'])})",
                f"{number(row['target_peak'])} at {number(1e3 * row['target_peak_time_s'], 3)}",
                f"{number(row['applied_peak'])} at {number(1e3 * row['applied_peak_time_s'], 3)}",
                fixed(row["delta_peak_percent"]),
                fixed(row["delta_time_to_peak_ms"]),
                number(row["rmse"], 3),
                number(row["rmse_percent_of_peak"], 3),
            ]
        )
    return table(
        "Table 4. Peaks of the driver and of the model's skull",
        [
            "Quantity",
            "Target peak at (ms)",
            "FE peak at (ms)",
            "Δpeak (%)",
            "Δt to peak (ms)",
            "RMSE",
            "RMSE (% of peak)",
        ],
        rows,
        numeric=range(1, 7),
        note="Δpeak is (FE − target) / target, always; Δt is FE − target. Resultants at the skull's centre of gravity.",
    )
