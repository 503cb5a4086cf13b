"""What protocol mode recovers of a known impact: the table of docs/accuracy.md."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from replay.motion.protocol import along_ray, peak_frame, reconstruct_clicks
from replay.motion.settings import CameraSettings, Cutoffs
from replay.motion.synthetic import HEAD_SIZED_OFFSET_M, LANDMARKS, Impact, SyntheticCamera
from replay.motion.tracks import Template, Tracks

SIX = ("LM1", "LM2", "LM3", "LM4", "LM5", "LM8")
FOUR = ("LM1", "LM2", "LM3", "LM5")


@dataclass(frozen=True)
class Case:
    """One row of the table: a camera, a distance, and whether the camera's distance is known."""

    name: str
    camera: SyntheticCamera
    distance_m: float
    cutoff_hz: float
    reference: bool = True


def _camera(
    fps: float, focal_px: float, landmarks: tuple[str, ...] = tuple(LANDMARKS), sigma: float = 1.0
) -> SyntheticCamera:
    half = round(0.1 * fps)
    return SyntheticCamera(fps, -half, half + 2, (3840, 2160), focal_px, sigma, landmarks=landmarks)


CASES = (
    Case("demo: 8 landmarks, 239.76 fps, 2400 px/m", _camera(239.76, 3840.0), 1.6, 40.0),
    Case("6 landmarks", _camera(239.76, 3840.0, SIX), 1.6, 40.0),
    Case("4 landmarks", _camera(239.76, 3840.0, FOUR), 1.6, 40.0),
    Case("8 landmarks, angular and linear filters off", _camera(239.76, 3840.0), 1.6, 200.0),
    Case("8 landmarks, clicks 2.7 px", _camera(239.76, 3840.0, sigma=2.7), 1.6, 40.0),
    Case("8 landmarks, 119.88 fps", _camera(119.88, 3840.0), 1.6, 40.0),
    Case("8 landmarks, 59.94 fps", _camera(59.94, 3840.0), 1.6, 25.0),
    Case("8 landmarks, 239.76 fps, 10 m, 600 px/m", _camera(239.76, 6000.0), 10.0, 40.0),
    Case("8 landmarks, 59.94 fps, 45 m, 133 px/m", _camera(59.94, 6000.0), 45.0, 15.0),
    Case("3 landmarks, 59.94 fps, 45 m, no reference", _camera(59.94, 6000.0, FOUR[:3]), 45.0, 15.0, False),
)


SEEDS = range(5)
"""Seeds of the click noise."""


@dataclass(frozen=True)
class Row:
    """Medians over the seeds: recovered peak over true peak, and errors."""

    name: str
    omega_ratio: float
    alpha_ratio: float
    across_ratio: float
    along_ratio: float
    omega_rmse_rad_per_s: float
    t0_error_ms: float
    orientation_error_deg: float


def measure(case: Case, seeds: range = SEEDS) -> Row:
    """Reconstruct one case for every seed and compare with the truth.

    True peaks are those of the continuous motion, not of its samples; the orientation error is the root mean
    square over frames.
    """
    impact = replace(Impact(), position_m=(0.0, case.distance_m, 0.0))
    names = case.camera.landmarks
    points = np.array([LANDMARKS[name] for name in names])
    truth = impact.at(case.camera.times)
    fine = impact.at(np.linspace(-0.05, 0.08, 6501))
    fine_along, fine_across = along_ray(fine)
    exact = case.camera.see(truth, points, np.array(HEAD_SIZED_OFFSET_M))
    width, height = case.camera.image_size
    settings = CameraSettings(
        fps=case.camera.fps,
        principal_point=(width / 2, height / 2),
        cutoffs=Cutoffs(linear=case.cutoff_hz, angular=case.cutoff_hz),
        helmet_to_com=HEAD_SIZED_OFFSET_M,
        camera_distance_m=case.distance_m if case.reference else None,
        camera_distance_sigma_m=0.01 * case.distance_m if case.reference else None,
        lens="fixed",
        click_sigma_px=case.camera.click_sigma_px,
    )
    rows = []
    for seed in seeds:
        noise = np.random.default_rng(seed).normal(0.0, case.camera.click_sigma_px, exact.shape)
        tracks = Tracks(np.arange(len(exact)), exact + noise)
        k = reconstruct_clicks(tracks, Template(names, points), settings).kinematics
        along, across = along_ray(k)
        inner = slice(1, -1)
        error = (k.omega_rad_per_s - truth.omega_rad_per_s)[inner]
        rows.append(
            [
                k.omega_resultant[inner].max() / fine.omega_resultant.max(),
                k.alpha_resultant[inner].max() / fine.alpha_resultant.max(),
                across[inner].max() / fine_across.max(),
                np.abs(along[inner]).max() / np.abs(fine_along).max(),
                np.sqrt(np.mean(np.sum(error**2, axis=1))),
                1e3 * abs(case.camera.times[peak_frame(k.alpha_resultant)]),
                np.degrees(np.sqrt(np.mean((k.rotation * truth.rotation.inv()).magnitude() ** 2))),
            ]
        )
    return Row(case.name, *(float(v) for v in np.median(np.array(rows), axis=0)))


HEADER = (
    "| footage | peak omega | peak alpha | peak a across ray | peak a along ray "
    "| omega(t) RMSE [rad/s] | t0 error [ms] | orientation RMS error [deg] |\n"
    "|---|---|---|---|---|---|---|---|\n"
)


def line(row: Row) -> str:
    """One line of the table; peaks are recovered over true."""
    return (
        f"| {row.name} | {row.omega_ratio:.2f} | {row.alpha_ratio:.2f} "
        f"| {row.across_ratio:.2f} | {row.along_ratio:.3g} "
        f"| {row.omega_rmse_rad_per_s:.2f} | {row.t0_error_ms:.1f} | {row.orientation_error_deg:.2f} |\n"
    )


def table(cases: tuple[Case, ...] = CASES, seeds: range = SEEDS) -> str:
    """Markdown table over cases."""
    return HEADER + "".join(line(measure(case, seeds)) for case in cases)
