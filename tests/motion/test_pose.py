"""Projection, pose and focal length: exact without noise, and on real photographs."""

import re

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from replay.motion.camera import Lens, project, shift_of
from replay.motion.focal import clip_focal, frame_focal
from replay.motion.pose import Poses, Prior, choose, mirrored, refine, residuals
from replay.motion.settings import CameraSettings
from replay.motion.synthetic import LANDMARKS
from replay.motion.tracks import Tracks

POINTS = np.array(list(LANDMARKS.values()))
BENT = Lens((640.0, 360.0), (-0.27, -0.04, 0.002, -0.0003, 0.24))


def _poses(count: int, z: float, f: float, seed: int = 0) -> Poses:
    rng = np.random.default_rng(seed)
    facing = Rotation.from_euler("xyz", [-90, 20, 90], degrees=True)
    rotation = (Rotation.from_rotvec(rng.normal(0, 0.4, (count, 3))) * facing).as_matrix()
    position = np.stack([rng.normal(0, 0.1 * z, count), rng.normal(0, 0.05 * z, count), np.full(count, z)], axis=1)
    blank = np.zeros((count, 7, 7))
    return Poses(rotation, shift_of(position), np.full(count, np.log(f)), np.zeros(count), blank)


def _turned(a: Poses, b: Poses) -> np.ndarray:
    return (Rotation.from_matrix(a.rotation) * Rotation.from_matrix(b.rotation).inv()).magnitude()


@pytest.mark.parametrize("lens", [Lens((640.0, 360.0)), BENT])
def test_projection_agrees_with_opencv(lens):
    poses = _poses(5, 1.5, 900.0)
    pixels, _ = project(POINTS, poses.rotation, poses.shift, poses.log_f, lens)
    matrix = np.array([[900.0, 0, 640], [0, 900.0, 360], [0, 0, 1]])
    for k in range(5):
        expected, _ = cv2.projectPoints(
            POINTS, cv2.Rodrigues(poses.rotation[k])[0], poses.position_m[k], matrix, np.array(lens.distortion)
        )
        assert pixels[k] == pytest.approx(expected[:, 0], abs=1e-9)


@pytest.mark.parametrize("lens", [Lens((640.0, 360.0)), BENT])
def test_derivatives_agree_with_differences(lens):
    p = _poses(3, 1.5, 900.0, seed=4)
    _, jacobian = project(POINTS, p.rotation, p.shift, p.log_f, lens)
    h = 1e-6
    for i in range(7):
        sides = []
        for sign in (1, -1):
            d = np.zeros(7)
            d[i] = sign * h
            rotation = Rotation.from_rotvec(d[:3]).as_matrix() @ p.rotation
            sides.append(project(POINTS, rotation, p.shift + d[3:6], p.log_f + d[6], lens)[0])
        assert jacobian[..., i] == pytest.approx((sides[0] - sides[1]) / (2 * h), rel=1e-5, abs=1e-4)


@pytest.mark.parametrize(("names", "z", "f"), [(8, 1.6, 3840.0), (6, 10.0, 6000.0), (4, 3.0, 2000.0)])
def test_pose_without_noise_is_exact(names, z, f):
    lens, truth = Lens((960.0, 540.0)), _poses(6, z, f)
    pixels, _ = project(POINTS[:names], truth.rotation, truth.shift, truth.log_f, lens)
    found = choose(POINTS[:names], pixels, truth.log_f, lens, sigma_px=1.0).poses
    assert _turned(found, truth).max() < 1e-8
    assert found.position_m == pytest.approx(truth.position_m, abs=1e-8)


def test_three_landmarks_fit_exactly_in_more_than_one_way():
    lens, truth = Lens((960.0, 540.0)), _poses(6, 10.0, 6000.0)
    pixels, _ = project(POINTS[:3], truth.rotation, truth.shift, truth.log_f, lens)
    choice = choose(POINTS[:3], pixels, truth.log_f, lens, sigma_px=1.0)
    assert np.abs(residuals(POINTS[:3], pixels, choice.poses, lens)).max() < 1e-6
    assert choice.candidates.max() >= 2
    assert np.nanmax(np.abs(choice.flip_ratio - 1.0)) < 0.01


def test_close_focal_length_is_exact_without_noise():
    lens, truth = Lens((960.0, 540.0)), _poses(5, 0.8, 1100.0)
    pixels, _ = project(POINTS, truth.rotation, truth.shift, truth.log_f, lens)
    start = choose(POINTS, pixels, np.full(5, np.log(1300.0)), lens, sigma_px=1.0).poses
    found = refine(POINTS, pixels, start, lens, sigma_px=1.0, free_focal=True)
    assert np.exp(found.log_f) == pytest.approx(1100.0, rel=1e-8)


