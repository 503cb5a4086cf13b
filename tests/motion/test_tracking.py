"""Landmarks followed from clicks: true to a fraction of a pixel, honest about it, and lost where they are hidden."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from replay.motion.tracking import follow

WIDTH, HEIGHT = 240, 180


def scene(seed: int = 0) -> np.ndarray:
    """Smooth random texture, larger than the picture."""
    rough = np.random.default_rng(seed).normal(size=(HEIGHT + 120, WIDTH + 120))
    smooth = cv2.GaussianBlur(rough, (0, 0), 2.0)
    return (128.0 + 45.0 * smooth / smooth.std()).astype(np.float64)


def filmed(shifts: np.ndarray, noise: float = 0.0, seed: int = 1, turn_deg: float = 0.0) -> list[np.ndarray]:
    """Pictures of a scene that moves by `shifts` (k, 2) [px] and turns steadily about the picture's middle."""
    rng = np.random.default_rng(seed)
    texture, out = scene(), []
    for k, (du, dv) in enumerate(shifts):
        turn = cv2.getRotationMatrix2D((60 + WIDTH / 2, 60 + HEIGHT / 2), turn_deg * k, 1.0)
        turn[:, 2] += [du - 60.0, dv - 60.0]
        picture = cv2.warpAffine(texture, turn, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC)
        out.append(np.clip(np.round(picture + rng.normal(0.0, noise, picture.shape)), 0, 255).astype(np.uint8))
    return out


POINTS = {f"P{i}": (60.0 + 30.0 * (i % 5), 50.0 + 25.0 * (i // 5)) for i in range(20)}
CURVE = np.stack([2.3 * np.arange(15.0), 6.0 * np.sin(np.arange(15.0) / 4.0)], axis=1)


def test_a_moving_texture_is_followed_to_a_twentieth_of_a_pixel_without_drift():
    found = follow(filmed(CURVE), 100, {name: {100: at} for name, at in POINTS.items()})
    truth = np.array(list(POINTS.values())) + CURVE[:, None, :]
    error = found.pixels - truth
    assert found.losses == ()
    assert found.frames.tolist() == list(range(100, 115))
    assert np.abs(error).max() < 0.1
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert np.sqrt(np.mean(error[-1] ** 2)) < 2.0 * np.sqrt(np.mean(error[2] ** 2)) + 0.02
    assert found.clicked[0].all()
    assert not found.clicked[1:].any()


@pytest.mark.parametrize("noise", [3.0, 8.0])
def test_the_noise_it_states_is_the_noise_it_has(noise):
    errors, stated = [], []
    for seed in range(4):
        found = follow(filmed(CURVE, noise, seed), 0, {name: {0: at} for name, at in POINTS.items()})
        truth = np.array(list(POINTS.values())) + CURVE[:, None, :]
        errors.append((found.pixels - truth)[1:])
        stated.append(found.sigma_px[1:])
    ratio = np.sqrt(np.nanmean(np.array(errors) ** 2) / np.nanmean(np.array(stated) ** 2))
    assert 0.6 < ratio < 1.4


def test_a_patch_that_turns_by_a_right_angle_is_followed_without_drift():
    turning = filmed(np.zeros((31, 2)), turn_deg=3.0)
    centre = np.array([WIDTH / 2, HEIGHT / 2])
    start = np.array([150.0, 100.0])

    def at(k: int) -> np.ndarray:
        angle = np.radians(-3.0 * k)
        return centre + np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ (start - centre)

    truth = np.array([at(k) for k in range(31)])
    once = follow(turning, 0, {"P": {0: tuple(start)}})
    assert np.linalg.norm(once.pixels[:, 0] - truth, axis=1).max() < 0.3


def test_clicks_that_disagree_are_blended_and_their_difference_is_in_the_noise():
    truth = np.array(POINTS["P7"]) + CURVE
    off = np.array([0.0, 2.0])
    found = follow(filmed(CURVE), 0, {"P7": {0: tuple(truth[0]), 14: tuple(truth[14] + off)}})
    along = np.linspace(0.0, 1.0, 15)[:, None]
    assert found.pixels[:, 0] == pytest.approx(truth + along * off, abs=0.1)
    # in the middle half of either: a quarter of the squared difference, half of it in each coordinate
    assert found.sigma_px[7, 0] == pytest.approx(np.sqrt(0.25 * 0.5 * 4.0), rel=0.05)
    assert np.argmax(found.sigma_px[:, 0]) == 7


def test_a_hidden_landmark_is_lost_there_and_found_again_from_the_next_click():
    pictures = filmed(CURVE)
    for k in range(6, 9):
        u, v = np.array(POINTS["P7"]) + CURVE[k]
        pictures[k][int(v) - 14 : int(v) + 15, int(u) - 14 : int(u) + 15] = 90
    lost = follow(pictures, 0, {"P7": {0: POINTS["P7"]}})
    assert [(loss.landmark, loss.seed, loss.frame) for loss in lost.losses] == [("P7", 0, 6)]
    assert lost.losses[0].reason
    assert not np.isfinite(lost.pixels[6:]).any()
    end = tuple(np.array(POINTS["P7"]) + CURVE[14])
    found = follow(pictures, 0, {"P7": {0: POINTS["P7"], 14: end}})
    assert np.isfinite(found.sigma_px[:, 0]).tolist() == [True] * 6 + [False] * 3 + [True] * 6
    assert [loss.frame for loss in found.losses] == [6]


def test_a_landmark_that_leaves_the_picture_or_has_no_texture_is_lost():
    away = np.stack([np.arange(30.0) * 8.0, np.zeros(30)], axis=1)
    assert follow(filmed(away), 0, {"P": {0: (150.0, 90.0)}}).losses[0].frame <= 12
    flat = [np.full((HEIGHT, WIDTH), 90, np.uint8)] * 4
    assert follow(flat, 0, {"P": {0: (100.0, 90.0)}}).losses[0].frame == 1


def test_weights_say_what_following_adds_to_a_click():
    found = follow(filmed(CURVE, 8.0), 0, {"P7": {0: POINTS["P7"]}})
    weight = found.weight(1.0)
    assert weight[0, 0] == 1.0
    assert (weight[1:, 0] < 1.0).all()
    assert weight[5, 0] == pytest.approx(1.0 / (1.0 + found.sigma_px[5, 0] ** 2))
