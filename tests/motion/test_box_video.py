"""A real video of a rigid box and its measured model: digitised from five clicks, reconstructed, judged."""

from __future__ import annotations

import json
import shutil

import cv2
import numpy as np
import pytest

from replay.cli import main
from replay.errors import InputError
from replay.gates import Limits, video_reconstruction_gate
from replay.motion import check_tracks, reconstruct
from replay.motion.clip import load_clip
from replay.motion.protocol import reconstruct_clicks
from replay.motion.reconstruct import POSES, QC
from replay.motion.tracks import Template
from replay.motion.video import examine_video
from replay.play import ClicksSource, load_play

SEEDS = """frame,landmark_id,u_px,v_px
0,BRT,594.2,68.2
0,FLT,298.4,100.4
0,FRT,565.6,180.1
0,FLB,299.2,164.6
0,FRB,540.2,239.6
"""
"""The five corners that frame 0 shows, clicked by eye."""
PLAY = """name: box
source:
  kind: clicks
  video: box.mp4
"""


@pytest.fixture(scope="module")
def folder(shared, tmp_path_factory):
    source = shared / "real" / "box"
    if not source.is_dir():
        pytest.skip("shared/real/box is not here")
    folder = tmp_path_factory.mktemp("video") / "box"
    folder.mkdir()
    shutil.copy(source / "box.mp4", folder)
    vertices = (source / "box.ply").read_text().split("end_header\n")[1].split("\n")[:8]
    corners = np.array([row.split() for row in vertices], dtype=float)
    # the model is in centimetres: x towards the camera, y along the front, z up
    x, y, z = corners.max(axis=0) / 100.0
    at = {"BRT": (0, y, z), "FLT": (x, 0, z), "FRT": (x, y, z), "FLB": (x, 0, 0), "FRB": (x, y, 0)}
    rows = [f"{name},{a},{b},{c}" for name, (a, b, c) in at.items()]
    (folder / "helmet_landmarks.csv").write_text("\n".join(["landmark,X,Y,Z", *rows]) + "\n")
    (folder / "seeds.csv").write_text(SEEDS)
    camera = {
        "fps": 29.97,
        "image_size": [640, 480],
        "principal_point": [320, 240],
        "helmet_to_com": [0.0945, 0.129, 0.0375],
        "lens": "fixed",
        "click_sigma_px": 1.0,
    }
    (folder / "Config.json").write_text(json.dumps(camera))
    (folder / "play.yaml").write_text(PLAY)
    arguments = ["--seeds", str(folder / "seeds.csv"), "--out", str(folder / "kinovea_clicks.csv"), "--last", "60"]
    assert main(["digitize", str(folder / "box.mp4"), *arguments]) == 0
    return folder


@pytest.mark.shared
def test_a_real_video_is_digitised_and_its_poses_are_those_of_a_box_in_a_hand(folder):
    result = reconstruct(load_play(folder))
    result.write(folder / "out")
    poses, quality = POSES.read(folder / "out" / "poses_per_frame.csv"), QC.read(folder / "out" / "qc_per_frame.csv")
    assert len(poses) == 61
    assert poses["own_pose"].all()
    # a webcam of 60 degrees across, at arm's length, a box that is moved gently and never leaps
    assert 400.0 < poses["focal_smooth_px"].median() < 700.0
    assert poses["tz_m"].between(0.5, 1.2).all()
    k = result.kinematics
    assert np.linalg.norm(np.diff(k.position_m, axis=0), axis=1).max() < 0.04
    assert k.omega_resultant.max() < 2.0
    assert quality["reprojection_rmse_px"].median() < 4.0
    # a hand strikes nothing: neither t0 nor an onset is made up
    assert not any(result.posterior_quality.bands[name].resolved for name in ("t0_s", "onset_s"))
    assert "NO IMPACT is seen" in (folder / "out" / "qc_summary.txt").read_text()
    gate = video_reconstruction_gate(result.quality.gate_values(), Limits.load())
    verdicts = {check.name: check.verdict for check in gate.checks}
    assert verdicts["reprojection_rmse_median_px"] == "pass"
    assert verdicts["frames_above_8_px"] == "pass"


@pytest.mark.shared
def test_the_videos_own_facts_are_logged(folder):
    facts = check_tracks(load_play(folder))["video"]
    assert facts["image_size"] == [640, 480]
    assert facts["frames"] == 455
    assert facts["fps"] == pytest.approx(29.97, rel=1e-3)
    assert facts["cuts_in_the_clip"] == []
    assert len(facts["sha256"]) == 64


@pytest.mark.shared
def test_a_mirrored_box_is_not_this_box(folder):
    play = load_play(folder)
    assert isinstance(play.source, ClicksSource)
    clip = load_clip(play, play.source)
    mirrored = Template(clip.template.names, clip.template.points_m * np.array([1.0, -1.0, 1.0]))
    right, wrong = (reconstruct_clicks(clip.tracks, t, clip.camera).errors_px for t in (clip.template, mirrored))
    assert np.sqrt(np.mean(wrong**2)) > 3.0 * np.sqrt(np.mean(right**2))


