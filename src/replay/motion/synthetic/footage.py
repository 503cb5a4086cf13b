"""A camera that films a motion, and what spoils the picture: noise, blur, occlusion, wild clicks, zoom, pan."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from replay.motion.camera import Lens, project, shift_of
from replay.motion.kinematics import Kinematics
from replay.motion.settings import LEVEL_CAMERA, CameraSettings, Cutoffs
from replay.motion.synthetic.motions import Motion
from replay.motion.tracks import Template, Tracks

_POINTS: dict[str, tuple[float, float, float]] = {
    "LM1": (0.185, 0.000, -0.045),  # facemask centre
    "LM2": (0.135, 0.095, -0.050),  # facemask left
    "LM3": (0.135, -0.095, -0.050),  # facemask right
    "LM4": (0.145, 0.000, 0.085),  # front bumper
    "LM5": (0.010, 0.000, 0.165),  # crown
    "LM6": (0.095, 0.100, 0.045),  # left upper facemask screw
    "LM7": (0.095, -0.100, 0.045),  # right upper facemask screw
    "LM8": (0.000, 0.125, 0.000),  # left ear hole
    "LM9": (0.000, -0.125, 0.000),  # right ear hole
    "LM10": (0.090, 0.060, 0.125),  # left of the front stripe
}
TEN = tuple(_POINTS)
"""Names of ten points of a helmet."""
LANDMARKS = {name: _POINTS[name] for name in TEN[:8]}
"""Eight points of a helmet [m]; origin midway between the ear holes, head axes."""
HEAD_SIZED_OFFSET_M = (0.010, 0.0, 0.030)
"""Ear-hole midpoint to head CG: forward and up of the auditory canals [m]."""
ARTICLE_OFFSET_M = (-0.1, 0.4, 0.0)
"""helmet_to_com as the article prints it [m]."""

_FEWEST_SEEN = 3


@dataclass(frozen=True)
class SyntheticCamera:
    """A camera at the global origin that looks along global y, level at time 0.

    Parameters
    ----------
    fps, first_frame, last_frame
        Frame rate [Hz] and frames, numbered so that time 0 is frame 0 plus `phase`.
    image_size, focal_length_px
        Width, height and focal length at time 0 [px].
    click_sigma_px
        Standard deviation of each click coordinate [px], where the flaws do not say otherwise.
    phase
        Share of a frame between time 0 and frame 0: impacts do not wait for the shutter.
    landmarks
        Names of the points that are clicked, of `TEN`.
    zoom_per_s
        Rate of log focal length [1/s].
    pan_rad_per_s, tilt_rad_per_s
        The camera turns to the right and upward at these rates.
    row_time_s
        Rolling shutter: time between the exposures of two rows [s].
    static_points_m
        Points of the scene that do not move, global [m].
    """

    fps: float
    first_frame: int
    last_frame: int
    image_size: tuple[int, int]
    focal_length_px: float
    click_sigma_px: float = 1.0
    phase: float = 0.37
    landmarks: tuple[str, ...] = tuple(LANDMARKS)
    zoom_per_s: float = 0.0
    pan_rad_per_s: float = 0.0
    tilt_rad_per_s: float = 0.0
    row_time_s: float = 0.0
    static_points_m: dict[str, tuple[float, float, float]] = field(default_factory=dict)

    @property
    def times(self) -> np.ndarray:
        """``(n,)`` true times of the frames' first rows [s]."""
        return (np.arange(self.first_frame, self.last_frame + 1) + self.phase) / self.fps

    @property
    def points_m(self) -> np.ndarray:
        """``(n, 3)`` clicked points, template axes [m]."""
        return np.array([_POINTS[name] for name in self.landmarks])

    def _to_camera(self, time_s: np.ndarray) -> Rotation:
        turned = Rotation.from_euler(
            "ZX", np.stack([-self.pan_rad_per_s * time_s, self.tilt_rad_per_s * time_s], axis=1)
        )
        return (turned * Rotation.from_quat(LEVEL_CAMERA)).inv()

    def _log_f(self, time_s: np.ndarray) -> np.ndarray:
        return np.log(self.focal_length_px) + self.zoom_per_s * time_s

    @property
    def _lens(self) -> Lens:
        return Lens((self.image_size[0] / 2, self.image_size[1] / 2))

    def see(self, motion: Kinematics, landmarks: np.ndarray, offset_m: np.ndarray) -> np.ndarray:
        """Exact pixels ``(frames, landmarks, 2)`` of helmet points ``(n, 3)`` [m], `offset_m` from template to CG."""
        to_camera = self._to_camera(motion.time_s)
        rotation = (to_camera * motion.rotation).as_matrix()
        origin = to_camera.apply(motion.position_m - motion.rotation.apply(offset_m))
        return project(landmarks, rotation, shift_of(origin), self._log_f(motion.time_s), self._lens)[0]

    def see_static(self, time_s: np.ndarray) -> np.ndarray:
        """Exact pixels ``(frames, static points, 2)`` of the scene's static points."""
        if not self.static_points_m:
            return np.empty((len(time_s), 0, 2))
        points = np.array(list(self.static_points_m.values()))
        to_camera = self._to_camera(time_s)
        # the first point is the origin of a template that the camera sees turning
        origin = to_camera.apply(np.repeat(points[:1], len(time_s), axis=0))
        return project(points - points[:1], to_camera.as_matrix(), shift_of(origin), self._log_f(time_s), self._lens)[0]


