"""How well any estimator could read a peak: the Cramer-Rao bound of a pulse between frames.

    python benchmarks/information_bound.py

The pulse's shape is given; its axis, size, instant, duration and arrest are not (weak knowledge of the last two).
No estimator without a bias is surer than this; where the bound misses a target, footage and not code is what lacks.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from accuracy_suite import BASE
from footage import View, clip_of
from scipy.spatial.transform import Rotation

from replay.motion.batch import Problem, State, click_terms
from replay.motion.camera import shift_of
from replay.motion.events import pulse
from replay.motion.protocol import lens_of
from replay.motion.readout import ANGULAR, _Frames
from replay.motion.told import marginal

KNOWN = np.diag([1 / 40.0**2] * 3 + [0.0, 1 / 0.006**2, 1 / 0.035**2])
"""Prior information on size (3 axes), instant, duration and arrest."""
AXIS = np.array([0.5, 0.5, np.sqrt(0.5)])


def bound(view: View, gain_rad_per_s: float, arrest_s: float = 0.070) -> tuple[float, float]:
    """Standard deviation of the peak, as a share, and of the instant [s]."""
    clip = clip_of(view, "half_sine", 1)
    truth, settings, tracks = clip.footage.truth, clip.settings, clip.footage.tracks
    to_camera = Rotation.from_quat(settings.camera_to_global).inv()
    origin = to_camera.apply(truth.position_m - truth.rotation.apply(np.array(settings.helmet_to_com)))
    log_f = np.full(len(clip.times), np.log(clip.footage.camera.focal_length_px))
    state = State((to_camera * truth.rotation).as_matrix(), shift_of(origin), log_f)
    ones, arm = np.ones(tracks.pixels.shape[:2]), np.array(settings.helmet_to_com)
    problem = Problem(clip.footage.template.points_m, tracks.pixels, ones, arm, settings, lens_of(settings))
    _, _, information, gradient = click_terms(problem, state, view.sigma_px)
    information, _ = marginal(information, gradient, slice(0, 3), slice(3, 6))
    to_body = np.swapaxes(state.rotation, 1, 2)
    time = tracks.frames / settings.fps
    frames = _Frames(time, np.zeros((len(time), 3)), to_body @ information @ state.rotation, ANGULAR)

    def levels(p: np.ndarray) -> np.ndarray:
        level = pulse(p[4], p[5]).at(time - p[3])[0][:, 0]
        return ((level - level[0])[:, None] * p[:3]).ravel()

    middle = 0.5 * (time[0] + time[-1]) + 0.25 / view.fps
    at = np.array([*(gain_rad_per_s * AXIS), middle, 0.015, arrest_s])
    columns = []
    for i, h in enumerate((0.1, 0.1, 0.1, 1e-3, 1e-3, 4e-3)):
        step = np.zeros(len(at))
        step[i] = h
        columns.append(frames.whitener @ (levels(at + step) - levels(at - step)) / (2 * h))
    design = np.array(columns).T
    covariance = np.linalg.inv(design.T @ design + KNOWN)
    return float(np.sqrt(AXIS @ covariance[:3, :3] @ AXIS)) / gain_rad_per_s, float(np.sqrt(covariance[3, 3]))


def main() -> None:
    """Print the bound for the footage of the target's definition."""
    print("| px/m | click noise [px] | peak at 20 rad/s | at 33 rad/s | t0 at 33 rad/s [ms] |\n|---|---|---|---|---|")
    for scale, sigma in ((150.0, 2.7), (150.0, 1.0), (300.0, 2.7), (300.0, 1.0), (600.0, 1.0)):
        view = replace(BASE, px_per_m=scale, sigma_px=sigma, distance_m=6000.0 / scale)
        slow, (share, instant) = bound(view, 20.0)[0], bound(view, 33.0)
        print(f"| {scale:.0f} | {sigma:g} | ±{100 * slow:.1f} % | ±{100 * share:.1f} % | ±{1e3 * instant:.1f} |")


if __name__ == "__main__":
    main()