# -- synthetic videos with one fault each --------------------------------------------------------------------------


def pictures(count: int = 24) -> list[np.ndarray]:
    """A bright block that moves 6 px a frame over a textured ground."""
    rng = np.random.default_rng(0)
    ground = cv2.GaussianBlur(rng.integers(0, 160, (120, 200)).astype(np.uint8), (0, 0), 2)
    out = []
    for k in range(count):
        picture = ground.copy()
        picture[30:90, 10 + 6 * k : 50 + 6 * k] = 230
        out.append(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    return out


def filmed(path, frames):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 60.0, (200, 120))
    for frame in frames:
        writer.write(frame)
    writer.release()
    return path


def test_a_plain_video_has_no_fault(tmp_path):
    video = examine_video(filmed(tmp_path / "plain.avi", pictures()))
    assert (video.fps, video.image_size, video.frames, video.cuts) == (60.0, (200, 120), 24, ())


def test_a_cut_is_named_and_a_window_beside_it_is_free_of_it(tmp_path):
    frames = pictures(12) + [255 - frame for frame in pictures(12)]
    path = filmed(tmp_path / "cut.avi", frames)
    assert examine_video(path).cuts == (12,)
    assert examine_video(path, (2, 9)).cuts == ()


def test_an_interlaced_video_is_refused(tmp_path):
    frames = pictures(48)
    woven = []
    for first, second in zip(frames[::2], frames[1::2]):
        both = first.copy()
        both[1::2] = second[1::2]
        woven.append(both)
    with pytest.raises(InputError, match="is interlaced"):
        examine_video(filmed(tmp_path / "woven.avi", woven))


def test_uneven_frames_are_refused(tmp_path, monkeypatch):
    path = filmed(tmp_path / "plain.avi", pictures())

    class Uneven:
        """The same video with the clock of one that drops frame 9."""

        def __init__(self, name):
            self._video, self._frame = cv2_capture(name), -1

        def grab(self):
            self._frame += 1
            return self._video.grab()

        def get(self, what):
            late = 1.0 if self._frame >= 9 else 0.0
            return 1000.0 * (self._frame + late) / 60.0 if what == cv2.CAP_PROP_POS_MSEC else self._video.get(what)

        def __getattr__(self, name):
            return getattr(self._video, name)

    cv2_capture = cv2.VideoCapture
    monkeypatch.setattr(cv2, "VideoCapture", Uneven)
    with pytest.raises(InputError, match="variable frame rate: frame 9 comes after 33.33 ms"):
        examine_video(path)


def test_tracks_beyond_the_video_and_what_is_no_video_are_refused(tmp_path):
    path = filmed(tmp_path / "plain.avi", pictures())
    with pytest.raises(InputError, match="has 24 frames, but tracks run to frame 30"):
        examine_video(path, (20, 30))
    (tmp_path / "no.mp4").write_text("no video")
    with pytest.raises(InputError, match="cannot be opened as a video"):
        examine_video(tmp_path / "no.mp4")


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("0,A,500,50", "seeds.csv:2: the click (500, 50) px in frame 0 lies outside"),
        ("0,A,50,50\n0,A,60,50", "seeds.csv:3: landmark A is clicked twice in frame 0"),
        ("40,A,50,50", "plain.avi: frames 40 to 23 are not in the video"),
    ],
)
def test_clicks_that_cannot_be_followed_are_refused_and_nothing_is_written(tmp_path, capfd, row, expected):
    path = filmed(tmp_path / "plain.avi", pictures())
    (tmp_path / "seeds.csv").write_text(f"frame,landmark_id,u_px,v_px\n{row}\n")
    out = tmp_path / "clicks.csv"
    assert main(["digitize", str(path), "--seeds", str(tmp_path / "seeds.csv"), "--out", str(out)]) == 2
    assert expected in capfd.readouterr().err
    assert not out.exists()


def test_a_lost_landmark_is_said_with_where_to_click_again(tmp_path, capfd):
    path = filmed(tmp_path / "plain.avi", pictures(30))
    (tmp_path / "seeds.csv").write_text("frame,landmark_id,u_px,v_px\n0,corner,50,30\n0,ground,150,106\n")
    out = tmp_path / "clicks.csv"
    assert main(["digitize", str(path), "--seeds", str(tmp_path / "seeds.csv"), "--out", str(out)]) == 0
    said = capfd.readouterr().out
    assert "corner is lost in frame" in said
    assert "click corner again next to frame" in said
    assert "ground         30 of 30 frames" in said
    assert out.read_text().startswith(
        "frame,landmark_id,u_px,v_px,weight,sigma_px,source\n0,corner,50.0,30.0,1.0,0.0,click"
    )
