"""The batch estimate: right derivatives, exact without noise, indifferent to the camera's roll and to wild clicks."""

import numpy as np
import pytest
from scipy.linalg import solve, solveh_banded
from scipy.spatial.transform import Rotation

from replay.motion.batch import UNKNOWNS, Problem, State, _Normal, estimate, left_jacobian_inverse
from replay.motion.camera import Lens, shift_of
from replay.motion.settings import CameraSettings
from replay.motion.synthetic import HEAD_SIZED_OFFSET_M, LANDMARKS, LEVEL_CAMERA, Impact, SyntheticCamera

POINTS = np.array(list(LANDMARKS.values()))
CAMERA = SyntheticCamera(119.88, -8, 9, (3840, 2160), 3840.0)
LENS = Lens((1920.0, 1080.0))


def settings(**changes):
    known = {"camera_distance_m": 1.6, "camera_distance_sigma_m": 0.016, "lens": "fixed", "click_sigma_px": 1.0}
    fixed = {"fps": CAMERA.fps, "principal_point": LENS.principal_point, "helmet_to_com": HEAD_SIZED_OFFSET_M}
    return CameraSettings.model_validate({**fixed, **known, **changes})


def problem(pixels, **changes):
    return Problem(POINTS, pixels, np.ones(pixels.shape[:2]), np.array(HEAD_SIZED_OFFSET_M), settings(**changes), LENS)


@pytest.fixture(scope="module")
def truth():
    motion = Impact().at(CAMERA.times)
    to_camera = Rotation.from_quat(LEVEL_CAMERA).inv()
    rotation = (to_camera * motion.rotation).as_matrix()
    origin = to_camera.apply(motion.position_m - motion.rotation.apply(np.array(HEAD_SIZED_OFFSET_M)))
    return State(rotation, shift_of(origin), np.full(len(rotation), np.log(3840.0)))


@pytest.fixture(scope="module")
def exact():
    return CAMERA.see(Impact().at(CAMERA.times), POINTS, np.array(HEAD_SIZED_OFFSET_M))


def nudged(state, size=1.0, seed=3):
    rng = np.random.default_rng(seed)
    scales = size * np.array([0.03, 0.03, 0.03, 2e-3, 2e-3, 0.02, 1e-4])
    return state.moved(scales * rng.standard_normal((len(state.log_f), UNKNOWNS)))


@pytest.mark.parametrize("lens", ["fixed", "zoom"])
def test_gradient_is_that_of_finite_differences(truth, exact, lens):
    case = problem(exact + np.random.default_rng(0).normal(0, 1.0, exact.shape), lens=lens)
    state = nudged(truth)
    gradient = -2.0 * _Normal(case, state, 1.0).slope
    for frame in (0, 1, 7, len(state.log_f) - 1):
        for column in range(UNKNOWNS):
            step = np.zeros((len(state.log_f), UNKNOWNS))
            step[frame, column] = h = 1e-6
            ahead, behind = (_Normal(case, state.moved(sign * step), 1.0).cost for sign in (1, -1))
            assert gradient[frame, column] == pytest.approx((ahead - behind) / (2 * h), rel=2e-4, abs=2e-2)


def test_inverse_jacobian_of_the_rotation_vector_is_that_of_finite_differences():
    for v in (np.array([0.3, -0.8, 0.5]), np.array([1e-6, 0.0, 2e-6]), np.array([0.0, 2.9, 0.4])):
        columns = [
            ((Rotation.from_rotvec(h) * Rotation.from_rotvec(v)).as_rotvec() - v) / 1e-6 for h in 1e-6 * np.eye(3)
        ]
        assert left_jacobian_inverse(v) == pytest.approx(np.array(columns).T, abs=1e-5)


