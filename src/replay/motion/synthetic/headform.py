"""A recorded head motion as an instrumented headform would report it: accelerometers and gyroscopes at its CG."""

from __future__ import annotations

import numpy as np

from replay.errors import InputError
from replay.motion.kinematics import STANDARD_GRAVITY, Kinematics

_WHERE, _LEAST_SAMPLES = "motion", 3
_REST_S = 0.020
_NOISE_G, _NOISE_DEG_PER_S = 0.3, 3.0
_COLUMNS = "time_ms,ax_g,ay_g,az_g,wx_deg_per_s,wy_deg_per_s,wz_deg_per_s"


def headform_record(motion: Kinematics, seed: int) -> str:
    """Table of a headform in head axes, with white noise, after 20 ms in which it goes on as it begins.

    Parameters
    ----------
    motion
        Of the head CG, evenly sampled; the table keeps its rate.
    seed
        Of the noise: 0.3 g and 3 degrees a second, each axis.

    Raises
    ------
    InputError
        When the motion is too short to have a rate.
    """
    if len(motion.time_s) < _LEAST_SAMPLES:
        message = f"{len(motion.time_s)} samples"
        raise InputError(_WHERE, message, expected="an evenly sampled motion")
    rng = np.random.default_rng(seed)
    step = float(motion.time_s[1] - motion.time_s[0])
    rest = round(_REST_S / step)
    acceleration = motion.in_head_axes(motion.acceleration_m_per_s2) / STANDARD_GRAVITY
    spin = np.degrees(motion.in_head_axes(motion.omega_rad_per_s))
    acceleration = np.vstack([np.zeros((rest, 3)), acceleration])
    spin = np.vstack([np.repeat(spin[:1], rest, axis=0), spin])
    acceleration = acceleration + rng.normal(0.0, _NOISE_G, acceleration.shape)
    spin = spin + rng.normal(0.0, _NOISE_DEG_PER_S, spin.shape)
    rows = [_COLUMNS]
    for k, (a, w) in enumerate(zip(acceleration, spin)):
        rows.append(",".join([f"{1e3 * step * k:.4f}", *(f"{v:.4f}" for v in a), *(f"{v:.3f}" for v in w)]))
    return "\n".join(rows) + "\n"
