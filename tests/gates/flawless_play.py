"""A play without a flaw: values with which every gate passes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from replay.gates import (
    Gate,
    Limits,
    PartEnergy,
    agreement_gate,
    assembly_gate,
    fidelity_gate,
    helmet_gate,
    hourglass_sensitivity_gate,
    numerics_gate,
    package_gate,
    placement_gate,
    shake_gate,
    video_reconstruction_gate,
    wearable_reconstruction_gate,
)
from replay.gates.package import VIDEO_PACKAGE

GOOD: dict[str, dict[str, Any]] = {
    "helmet": {
        "mass_kg": 1.83,
        "cg_offset_m": 0.002,
        "length_m": 0.30,
        "width_m": 0.24,
        "height_m": 0.27,
        "wedge_share": 0.0,
        "removed_not_wedge": 0,
        "missing_interfaces": 0,
        "unusable_parts": 0,
        "colliding_ids": 0,
        "min_volume_m3": 1e-8,
        "min_scaled_jacobian": 0.35,
    },
    "video": {
        "reprojection_rmse_median_px": 2.7,
        "reprojection_rmse_p95_px": 3.6,
        "frames_above_8_px": 0,
        "degrees_of_freedom_min": 9,
        "focal_drift_median_percent": 2.1,
        "focal_drift_p95_percent": 3.0,
        "focal_sigma_log": 0.01,
        "scale_drift_percent": 0.8,
        "baseline_drift_median_percent": 2.3,
        "baseline_drift_p95_percent": 5.2,
        "pixels_per_metre": 400.0,
        "flip_margin": 3.0,
        "peak_over_null": 6.0,
        "linear_cutoff_over_nyquist": 0.5,
        "angular_cutoff_over_nyquist": 0.67,
        "focal_cutoff_over_nyquist": 0.1,
        "helmet_to_com_m": 0.06,
        "posterior_flip_margin": 40.0,
        "posterior_peak_over_null": 9.0,
        "peak_omega_resolved": True,
        "t0_resolved": True,
        "bands_calibrated": True,
    },
    "wearable": {
        "sampling_rate_hz": 6400.0,
        "sampling_jitter_percent": 0.1,
        "filter_cutoff_over_nyquist": 0.1,
        "range_used": 0.4,
        "saturated_samples": 0,
        "missing_samples": 0,
        "window_covered": True,
        "sensor_to_cg_m": 0.08,
        "peak_over_noise": 40.0,
    },
    "assembly": {
        "helmet_mass_difference_kg": 0.01,
        "helmet_cg_difference_m": 0.002,
        "head_mass_kg": 4.9,
        "head_cg_offset_m": 0.0,
        "duplicate_part_ids": 0,
        "parts_outside_block": 0,
        "unconnected_parts": 0,
        "min_scaled_jacobian": 0.3,
    },
    "assembly_contact": {
        "initial_penetration_m": 0.0,
        "projection_over_edge": 0.1,
        "projection_jacobian_ratio": 0.9,
        "unresolved_friction_pairs": 0,
    },
    "placement": {
        "gap_error_m": 1e-9,
        "initial_penetration_m": 0.0,
        "colliding_ids": 0,
        "parts_outside_block": 0,
        "unresolved_friction_pairs": 0,
    },
    "shake": {
        "ran_to_end": True,
        "negative_volumes": 0,
        "min_time_step_s": 4e-7,
        "edge_stretch_max": 1.0001,
        "edge_stretch_min": 0.9999,
        "part_velocity_deviation": 1e-9,
        "stress_over_impact_stress": 1e-9,
        "stress_growth": 1e-6,
        "energy_ratio": 1.0,
        "momentum_drift": 1e-14,
    },
    "numerics": {
        "ran_to_end": True,
        "added_mass_share": 0.0,
        "added_mass_part_share": 0.0,
        "min_time_step_s": 4e-7,
        "min_volume_ratio": 0.4,
        "flow_residual": 1e-13,
    },
    "numerics_contact": {
        "contact_creation_share": 0.0,
        "friction_work_J": -0.1,
        "contact_unconverged_share": 0.0,
        "penetration_over_edge": 0.01,
    },
}


def good_ledger(rows: int = 50) -> dict[str, np.ndarray]:
    """A ledger whose books are kept: 20 J at the start, some of it turned inward, work added."""
    s = np.linspace(0, 1, rows)
    work = 5 * s
    internal, hourglass, viscous = 3 * s, 0.05 * s, 0.02 * s
    kinetic = 20 + work - internal - hourglass - viscous
    zero = np.zeros(rows)
    return {
        "kinetic_J": kinetic,
        "internal_J": internal,
        "hourglass_J": hourglass,
        "bulk_viscosity_J": viscous,
        "external_work_J": work,
        "total_J": kinetic + internal + hourglass + viscous,
        "ratio": np.ones(rows),
        "momentum_x_N_s": zero + 6.0,
        "momentum_y_N_s": zero,
        "momentum_z_N_s": zero,
    }


GOOD_PARTS = (PartEnergy("brain", 2.0, 0.05), PartEnergy("csf", 0.4, 0.03, fluid=True), PartEnergy("shell", 0.6, 0.01))
GOOD_REGIONS = {"right_occipital_lobe": {"mps": 0.2, "mps_half": 0.204, "pressure_Pa": 2e4, "pressure_half_Pa": 2.02e4}}
GOOD_FIDELITY = {
    quantity: {"rmse_percent_of_peak": 0.2, "delta_peak_percent": -0.1, "delta_time_to_peak_ms": 0.05}
    for quantity in ("linear_acceleration", "angular_acceleration", "angular_velocity")
} | {"position_residual_mm": 1e-4, "rotation_residual_deg": 1e-4}

GOOD_AGREEMENT: dict[str, Any] = {
    "same_video": True,
    "frame_rate_difference_percent": 0.0,
    "template_scale_percent": 0.3,
    "template_residual_mm": 1.2,
    "helmet_to_com_difference_mm": 1.0,
    "same_filters": True,
    "t0_difference_samples": 0.0,
    "along_ray_over_noise": 0.6,
    "velocity_difference_m_per_s": 0.05,
    "spin_difference_rad_per_s": 0.4,
}
GOOD_QUANTITIES: dict[str, dict[str, Any]] = {
    "angular velocity": {
        "rmse_percent_of_peak": 1.2,
        "delta_peak_percent": 0.4,
        "time_to_peak_difference_samples": 0.1,
        "iso_18571_rating": 0.98,
    }
}
GOOD_LABORATORIES: dict[str, dict[str, Any]] = {"north": {"own_gates_passed": True, "limits_as_shipped": True}}


def all_gates(limits: Limits) -> dict[str, Gate]:
    """Every gate of a flawless play whose model has contact, and that of two laboratories which agree on it."""
    builders: dict[str, Callable[[], Gate]] = {
        "helmet": lambda: helmet_gate(GOOD["helmet"], limits),
        "reconstruction": lambda: video_reconstruction_gate(GOOD["video"], limits),
        "assembly": lambda: assembly_gate(GOOD["assembly"], limits, contact=GOOD["assembly_contact"]),
        "placement": lambda: placement_gate(GOOD["placement"], limits),
        "shake": lambda: shake_gate(GOOD["shake"], limits, contact_blow_up=False),
        "numerics": lambda: numerics_gate(
            good_ledger(), GOOD_PARTS, GOOD["numerics"], limits, free=True, contact=GOOD["numerics_contact"]
        ),
        "hourglass_sensitivity": lambda: hourglass_sensitivity_gate(GOOD_REGIONS, limits),
        "fidelity": lambda: fidelity_gate(GOOD_FIDELITY, limits),
        "package": lambda: package_gate(dict.fromkeys(VIDEO_PACKAGE, (True, True)), limits),
        "agreement": lambda: agreement_gate(GOOD_AGREEMENT, GOOD_QUANTITIES, GOOD_LABORATORIES, limits),
    }
    return {name: build() for name, build in builders.items()}


def wearable_gate(limits: Limits) -> Gate:
    return wearable_reconstruction_gate(GOOD["wearable"], limits)