def test_banded_normal_equations_are_the_full_ones(truth, exact):
    normal = _Normal(problem(exact), nudged(truth), 1.0)
    size = normal.band.shape[1]
    full = np.zeros((size, size))
    for below, diagonal in enumerate(normal.band):
        values = diagonal[: size - below]
        full[np.arange(below, size), np.arange(size - below)] = values
        full[np.arange(size - below), np.arange(below, size)] = values
    assert np.linalg.eigvalsh(full)[0] > 0
    scale = 1.0 / np.sqrt(np.diag(full))
    dense = scale * solve(scale[:, None] * full * scale, scale * normal.slope.ravel(), assume_a="pos")
    assert solveh_banded(normal.band, normal.slope.ravel(), lower=True) == pytest.approx(dense, rel=1e-3, abs=1e-7)


def test_without_noise_the_motion_is_that_of_the_truth(truth, exact):
    case = problem(
        exact, focal_length_px=3840.0, focal_length_sigma_px=0.1, camera_distance_m=None, camera_distance_sigma_m=None
    )
    found = estimate(case, nudged(truth), sigma_px=1e-4)
    turn = Rotation.from_matrix(found.state.rotation @ np.swapaxes(truth.rotation, 1, 2)).magnitude()
    assert turn.max() < 1e-6
    assert found.state.shift == pytest.approx(truth.shift, abs=1e-6)
    assert np.abs(found.errors_px).max() < 1e-4


def test_a_rolled_camera_sees_the_same_head(truth, exact):
    pixels = exact + np.random.default_rng(1).normal(0, 1.0, exact.shape)
    roll = Rotation.from_rotvec([0.0, 0.0, np.pi / 2])
    centre = np.array(LENS.principal_point)
    rolled = centre + (pixels - centre) @ roll.as_matrix()[:2, :2].T
    start = nudged(truth)
    turned = State(
        roll.as_matrix() @ start.rotation,
        np.c_[start.shift[:, :2] @ roll.as_matrix()[:2, :2].T, start.shift[:, 2]],
        start.log_f,
    )
    one, other = estimate(problem(pixels), start), estimate(problem(rolled), turned)
    assert other.cost == pytest.approx(one.cost, rel=1e-6)
    difference = Rotation.from_matrix(np.swapaxes(other.state.rotation, 1, 2) @ roll.as_matrix() @ one.state.rotation)
    assert difference.magnitude().max() < 1e-5


def test_wild_clicks_lose_their_weight_and_move_nothing(truth, exact):
    rng = np.random.default_rng(2)
    pixels = exact + rng.normal(0, 1.0, exact.shape)
    wild = rng.random(pixels.shape[:2]) < 0.04
    spoilt = pixels.copy()
    spoilt[wild] += 40.0
    clean, robust = estimate(problem(pixels), truth), estimate(problem(spoilt), truth)
    assert wild.sum() >= 4
    assert robust.weights[wild].max() < 0.1 < np.median(robust.weights[~wild])
    turn = Rotation.from_matrix(np.swapaxes(robust.state.rotation, 1, 2) @ clean.state.rotation).magnitude()
    assert np.degrees(turn.max()) < 0.5
    assert robust.sigma_px == pytest.approx(clean.sigma_px, rel=0.25)


@pytest.mark.parametrize("sigma", [0.5, 2.0])
def test_click_noise_is_estimated(truth, exact, sigma):
    found = estimate(problem(exact + np.random.default_rng(4).normal(0, sigma, exact.shape)), truth)
    assert found.sigma_measured
    assert found.sigma_px == pytest.approx(sigma, rel=0.12)


def test_hidden_landmarks_and_frames_are_carried_by_their_neighbours(truth, exact):
    pixels = exact + np.random.default_rng(5).normal(0, 0.5, exact.shape)
    pixels[4] = np.nan
    pixels[9, 2:] = np.nan
    found = estimate(problem(pixels), truth)
    turn = Rotation.from_matrix(found.state.rotation @ np.swapaxes(truth.rotation, 1, 2)).magnitude()
    assert np.degrees(turn[4]) < 3.0
    spread = np.sqrt(found.covariance[:, 0, 0])
    assert spread[4] > 3.0 * spread[6]