def test_refinement_finds_the_minimum_that_scipy_finds():
    lens, truth = Lens((960.0, 540.0)), _poses(1, 2.0, 2400.0)
    pixels, _ = project(POINTS, truth.rotation, truth.shift, truth.log_f, lens)
    pixels = pixels + np.random.default_rng(3).normal(0, 2.0, pixels.shape)
    found = refine(POINTS, pixels, truth, lens, sigma_px=2.0, loss="linear")

    def misses(x):
        rotation = Rotation.from_rotvec(x[None, :3]).as_matrix() @ truth.rotation
        return ((pixels - project(POINTS, rotation, truth.shift + x[None, 3:], truth.log_f, lens)[0]) / 2.0).ravel()

    reference = least_squares(misses, np.zeros(6), method="lm", xtol=1e-14, ftol=1e-14)
    assert found.cost[0] == pytest.approx(2.0 * reference.cost, rel=1e-9)
    assert found.shift[0] == pytest.approx(truth.shift[0] + reference.x[3:], abs=1e-7)


def test_one_wild_click_does_not_move_the_pose():
    lens, truth = Lens((960.0, 540.0)), _poses(1, 2.0, 2400.0)
    pixels, _ = project(POINTS, truth.rotation, truth.shift, truth.log_f, lens)
    pixels[0, 4] += 60.0
    robust = refine(POINTS, pixels, truth, lens, sigma_px=1.0)
    plain = refine(POINTS, pixels, truth, lens, sigma_px=1.0, loss="linear")
    assert _turned(robust, truth)[0] < 0.1 * _turned(plain, truth)[0]


def test_a_click_of_small_weight_counts_as_one_of_large_sigma():
    lens, truth = Lens((960.0, 540.0)), _poses(1, 2.0, 2400.0)
    pixels, _ = project(POINTS, truth.rotation, truth.shift, truth.log_f, lens)
    pixels[0, 4] += 3.0
    weight = np.ones(pixels.shape[:2])
    weight[0, 4] = 0.01
    tracks = Tracks(np.arange(1), pixels, weight)
    assert tracks.sigma_px(2.0)[0, 4] == pytest.approx(20.0)
    turned = [
        _turned(refine(POINTS, pixels, truth, lens, sigma_px=sigma, loss="linear"), truth)[0]
        for sigma in (1.0, tracks.sigma_px(1.0))
    ]
    assert turned[1] < 0.03 * turned[0]
    # a weight of one is the same number to the last bit
    same = [refine(POINTS, pixels, truth, lens, sigma_px=s).shift for s in (1.3, np.full((1, len(POINTS)), 1.3))]
    assert (same[0] == same[1]).all()


def test_mirrored_twin_projects_a_flat_template_to_the_same_pixels_from_afar():
    flat = np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.12], [0.0, 0.05, -0.1]])
    truth, lens = _poses(4, 500.0, 90000.0), Lens((960.0, 540.0))
    twin = mirrored(flat, np.ones((4, 4), bool), truth)
    a = project(flat, truth.rotation, truth.shift, truth.log_f, lens)[0]
    b = project(flat, twin.rotation, twin.shift, twin.log_f, lens)[0]
    assert a == pytest.approx(b, abs=0.02)
    assert _turned(twin, truth).min() > 0.01


def test_focal_length_at_broadcast_distance_is_not_observable_from_clicks():
    lens, truth = Lens((640.0, 360.0)), _poses(12, 45.0, 6000.0)
    pixels, _ = project(POINTS, truth.rotation, truth.shift, truth.log_f, lens)
    pixels = pixels + np.random.default_rng(0).normal(0, 1.0, pixels.shape)
    camera = CameraSettings(fps=59.94, principal_point=(640, 360), helmet_to_com=(0, 0, 0))
    clip = clip_focal(POINTS, pixels, truth, lens, camera, sigma_px=1.0)
    assert clip.sigma_clicks_log_f > 0.3
    _, sigma, _ = frame_focal(POINTS, pixels, clip, lens, Prior(), sigma_px=1.0)
    assert np.median(sigma) > 1.0


# -- thirteen photographs of a chessboard with published intrinsics and extrinsics ------------------------------


