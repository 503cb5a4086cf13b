"""Rates of rotations and of rigid points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.motion.rates import angular_rates, carried, integrate_rotation, linear_rates
from replay.motion.synthetic import Impact


def test_constant_spin_is_exact():
    w = np.array([3.0, -20.0, 40.0])
    t = np.arange(30) / 100.0
    start = Rotation.from_rotvec([0.3, 0.2, -2.0])
    omega, alpha = angular_rates(Rotation.from_rotvec(t[:, None] * w) * start, 100.0)
    assert omega == pytest.approx(np.tile(w, (30, 1)), abs=1e-11)
    assert np.abs(alpha).max() < 1e-8


@pytest.mark.parametrize("angle", [1e-12, 1e-6, 1.0, 3.1])
def test_rotation_vectors_survive_log_and_exp(angle):
    vector = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    assert Rotation.from_rotvec(vector).as_rotvec() == pytest.approx(vector, rel=1e-9, abs=1e-20)


def test_parabola_has_its_exact_acceleration():
    t = np.arange(10) / 50.0
    path = np.stack([t, t**2, -3 * t**2], axis=1)
    velocity, acceleration = linear_rates(path, 50.0)
    assert acceleration == pytest.approx(np.tile([0.0, 2.0, -6.0], (10, 1)), abs=1e-9)
    assert velocity[5] == pytest.approx([1.0, 0.2, -0.6])


def test_carried_acceleration_is_that_of_the_point():
    motion, h, arm = Impact(), 1e-5, np.array([-0.1, 0.05, 0.2])
    t = np.linspace(-0.01, 0.02, 40)

    def point(time):
        k = motion.at(time)
        return k.position_m + k.rotation.apply(arm)

    k = motion.at(t)
    expected = (point(t + h) - 2 * point(t) + point(t - h)) / h**2
    got = carried(k.acceleration_m_per_s2, k.alpha_rad_per_s2, k.omega_rad_per_s, k.rotation.apply(arm))
    assert got == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("body", [False, True])
def test_integrated_rotation_converges_at_least_with_second_order(body):
    errors = []
    for n in (40, 80, 160):
        t = np.linspace(-0.02, 0.03, n + 1)
        k = Impact().at(t)
        omega = k.in_head_axes(k.omega_rad_per_s) if body else k.omega_rad_per_s
        out = integrate_rotation(k.rotation[0], omega, t[1] - t[0], body_axes=body)
        errors.append((out * k.rotation.inv()).magnitude()[-1])
    assert errors[2] < 1e-4
    assert errors[0] / errors[1] > 3.5
    assert errors[1] / errors[2] > 3.5
