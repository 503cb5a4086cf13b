"""A pan and a rolling shutter are taken out of the tracks, and what is left is the still camera's picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from replay.motion import Impact, check_tracks, reconstruct
from replay.motion.camera import Lens
from replay.motion.corrections import at_one_time, steady
from replay.motion.synthetic import Flaws, SyntheticCamera, film, footage_play
from replay.motion.tracks import Tracks
from replay.play import load_play

STILL = SyntheticCamera(239.76, -24, 26, (3840, 2160), 3840.0, click_sigma_px=0.0)
SCENE = {
    "S1": (4.0, 20.0, 1.0),
    "S2": (-5.0, 25.0, -2.0),
    "S3": (1.0, 30.0, 6.0),
    "S4": (-2.0, 28.0, 2.0),
    "S5": (5.0, 26.0, -4.0),
}
LENS = Lens((1920.0, 1080.0))


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Greatest distance [px] between two sets of tracks, less the shift that all frames have in common."""
    difference = a - b
    return float(np.abs(difference - difference.mean(axis=(0, 1))).max())


def test_a_pan_and_a_zoom_are_removed_to_a_fiftieth_of_a_pixel():
    moving = replace(STILL, static_points_m=SCENE, pan_rad_per_s=0.3, tilt_rad_per_s=0.1, zoom_per_s=0.2)
    footage, still = film(Impact(), moving, seed=0), film(Impact(), STILL, seed=0)
    assert apart(footage.tracks.pixels, still.tracks.pixels) > 50.0
    found = steady(footage.tracks, footage.static_px, 3840.0, LENS)
    assert found.residual_px == pytest.approx(0.0, abs=1e-2)
    t = moving.times
    assert np.ptp(found.rotation_deg[:, 1]) == pytest.approx(np.degrees(0.3 * np.ptp(t)), rel=3e-3)
    assert np.log1p(found.zoom_percent / 100.0) == pytest.approx(0.2 * (t - t[found.reference]), abs=1e-4)
    assert abs(found.reference - len(t) // 2) <= 1
    steadied = steady(Tracks(footage.tracks.frames, footage.static_px), footage.static_px, 3840.0, LENS).tracks.pixels
    assert np.ptp(steadied, axis=0).max() < 0.02


def test_one_static_point_tells_pan_and_tilt_and_a_hidden_one_no_lie():
    moving = replace(STILL, static_points_m=SCENE, pan_rad_per_s=0.3, tilt_rad_per_s=0.1)
    footage, still = film(Impact(), moving, seed=0), film(Impact(), STILL, seed=0)
    alone = steady(footage.tracks, footage.static_px[:, :1], 3840.0, LENS)
    assert alone.residual_px is None
    assert apart(alone.tracks.pixels, still.tracks.pixels) < 0.02 * apart(footage.tracks.pixels, still.tracks.pixels)
    patchy = footage.static_px.copy()
    patchy[10:20, :4] = np.nan
    patchy[30:35, 0] += 40.0
    found = steady(footage.tracks, patchy, 3840.0, LENS)
    whole = steady(footage.tracks, footage.static_px, 3840.0, LENS)
    assert apart(found.tracks.pixels, whole.tracks.pixels) < 4.0


def test_the_static_points_noise_is_measured():
    moving = replace(STILL, static_points_m=SCENE, pan_rad_per_s=0.3, click_sigma_px=1.5)
    found = [steady(f.tracks, f.static_px, 3840.0, LENS) for f in (film(Impact(), moving, seed=s) for s in range(5))]
    assert np.mean([f.residual_px for f in found]) == pytest.approx(1.5, rel=0.15)


def test_a_rolling_shutter_is_undone_to_second_order():
    rolling = replace(STILL, row_time_s=4e-6)
    footage, frozen = film(Impact(), rolling, seed=0), film(Impact(), STILL, seed=0)
    fixed, row = at_one_time(footage.tracks, 4e-6, rolling.fps)
    assert row == pytest.approx(np.median(footage.exact_px[..., 1]))
    aligned = STILL.see(footage.truth, STILL.points_m, np.array(footage.offset_m))
    before, after = (np.abs(p - aligned).max() for p in (footage.tracks.pixels, fixed.pixels))
    assert np.abs(footage.tracks.pixels - frozen.tracks.pixels).max() > before
    assert after < 0.15 * before
    # twice the frame rate leaves an eighth: the parabola's error is of third order
    fast = replace(rolling, fps=2 * rolling.fps, first_frame=-48, last_frame=52)
    filmed = film(Impact(), fast, seed=0)
    again = at_one_time(filmed.tracks, 4e-6, fast.fps)[0]
    left = np.abs(again.pixels - STILL.see(filmed.truth, STILL.points_m, np.array(filmed.offset_m)))[1:-1].max()
    assert left < 0.3 * np.abs(fixed.pixels - aligned)[1:-1].max()


def test_a_hidden_landmark_is_interpolated_over_no_gap():
    footage = film(Impact(), replace(STILL, row_time_s=4e-6), seed=1, flaws=Flaws(occluded_share=0.2))
    fixed, _ = at_one_time(footage.tracks, 4e-6, STILL.fps)
    assert (fixed.seen == footage.tracks.seen).all()


@pytest.mark.parametrize("spoilt", [{"pan_rad_per_s": 0.3, "static_points_m": SCENE}, {"row_time_s": 4e-6}])
def test_a_play_says_what_its_camera_did_and_the_motion_comes_out_right(tmp_path, spoilt):
    camera = replace(STILL, click_sigma_px=0.3, **spoilt)
    footage = film(Impact(), camera, seed=2)
    folder = tmp_path / "spoilt"
    footage_play(Impact(), footage, footage.settings(linear_hz=40.0), "spoilt").write(folder)
    play = load_play(folder)
    found = reconstruct(play).kinematics
    error = np.linalg.norm((found.omega_rad_per_s - footage.truth.omega_rad_per_s)[1:-1], axis=1)
    assert np.sqrt(np.mean(error**2)) < 1.2
    facts = check_tracks(play)
    if "pan_rad_per_s" in spoilt:
        assert facts["pan"]["moved_px"][0] == pytest.approx(3840.0 * 0.3 * 50 / 239.76, rel=0.05)
        assert facts["pan"]["residual_px"] == pytest.approx(0.3, rel=0.3)
    else:
        assert facts["rolling_shutter"]["late_s"] == pytest.approx(4e-6 * np.median(footage.exact_px[..., 1]), rel=0.01)