@dataclass(frozen=True)
class Flaws:
    """What spoils the clicks.

    Parameters
    ----------
    click_sigma_px
        Standard deviation of a click coordinate [px]; None is the camera's.
    blur_share
        Motion blur: this share of the distance that a landmark moves during the exposure is added to the click's
        standard deviation, in quadrature.
    exposure_share
        Exposure over frame time.
    outlier_share, outlier_px
        Share of clicks that are wild, and their standard deviation [px].
    occluded_share, occlusion_frames
        Share of clicks that are hidden, in runs of so many frames; a run that would leave fewer than three
        landmarks in a frame is not hidden.
    hide_the_far_side
        Whether landmarks that face away from the camera are hidden.
    """

    click_sigma_px: float | None = None
    blur_share: float = 0.0
    exposure_share: float = 0.5
    outlier_share: float = 0.0
    outlier_px: float = 30.0
    occluded_share: float = 0.0
    occlusion_frames: int = 4
    hide_the_far_side: bool = False


@dataclass(frozen=True)
class Footage:
    """Clicks of a filmed motion beside their truth.

    Parameters
    ----------
    camera, flaws, offset_m
        What made it; `offset_m` from the template's origin to the CG.
    tracks, template
        What a user would have; frames are numbered from 0.
    truth
        Motion of the CG at the times of the frames; under a rolling shutter, of the landmarks' median row.
    exact_px
        ``(frames, landmarks, 2)`` without noise.
    hidden, wild
        ``(frames, landmarks)`` whether a click is missing, and whether it is an outlier.
    static_px
        ``(frames, static points, 2)`` clicks of the static points.
    """

    camera: SyntheticCamera
    flaws: Flaws
    offset_m: tuple[float, float, float]
    tracks: Tracks
    template: Template
    truth: Kinematics
    exact_px: np.ndarray
    hidden: np.ndarray
    wild: np.ndarray
    static_px: np.ndarray

    def settings(
        self,
        *,
        distance_sigma: float | None = 0.01,
        linear_hz: float = 15.0,
        angular_hz: float = 40.0,
        click_sigma_px: float | None = None,
    ) -> CameraSettings:
        """Camera file of the footage.

        Parameters
        ----------
        distance_sigma
            Relative standard deviation of the stated camera distance; None states no distance.
        linear_hz, angular_hz
            Cutoffs.
        click_sigma_px
            Stated noise of a click; default the true one.
        """
        width, height = self.camera.image_size
        distance = float(np.mean(self.truth.position_m[:, 1]))
        true_sigma = self.camera.click_sigma_px if self.flaws.click_sigma_px is None else self.flaws.click_sigma_px
        return CameraSettings(
            fps=self.camera.fps,
            image_size=self.camera.image_size,
            principal_point=(width / 2, height / 2),
            cutoffs=Cutoffs(linear=linear_hz, angular=angular_hz),
            helmet_to_com=self.offset_m,
            camera_distance_m=None if distance_sigma is None else distance,
            camera_distance_sigma_m=None if distance_sigma is None else distance_sigma * distance,
            lens="fixed" if self.camera.zoom_per_s == 0.0 else "zoom",
            click_sigma_px=max(true_sigma, 0.05) if click_sigma_px is None else click_sigma_px,
        )


