"""A head before its impact, from any record: straight and steady is found exactly, noise averages out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.errors import InputError
from replay.motion import Kinematics, steady_before

VELOCITY, OMEGA = np.array([8.3, 0.2, -1.0]), np.array([2.0, -45.0, 6.0])
TILT = Rotation.from_euler("xyz", [0.3, -0.8, 1.9])


def record(rate_hz: float, noise_m: float = 0.0, noise_rad: float = 0.0, after: float = 0.02) -> Kinematics:
    """A head that flies straight and turns steadily until time 0, and is stopped then."""
    rng = np.random.default_rng(11)
    time = np.arange(-0.1, after, 1 / rate_hz)
    before = np.minimum(time, 0.0)
    position = before[:, None] * VELOCITY + rng.normal(0, 1, (len(time), 3)) * noise_m
    wobble = Rotation.from_rotvec(rng.normal(0, 1, (len(time), 3)) * noise_rad)
    nothing = np.zeros_like(position)
    rotation = wobble * Rotation.from_rotvec(before[:, None] * OMEGA) * TILT
    return Kinematics(time, position, rotation, nothing, nothing, nothing, nothing)


def test_a_steady_flight_is_found_exactly() -> None:
    before = steady_before(record(240.0), 0.0, 0.030)
    np.testing.assert_allclose(before.velocity_m_per_s, VELOCITY[None], rtol=1e-10)
    np.testing.assert_allclose(before.omega_rad_per_s, OMEGA[None], rtol=1e-8)
    np.testing.assert_allclose(before.position_m, 0.0, atol=1e-10)
    assert (before.rotation[0] * TILT.inv()).magnitude() < 1e-9


def test_the_blow_itself_does_not_leak_into_the_start() -> None:
    long, short = (steady_before(record(240.0, after=span), 0.0, 0.030) for span in (0.2, 0.001))
    np.testing.assert_array_equal(long.velocity_m_per_s, short.velocity_m_per_s)


def test_more_frames_average_noise_out() -> None:
    noisy = record(480.0, noise_m=0.002, noise_rad=0.01)
    error = [np.linalg.norm(steady_before(noisy, 0.0, span).velocity_m_per_s - VELOCITY) for span in (0.008, 0.090)]
    assert error[1] < 0.2 * error[0]


def test_too_few_frames_are_refused() -> None:
    with pytest.raises(InputError, match="samples lie in the 20 ms before the window"):
        steady_before(record(59.94), -0.0005, 0.020)
