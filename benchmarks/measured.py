"""What is kept of a clip: everything that bands, their calibration and the table are computed from, one JSON line.

Filming is slow and its rows are kept; rules for bands may then change and be judged again at once. A row knows the
sources that it was made by, and is left out where they have changed since: a table is of one estimator.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import footage
import numpy as np
from footage import Clip, both_modes
from scipy.spatial.transform import Rotation

from replay.motion import bands, onset
from replay.motion.bands import INSTANTS, Band, Spread, constants, spread_of
from replay.motion.onset import contact_index
from replay.motion.posterior import PosteriorMotion
from replay.motion.protocol import ProtocolMotion, peak_frame
from replay.sources import sources_of

Row = dict[str, Any]
SHARES = (0.05, 0.16, 0.25, 0.5, 0.75, 0.84, 0.95)
"""Quantiles of the draws that are kept of every peak."""


@cache
def estimator() -> str:
    """Hash of the sources that film and reconstruct a clip; the bands are put on afterwards."""
    motion = Path(onset.__file__).parent
    makers = (motion / "posterior.py", motion / "synthetic" / "footage.py", motion / "synthetic" / "families.py")
    sources = {path for maker in makers for path in sources_of(maker)} - {Path(bands.__file__), bands.CONSTANTS_FILE}
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in (*sorted(sources), Path(footage.__file__))))
    return digest.hexdigest()[:12]


def rows_of(path: Path) -> list[Row]:
    """Every clip that a file holds of today's estimator."""
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    return [row for row in rows if row["estimator"] == estimator()]


def collect(path: Path, seeds: range, clip_of: Callable[[int], tuple[str, Clip]]) -> None:
    """Film, reconstruct and measure the clips of the seeds that a file does not hold yet; one line each."""
    done = {row["seed"] for row in rows_of(path)}
    path.parent.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        if seed not in done:
            family, clip = clip_of(seed)
            row = {"estimator": estimator(), "family": family, "seed": seed, **measure(clip, *both_modes(clip))}
            with path.open("a") as out:
                out.write(json.dumps(row) + "\n")


def measure(clip: Clip, protocol: ProtocolMotion, posterior: PosteriorMotion) -> Row:
    """Truth, draws and errors of one clip."""
    draws, frame_s = posterior.draws, 1.0 / clip.settings.fps
    return {
        "fps": clip.settings.fps,
        "truth": true_peaks(clip, posterior),
        "draws": {n: _short(np.quantile(v, SHARES)) for n, v in posterior.peaks.items()},
        "t0": {
            "time_s": [float(draws.inner(frame_s)[1][0]), float(draws.time_s[1] - draws.time_s[0])],
            "relative_alpha": _short(posterior.relative_alpha, 4),
        },
        "scaled": dict(_scaled(clip, posterior)),
        "before": _before(clip, posterior),
        **_against_protocol(clip, protocol, posterior),
        "flip_margin": min(posterior.flip_margin, 1e3),
        "event": posterior.event_probability,
        "sigma_ratio": posterior.batch.sigma_px / clip.settings.click_sigma_px,
    }


def _short(values: np.ndarray, digits: int = 6) -> list[float]:
    return [float(f"{value:.{digits}g}") for value in np.ravel(values)]


def kept_spread(name: str, row: Row) -> Spread:
    """Centre and width of a quantity's draws."""
    kept = dict(zip(SHARES, row["draws"][name]))
    return spread_of(name, kept[0.16], kept[0.5], kept[0.84])


def kept_band(name: str, row: Row) -> Band:
    """Band of a quantity under the constants of today."""
    if name == "t0_s":
        curve, (start, step) = np.array(row["t0"]["relative_alpha"]), row["t0"]["time_s"]
        found = constants().instants(start + step * np.arange(len(curve)), curve)
    else:
        found = constants().apply(name, kept_spread(name, row), row["fps"])
    return found.of_event(row["event"]) if name in INSTANTS else found


def _inner_truth(clip: Clip, posterior: PosteriorMotion) -> tuple[np.ndarray, float]:
    """True times of the grid points at which peaks are taken, and what the clip's clock is late by [s]."""
    late = float(clip.times[0])
    _, time = posterior.draws.inner(1.0 / clip.settings.fps)
    return time + late, late