def film(
    motion: Motion,
    camera: SyntheticCamera,
    *,
    seed: int,
    flaws: Flaws | None = None,
    offset_m: tuple[float, float, float] = HEAD_SIZED_OFFSET_M,
) -> Footage:
    """Film a motion and click its landmarks.

    Parameters
    ----------
    motion
        What moves.
    camera
        Who looks.
    seed
        Of noise, outliers and occlusion.
    flaws
        What spoils the clicks; default only the camera's click noise.
    offset_m
        From the template's origin to the CG, template axes [m].
    """
    rng = np.random.default_rng(seed)
    flaws = flaws or Flaws()
    sigma = camera.click_sigma_px if flaws.click_sigma_px is None else flaws.click_sigma_px
    points, offset = camera.points_m, np.array(offset_m)
    exact = _rolling(motion, camera, points, offset)
    spread = np.full(exact.shape[:2], sigma)
    if flaws.blur_share:
        streak = np.linalg.norm(np.gradient(exact, axis=0), axis=2) * flaws.exposure_share
        spread = np.hypot(spread, flaws.blur_share * streak)
    noisy = exact + rng.normal(size=exact.shape) * spread[..., None]
    wild = rng.random(exact.shape[:2]) < flaws.outlier_share
    noisy += np.where(wild[..., None], rng.normal(0.0, flaws.outlier_px, exact.shape), 0.0)
    truth = motion.at(camera.times + camera.row_time_s * float(np.median(exact[..., 1])))
    hidden = _occluded(rng, exact.shape[:2], flaws)
    if flaws.hide_the_far_side:
        hidden |= _facing_away(truth, points)
    clean = camera.see_static(camera.times)
    return Footage(
        camera=camera,
        flaws=flaws,
        offset_m=offset_m,
        tracks=Tracks(np.arange(len(exact)), np.where(hidden[..., None], np.nan, noisy)),
        template=Template(camera.landmarks, points),
        truth=truth,
        exact_px=exact,
        hidden=hidden,
        wild=wild & ~hidden,
        static_px=clean + rng.normal(0.0, sigma, clean.shape),
    )


def _rolling(motion: Motion, camera: SyntheticCamera, points: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Pixels of every landmark at the time at which its own row is exposed."""
    exact = camera.see(motion.at(camera.times), points, offset)
    if camera.row_time_s == 0.0:
        return exact
    # v = v(t0 + v row_time): a landmark moves far less than the shutter's edge, so this contracts
    for _ in range(8):
        late = camera.times[:, None] + exact[..., 1] * camera.row_time_s
        columns = [camera.see(motion.at(late[:, j]), points[j : j + 1], offset) for j in range(len(points))]
        exact = np.concatenate(columns, axis=1)
    return exact


def _occluded(rng: np.random.Generator, shape: tuple[int, int], flaws: Flaws) -> np.ndarray:
    hidden = np.zeros(shape, dtype=bool)
    if flaws.occluded_share <= 0.0:
        return hidden
    frames, landmarks = shape
    runs = round(flaws.occluded_share * frames * landmarks / flaws.occlusion_frames)
    for _ in range(runs):
        begin, which = int(rng.integers(frames)), int(rng.integers(landmarks))
        tried = hidden.copy()
        tried[begin : begin + flaws.occlusion_frames, which] = True
        if (~tried).sum(axis=1).min() >= _FEWEST_SEEN:
            hidden = tried
    return hidden


def _facing_away(truth: Kinematics, points: np.ndarray) -> np.ndarray:
    """Whether the outward direction of each landmark, from the template's origin, points away from the camera."""
    outward = np.stack([truth.rotation.apply(point) for point in points], axis=1)
    return np.einsum("kni,ki->kn", outward, truth.position_m) > 0.0
