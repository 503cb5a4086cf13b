"""Driver: the window around t0 on a fine uniform grid, consistent in pose, velocity and acceleration.

Angular velocity and CG acceleration are interpolated by a shape-preserving cubic, which cannot overshoot its
samples; everything else follows from these two by differentiation and integration, so that the solver meets
one motion and not seven curves that disagree.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation, Slerp

from replay.errors import InputError
from replay.files import write_json
from replay.motion.kinematics import Kinematics
from replay.motion.rates import integrate_rotation
from replay.play import Window

STEP_S = 5.0e-5
"""Time between samples of the driver [s]."""


@dataclass(frozen=True)
class DriverQuality:
    """Numbers on the resampling.

    Overshoot is the excess of the fine curve over the samples it passes through, in per cent of the greatest
    sample. Closure is the greatest distance, over the samples in the window, between the driver and the
    reconstruction: what the filters and differences of the reconstruction left inconsistent.
    """

    overshoot_acceleration_percent: float
    overshoot_omega_percent: float
    closure_position_mm: float
    closure_rotation_deg: float
    closure_velocity_m_per_s: float
    consistency_position_mm: float
    consistency_rotation_deg: float
    samples_in_window: int
    step_s: float


@dataclass(frozen=True)
class Driver:
    """Motion prescribed to the skull.

    Parameters
    ----------
    motion
        Uniform, time 0 at the start of the window, global axes, skull CG.
    start_s
        Time of the window's start on the clock of the kinematics [s].
    quality
        Overshoot and closure.
    """

    motion: Kinematics
    start_s: float
    quality: DriverQuality

    def initial_velocity(self) -> dict[str, object]:
        """Motion at the start of the window, with the axis of rotation through P and Q."""
        k = self.motion
        return {
            "time_s": self.start_s,
            "position_m": k.position_m[0],
            "quaternion_xyzw": _first_quaternion(k),
            "velocity_m_per_s": k.velocity_m_per_s[0],
            "omega_rad_per_s": k.omega_rad_per_s[0],
            **axis_points(k.position_m[0], k.omega_rad_per_s[0]),
            "quality": asdict(self.quality),
        }

    def write(self, folder: Path) -> None:
        """Write ``driver_6dof.csv`` and ``initial_velocity.json``."""
        self.motion.write_driver(folder / "driver_6dof.csv")
        write_json(folder / "initial_velocity.json", self.initial_velocity())


def _first_quaternion(motion: Kinematics) -> list[float]:
    columns = motion.columns(head=False)
    return [float(columns[f"q{c}"][0]) for c in "xyzw"]


def axis_points(position_m: np.ndarray, omega_rad_per_s: np.ndarray) -> dict[str, object]:
    """Axis of rotation as Velodyne's initial velocity takes it (protocol 3.6), computed from omega.

    P is the skull CG and Q one metre along omega, so that the velocity stated with it is that of the CG, and
    the spin about P to Q is right-handed and not negative. Without spin the axis is vertical.
    """
    spin = float(np.sqrt(omega_rad_per_s @ omega_rad_per_s))
    axis = omega_rad_per_s / spin if spin > 0.0 else np.array([0.0, 0.0, 1.0])
    return {"spin_rad_per_s": spin, "P_m": position_m, "Q_m": position_m + axis}


def build_driver(kinematics: Kinematics, t0_s: float, window: Window, *, step_s: float = STEP_S) -> Driver:
    """Resample the window around t0 for the solver.

    Initial velocity and position are those of the double integral of the acceleration that lie closest to
    the reconstructed path over the window, the initial orientation likewise: an initial velocity read off
    one frame would carry that frame's noise through the whole replay.

    Parameters
    ----------
    kinematics
        Of the skull CG.
    t0_s
        Impact reference on the clock of `kinematics` [s].
    window
        Of the play.
    step_s
        Time between samples [s].

    Raises
    ------
    InputError
        When the window runs past the data.
    """
    time = kinematics.time_s
    start, end = t0_s - window.before_t0_s, t0_s + window.duration_s - window.before_t0_s
    _refuse_outside(time, start, end)
    count = int(np.ceil(window.duration_s / step_s - 1e-9)) + 1
    fine = start + step_s * np.arange(count)
    fine = np.minimum(fine, time[-1])
    local = step_s * np.arange(count)

    acceleration = PchipInterpolator(time, kinematics.acceleration_m_per_s2)
    spin = PchipInterpolator(time, kinematics.omega_rad_per_s)
    once, twice = acceleration.antiderivative(1), acceleration.antiderivative(2)

    near = (time >= start - 1e-12) & (time <= end + 1e-12)
    if near.sum() < 4:
        closest = np.argsort(np.abs(time - 0.5 * (start + end)), kind="stable")[:4]
        near = np.isin(np.arange(len(time)), closest)
    at = time[near]
    # x = x0 + v0 (t - start) + double integral from start
    double = twice(at) - twice(start) - once(start) * (at - start)[:, None]
    design = np.stack([np.ones_like(at), at - start], axis=1)
    (x0, v0), *_ = np.linalg.lstsq(design, kinematics.position_m[near] - double, rcond=None)
    position = x0 + v0 * (fine - start)[:, None] + twice(fine) - twice(start) - once(start) * (fine - start)[:, None]
    velocity = v0 + once(fine) - once(start)

    first = Slerp(time, kinematics.rotation)(start)
    rotation = integrate_rotation(first, spin(fine), step_s)
    inside = near & (time >= start - 1e-12) & (time <= fine[-1] + 1e-12)
    mismatch = np.zeros((1, 3))
    if inside.any():
        samples = np.clip(time[inside], fine[0], fine[-1])
        off = (kinematics.rotation[inside] * Slerp(fine, rotation)(samples).inv()).as_rotvec()
        rotation = Rotation.from_rotvec(off.mean(axis=0)) * rotation
        mismatch = (kinematics.rotation[inside] * Slerp(fine, rotation)(samples).inv()).as_rotvec()
    motion = Kinematics(
        time_s=local,
        position_m=position,
        rotation=rotation,
        velocity_m_per_s=velocity,
        acceleration_m_per_s2=acceleration(fine),
        omega_rad_per_s=spin(fine),
        alpha_rad_per_s2=spin(fine, 1),
    )
    spans = (time >= start - (time[1] - time[0])) & (time <= end + (time[1] - time[0]))
    path = x0 + v0 * (at - start)[:, None] + double
    quality = DriverQuality(
        overshoot_acceleration_percent=_overshoot(
            motion.acceleration_m_per_s2, kinematics.acceleration_m_per_s2[spans]
        ),
        overshoot_omega_percent=_overshoot(motion.omega_rad_per_s, kinematics.omega_rad_per_s[spans]),
        closure_position_mm=1e3 * float(np.abs(np.linalg.norm(path - kinematics.position_m[near], axis=1)).max()),
        closure_rotation_deg=float(np.degrees(np.linalg.norm(mismatch, axis=1).max())),
        closure_velocity_m_per_s=float(
            np.linalg.norm(v0 + once(at) - once(start) - kinematics.velocity_m_per_s[near], axis=1).max()
        ),
        **_consistency(motion, step_s),
        samples_in_window=int(inside.sum()),
        step_s=step_s,
    )
    return Driver(motion, float(start), quality)


def _refuse_outside(time: np.ndarray, start: float, end: float) -> None:
    if start < time[0] - 1e-9 or end > time[-1] + 1e-9:
        asked, there = f"{start * 1e3:.1f} to {end * 1e3:.1f} ms", f"{time[0] * 1e3:.1f} to {time[-1] * 1e3:.1f} ms"
        file = "play.yaml"
        raise InputError(
            file,
            f"the window {asked} runs past the data, {there}",
            column="window",
            expected="a window inside the clip or record",
            mend="shorten window.before_t0_s or window.duration_s, or add frames around the impact",
        )


def _overshoot(fine: np.ndarray, samples: np.ndarray) -> float:
    """Excess of any component over the range of its samples, in per cent of the greatest sample."""
    scale = float(np.abs(samples).max())
    if scale == 0.0:
        return 0.0
    above = (fine - samples.max(axis=0)).max()
    below = (samples.min(axis=0) - fine).max()
    return 100.0 * max(0.0, float(above), float(below)) / scale


def _consistency(motion: Kinematics, step_s: float) -> dict[str, float]:
    """How far one step of each curve misses the next sample: Hermite in position, Magnus in rotation."""
    x, v, a = motion.position_m, motion.velocity_m_per_s, motion.acceleration_m_per_s2
    missed = x[1:] - x[:-1] - 0.5 * step_s * (v[1:] + v[:-1]) + step_s**2 / 12.0 * (a[1:] - a[:-1])
    turned = (motion.rotation[1:] * motion.rotation[:-1].inv()).as_rotvec()
    w = motion.omega_rad_per_s
    spun = 0.5 * step_s * (w[1:] + w[:-1])
    return {
        "consistency_position_mm": 1e3 * float(np.abs(missed).max()),
        "consistency_rotation_deg": float(np.degrees(np.abs(turned - spun).max())),
    }
