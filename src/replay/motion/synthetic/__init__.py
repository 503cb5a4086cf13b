"""Plays and footage with a known truth: motions, a camera, and what spoils a picture.

Three steps, each a function of its arguments and a seed::

    motion = Impact()                                   # or draw_impact(rng, "skewed"), RecordedMotion.read(path)
    camera = SyntheticCamera(59.94, -18, 18, (1280, 720), 6000.0, landmarks=TEN)
    footage = film(motion, camera, seed=1, flaws=Flaws(click_sigma_px=2.7, outlier_share=0.04))

- ``Motion.at(time_s) -> Kinematics``: anything with this method can be filmed; time 0 is the impact.
- ``SyntheticCamera(fps, first_frame, last_frame, image_size, focal_length_px, click_sigma_px=1.0, phase=0.37,
  landmarks=..., zoom_per_s=0, pan_rad_per_s=0, tilt_rad_per_s=0, row_time_s=0, static_points_m={})``.
- ``film(motion, camera, *, seed, flaws=Flaws(), offset_m=HEAD_SIZED_OFFSET_M) -> Footage`` with ``.tracks``,
  ``.template``, ``.truth`` (at the frames' times), ``.exact_px``, ``.hidden``, ``.wild``, ``.static_px`` and
  ``.settings(distance_sigma=0.01, ...)``, the camera file's contents.
- ``synthesise(preset, seed) -> SyntheticPlay`` and ``footage_play(footage, ...) -> SyntheticPlay`` are plays as files.

The motions of `Impact` are in closed form, so that position, velocity and acceleration of the truth agree exactly;
those of `RecordedMotion` are the exact integrals of splines through a record.
"""

from replay.motion.settings import LEVEL_CAMERA
from replay.motion.synthetic.footage import (
    ARTICLE_OFFSET_M,
    HEAD_SIZED_OFFSET_M,
    LANDMARKS,
    TEN,
    Flaws,
    Footage,
    SyntheticCamera,
    film,
)
from replay.motion.synthetic.motions import Impact, Motion, RecordedMotion, draw_impact
from replay.motion.synthetic.plays import SEEDS, Preset, SyntheticPlay, footage_play, synthesise
from replay.motion.synthetic.pulses import PULSES, Pulse

__all__ = [
    "ARTICLE_OFFSET_M",
    "HEAD_SIZED_OFFSET_M",
    "LANDMARKS",
    "LEVEL_CAMERA",
    "PULSES",
    "SEEDS",
    "TEN",
    "Flaws",
    "Footage",
    "Impact",
    "Motion",
    "Preset",
    "Pulse",
    "RecordedMotion",
    "SyntheticCamera",
    "SyntheticPlay",
    "draw_impact",
    "film",
    "footage_play",
    "synthesise",
]