@pytest.fixture(scope="module")
def chessboard(shared):
    folder = shared / "real" / "chessboard"
    if not folder.is_dir():
        pytest.skip("shared/real/chessboard is not here")
    text = (folder / "left_intrinsics.yml").read_text()

    def numbers(key):
        block = text.split(key + ":")[1].split("[", 1)[1].split("]")[0]
        return np.array([float(v) for v in re.split(r"[,\s]+", block.strip(" ,\n")) if v])

    size = float(re.search(r"square_size:\s*(\S+)", text).group(1))
    board = np.zeros((54, 3))
    board[:, :2] = np.mgrid[0:9, 0:6].T.reshape(-1, 2) * size
    corners = []
    for path in sorted(folder.glob("left[0-9]*.jpg")):
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        ok, found = cv2.findChessboardCorners(image, (9, 6))
        assert ok, path.name
        corners.append(cv2.cornerSubPix(image, found, (11, 11), (-1, -1), (3, 30, 0.1))[:, 0])
    matrix = numbers("camera_matrix").reshape(3, 3)
    lens = Lens((matrix[0, 2], matrix[1, 2]), tuple(numbers("distortion_coefficients")))
    return board, np.array(corners, dtype=float), matrix[0, 0], lens, numbers("extrinsic_parameters").reshape(-1, 6)


@pytest.mark.shared
def test_chessboard_poses_match_the_published_extrinsics(chessboard):
    board, corners, f, lens, extrinsics = chessboard
    # like with like: the published calibration is a plain least-squares fit, outlying corners of image 02 included
    found = choose(board, corners, np.full(13, np.log(f)), lens, sigma_px=0.2, loss="linear").poses
    turn = Rotation.from_matrix(found.rotation) * Rotation.from_rotvec(extrinsics[:, :3]).inv()
    assert np.degrees(turn.magnitude()).max() < 0.01
    assert np.linalg.norm(found.position_m - extrinsics[:, 3:], axis=1).max() < 0.02e-3


@pytest.mark.shared
def test_a_robust_fit_leaves_the_published_one_only_where_that_follows_bad_corners(chessboard):
    board, corners, f, lens, extrinsics = chessboard
    found = choose(board, corners, np.full(13, np.log(f)), lens, sigma_px=0.2).poses
    turn = np.degrees(
        (Rotation.from_matrix(found.rotation) * Rotation.from_rotvec(extrinsics[:, :3]).inv()).magnitude()
    )
    assert np.argmax(turn) == 1
    error = residuals(board, corners, found, lens)[1]
    # the corners of image 02 that the published fit is drawn to: beyond ten times the noise of all the others
    assert (np.linalg.norm(error, axis=1) > 2.0).sum() >= 1
    assert np.median(turn) < 0.05


@pytest.mark.shared
def test_focal_length_of_all_corners_is_the_published_one(chessboard):
    board, corners, f, lens, _ = chessboard
    camera = CameraSettings(fps=30.0, principal_point=(320, 240), helmet_to_com=(0, 0, 0))
    start = choose(board, corners, np.full(13, np.log(640.0)), lens, sigma_px=0.2, loss="linear").poses
    clip = clip_focal(board, corners, start, lens, camera, sigma_px=0.2, loss="linear")
    assert np.exp(clip.log_f) == pytest.approx(f, rel=0.001)
    robust = clip_focal(board, corners, start, lens, camera, sigma_px=0.2)
    assert np.exp(robust.log_f) == pytest.approx(f, rel=0.006)


@pytest.mark.shared
def test_ten_corners_tell_the_focal_length_and_how_well_they_do(chessboard):
    board, corners, f, lens, _ = chessboard
    camera = CameraSettings(fps=30.0, principal_point=(320, 240), helmet_to_com=(0, 0, 0))
    rng = np.random.default_rng(0)
    of_clip, of_image, scores = [], [], []
    for _ in range(5):
        ten = np.full(corners.shape, np.nan)
        for k in range(13):
            picked = rng.permutation(54)[:10]
            ten[k, picked] = corners[k, picked]
        start = choose(board, ten, np.full(13, np.log(640.0)), lens, sigma_px=0.2).poses
        clip = clip_focal(board, ten, start, lens, camera, sigma_px=0.2)
        of_clip.append(abs(np.exp(clip.log_f) / f - 1.0))
        free, sigma, _ = frame_focal(board, ten, clip, lens, Prior(), sigma_px=0.2)
        of_image += list(np.abs(np.exp(free.log_f) / f - 1.0))
        scores += list((free.log_f - np.log(f)) / sigma)
    assert max(of_clip) < 0.015
    assert np.median(of_image) < 0.015
    # an image that faces the camera says little of the focal length, and its sigma says so: 65 images
    assert 0.88 <= np.mean(np.abs(scores) < 1.96) <= 1.0
    assert 0.7 < np.median(np.abs(scores)) / 0.6745 < 1.4
