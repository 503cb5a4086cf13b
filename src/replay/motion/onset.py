"""When the impact sets in, and how the head moved until then: what a collision starts from.

The onset is where the angular or the CG acceleration, whichever is first, rises from a tenth of its peak to a lobe of
at least half of it: forerunners do not count. The motion at that instant is fitted to what lies before it alone: no
pulse, whatever its shape, has a say in it. Two ways lead there. `before_onset` takes the clicks' own information, and
knows how sure it is; `steady_before` takes any record, a wearable's too, up to an instant that the play states.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from replay.errors import InputError
from replay.motion.batch import Problem
from replay.motion.kinematics import Kinematics
from replay.motion.readout import ANGULAR, LINEAR, read_quiet
from replay.motion.told import Told, Turning

MAJOR, BEGUN = 0.5, 0.1
"""Shares of its peak: of the first lobe that counts as the impact, and where it has begun."""
_SURELY_BEFORE = 0.05
_WHERE = "play.yaml"
_LEAST_SAMPLES, _ROUNDS = 3, 3


@dataclass(frozen=True)
class BeforeOnset:
    """Motion of the skull CG just before the impact.

    Parameters
    ----------
    frames
        Number of frames before it.
    motion
        One sample, at the median onset of the draws; global axes.
    sigma_velocity_m_per_s, sigma_omega_rad_per_s
        ``(3,)`` standard deviations of the velocities' components, global axes.
    """

    frames: int
    motion: Kinematics
    sigma_velocity_m_per_s: np.ndarray
    sigma_omega_rad_per_s: np.ndarray


def onset_index(curve: np.ndarray) -> np.ndarray:
    """Index at which a resultant ``(..., g)`` sets in, along the last axis; 0 where it never was quiet."""
    peak = curve.max(axis=-1, keepdims=True)
    major = np.argmax(curve >= MAJOR * peak, axis=-1)
    quiet = (curve < BEGUN * peak) & (np.arange(curve.shape[-1]) < major[..., None])
    last = curve.shape[-1] - 1 - np.argmax(quiet[..., ::-1], axis=-1)
    return np.where(quiet.any(axis=-1), last + 1, 0)


def contact_index(alpha: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Index of the impact's onset in resultants of angular and CG acceleration ``(..., g)``: the first of the two."""
    return np.minimum(onset_index(alpha), onset_index(acceleration))


def before_onset(
    turning: Turning, position: Told, focal: np.ndarray, onsets_s: np.ndarray, problem: Problem
) -> BeforeOnset:
    """Fit the slow motion of a head to the frames that are surely before the impact.

    Parameters
    ----------
    turning, position
        Orientation, and CG in camera axes, as the frames tell them.
    focal
        ``(k,)`` information on log f of each frame.
    onsets_s
        ``(draws,)`` onsets of the drawn motions [s]: frames before their lowest twentieth are used.
    problem
        Axes of camera and head, and what the lens may do.
    """
    camera = problem.camera
    until, at = float(np.quantile(onsets_s, _SURELY_BEFORE)), float(np.median(onsets_s))
    spin = read_quiet(turning.told, ANGULAR, until, at)
    centre = position.values.mean(axis=0)
    path = read_quiet(Told(position.time_s, position.values - centre, position.information), LINEAR, until, at)
    base, level = turning.between(len(spin.time_s))
    here = int(np.searchsorted(spin.time_s, at - 1e-9))
    to_global = camera.rotation_to_global
    turned = to_global * base[here] * Rotation.from_rotvec(spin.level - level[here])
    body, ray = turned.as_matrix(), to_global.as_matrix()
    omega, velocity = body @ spin.rate, ray @ path.rate
    # a lens that zooms looks like a head that comes closer
    used = position.time_s < until
    closer = (path.level + centre) * zoom_rate_sigma(position.time_s[used], focal[used], problem)
    unsure = path.covariance + np.outer(closer, closer)
    motion = Kinematics(
        time_s=np.array([at]),
        position_m=to_global.apply(path.level + centre)[None],
        rotation=Rotation.from_quat((turned * Rotation.from_quat(camera.template_to_head).inv()).as_quat()[None]),
        velocity_m_per_s=velocity[None],
        acceleration_m_per_s2=(ray @ path.slope)[None],
        omega_rad_per_s=omega[None],
        alpha_rad_per_s2=(body @ spin.slope)[None],
    )
    return BeforeOnset(
        frames=int(np.sum(turning.told.time_s < until)),
        motion=motion,
        sigma_velocity_m_per_s=np.sqrt(np.diag(ray @ unsure @ ray.T)),
        sigma_omega_rad_per_s=np.sqrt(np.diag(body @ spin.covariance @ body.T)),
    )


def zoom_rate_sigma(time_s: np.ndarray, focal: np.ndarray, problem: Problem) -> float:
    """Standard deviation of the rate of log f [1/s], from information on it ``(k,)`` at some times; 0 for a fixed lens.

    The batch's own spread will not do: it takes what a lens does between every two frames for a matter of its own,
    where a lens that zooms does so throughout.
    """
    if problem.camera.lens != "zoom":
        return 0.0
    away = time_s - np.average(time_s, weights=focal)
    return float((problem.smoothness.zoom_per_s**-2 + focal @ away**2) ** -0.5)


def steady_before(kinematics: Kinematics, end_s: float, fit_s: float) -> Kinematics:
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
    Kinematics
        One sample, at `end_s`; accelerations are zero.

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
    (position, velocity), *_ = np.linalg.lstsq(design, kinematics.position_m[chosen], rcond=None)
    seen = kinematics.rotation[chosen]
    at_end, omega = seen[len(since) - 1], np.zeros(3)
    for _ in range(_ROUNDS):
        steady = Rotation.from_rotvec(since[:, None] * omega) * at_end
        off = (seen * steady.inv()).as_rotvec()
        (turn, rate), *_ = np.linalg.lstsq(design, off, rcond=None)
        at_end, omega = Rotation.from_rotvec(turn) * at_end, omega + rate
    still = np.zeros((1, 3))
    turned = Rotation.from_quat(at_end.as_quat()[None])
    return Kinematics(np.array([end_s]), position[None], turned, velocity[None], still, omega[None], still)
