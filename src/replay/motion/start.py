"""Posture and velocities of a head before its impact, fitted to its reconstruction."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from replay.errors import InputError
from replay.motion.kinematics import Kinematics

_WHERE = "play.yaml"
_LEAST_SAMPLES = 3
_ROUNDS = 3


def fit_start(kinematics: Kinematics, end_s: float, fit_s: float) -> tuple[Rotation, np.ndarray, np.ndarray]:
    """Fit a straight path and a steady turn to the record that ends at a time.

    Least squares over positions, and over rotation vectors from a reference that follows the fit: no rate of the
    reconstruction is used, which near an impact its filters would smear into the time before.

    Parameters
    ----------
    kinematics
        Of the skull CG.
    end_s
        End of the fitted record, and the time of the answer [s].
    fit_s
        Its length [s].

    Returns
    -------
    tuple of Rotation, (3,), (3,)
        Orientation head to global, velocity [m/s] and angular velocity [rad/s] in global axes, all at `end_s`.

    Raises
    ------
    InputError
        When the record has fewer than three samples there.
    """
    time = kinematics.time_s
    chosen = (time >= end_s - fit_s - 1e-9) & (time <= end_s + 1e-9)
    if chosen.sum() < _LEAST_SAMPLES:
        raise InputError(
            _WHERE,
            f"{int(chosen.sum())} samples lie in the {1e3 * fit_s:g} ms before the window",
            column="collision",
            expected=f"at least {_LEAST_SAMPLES}: two of them leave nothing to judge the fit by",
            mend="make `fit_s` longer, or add frames before the impact",
        )
    since = time[chosen] - end_s
    design = np.stack([np.ones_like(since), since], axis=1)
    (_, velocity), *_ = np.linalg.lstsq(design, kinematics.position_m[chosen], rcond=None)
    seen = kinematics.rotation[chosen]
    at_end, omega = seen[len(since) - 1], np.zeros(3)
    for _ in range(_ROUNDS):
        steady = Rotation.from_rotvec(since[:, None] * omega) * at_end
        off = (seen * steady.inv()).as_rotvec()
        (turn, rate), *_ = np.linalg.lstsq(design, off, rcond=None)
        at_end, omega = Rotation.from_rotvec(turn) * at_end, omega + rate
    return at_end, velocity, omega