def true_peaks(clip: Clip, posterior: PosteriorMotion) -> dict[str, float]:
    """Peaks of the continuous motion within the clip; instants on the clip's clock."""
    time, late = _inner_truth(clip, posterior)
    k = clip.motion.at(time)
    ray = posterior.draws.ray
    along = k.acceleration_m_per_s2 @ ray
    across = np.linalg.norm(k.acceleration_m_per_s2 - along[:, None] * ray, axis=1)
    return {
        "omega_rad_per_s": float(k.omega_resultant.max()),
        "alpha_rad_per_s2": float(k.alpha_resultant.max()),
        "a_m_per_s2": float(k.linear_resultant.max()),
        "a_across_m_per_s2": float(across.max()),
        "a_along_m_per_s2": float(np.abs(along).max()),
        "t0_s": float(time[np.argmax(k.alpha_resultant)] - late),
        "onset_s": float(time[contact_index(k.alpha_resultant, k.linear_resultant)] - late),
    }


def _scaled(clip: Clip, posterior: PosteriorMotion) -> Iterator[tuple[str, list[float]]]:
    """Errors of the curves' components at the inner frames, in the posterior's standard deviations."""
    index, at = posterior.at_frames
    exact, draws = clip.motion.at(clip.times[index]), posterior.draws
    for name, true, drawn in (
        ("omega", exact.omega_rad_per_s, draws.omega_rad_per_s),
        ("alpha", exact.alpha_rad_per_s2, draws.alpha_rad_per_s2),
        ("a", exact.acceleration_m_per_s2, draws.acceleration_m_per_s2),
    ):
        values = drawn[:, at]
        yield name, _short((np.abs(values.mean(axis=0) - true) / values.std(axis=0))[1:-1], 3)


def _before(clip: Clip, posterior: PosteriorMotion) -> Row:
    """Errors of the velocities just before the impact, against those at the true onset, with their sigmas."""
    time, _ = _inner_truth(clip, posterior)
    k = clip.motion.at(time)
    at = contact_index(k.alpha_resultant, k.linear_resultant)
    found = posterior.before
    return {
        "frames": found.frames,
        "velocity": _short(found.motion.velocity_m_per_s[0] - k.velocity_m_per_s[at]),
        "sigma_velocity": _short(found.sigma_velocity_m_per_s),
        "omega": _short(found.motion.omega_rad_per_s[0] - k.omega_rad_per_s[at]),
        "sigma_omega": _short(found.sigma_omega_rad_per_s),
    }


def _against_protocol(clip: Clip, protocol: ProtocolMotion, posterior: PosteriorMotion) -> Row:
    """Protocol mode's peaks, and both modes' distance from the true curves and poses."""
    inner = slice(1, -1)
    k, exact = protocol.kinematics, clip.footage.truth
    index, at = posterior.at_frames
    error = posterior.draws.omega_rad_per_s[:, at].mean(axis=0) - exact.omega_rad_per_s[index]
    raw = k.omega_rad_per_s - exact.omega_rad_per_s
    true_turn = clip.settings.rotation_to_global.inv() * exact.rotation
    off = (Rotation.from_matrix(posterior.batch.state.rotation) * true_turn.inv()).magnitude()
    off_protocol = (k.rotation * exact.rotation.inv()).magnitude()
    return {
        "protocol_omega": float(k.omega_resultant[inner].max()),
        "protocol_alpha": float(k.alpha_resultant[inner].max()),
        "protocol_t0_s": float(k.time_s[peak_frame(k.alpha_resultant)]),
        "rmse": float(np.sqrt(np.mean(np.sum(error[inner] ** 2, axis=1)))),
        "protocol_rmse": float(np.sqrt(np.mean(np.sum(raw[inner] ** 2, axis=1)))),
        "flipped": bool(np.quantile(off, 0.75) > np.radians(20.0)),
        "protocol_flipped": bool(np.quantile(off_protocol, 0.75) > np.radians(20.0)),
    }
