"""Driver fidelity: target against applied motion at the skull's centre of gravity (article, protocol 3.8)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from replay.errors import InputError
from replay.measures.head import Peak, peak, resultant
from replay.measures.rating import rate

_HISTORY_FILE = "histories.csv"


@dataclass(frozen=True)
class Motion:
    """Six-degree-of-freedom motion of a point of a rigid body, in one fixed frame.

    Parameters
    ----------
    time_s : (n,)
        Rising times [s].
    position_m : (n, 3)
        Of the point.
    quaternion : (n, 4)
        Body to fixed frame, x, y, z, w.
    velocity_m_per_s, acceleration_m_per_s2 : (n, 3)
        Of the point.
    angular_velocity_rad_per_s, angular_acceleration_rad_per_s2 : (n, 3)
        Of the body, in the fixed frame.
    """

    time_s: NDArray[np.float64]
    position_m: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    velocity_m_per_s: NDArray[np.float64]
    acceleration_m_per_s2: NDArray[np.float64]
    angular_velocity_rad_per_s: NDArray[np.float64]
    angular_acceleration_rad_per_s2: NDArray[np.float64]

    @classmethod
    def from_columns(cls, table: Mapping[str, ArrayLike], prefix: str = "") -> Motion:
        """Take a motion from the columns of driver_6dof.csv or of a rigid body's history.

        Parameters
        ----------
        table
            ``time_s``, and with `prefix` before each: ``x_m``.., ``qx``.., ``vx_m_per_s``..,
            ``ax_m_per_s2``.., ``omega_x_rad_per_s``.., ``alpha_x_rad_per_s2``...
        prefix
            Before every heading but ``time_s``.
        """

        def columns(pattern: str, axes: str = "xyz") -> NDArray[np.float64]:
            return np.stack([np.asarray(table[prefix + pattern.format(a)], dtype=float) for a in axes], axis=1)

        return cls(
            time_s=np.asarray(table["time_s"], dtype=float),
            position_m=columns("{}_m"),
            quaternion=columns("q{}", "xyzw"),
            velocity_m_per_s=columns("v{}_m_per_s"),
            acceleration_m_per_s2=columns("a{}_m_per_s2"),
            angular_velocity_rad_per_s=columns("omega_{}_rad_per_s"),
            angular_acceleration_rad_per_s2=columns("alpha_{}_rad_per_s2"),
        )

    @classmethod
    def from_history(cls, table: pd.DataFrame, pid: int) -> Motion:
        """Take the motion of one rigid part from the solver's histories.csv.

        Accelerations are not recorded; they are central differences of the recorded
        velocities, which at 0.1 ms keeps all but 2e-4 of a 10 ms pulse.

        Parameters
        ----------
        table
            Rows of histories.csv.
        pid
            Number of the part.

        Raises
        ------
        InputError
            When the part has no row, or is not rigid.
        """
        rows = table[table["pid"] == pid]
        if len(rows) < 3 or rows["qw"].isna().any():
            raise InputError(
                _HISTORY_FILE,
                f"part {pid} has {len(rows)} rows, {int(rows['qw'].notna().sum())} of them with an orientation",
                expected="at least three rows of a rigid part",
                mend="run the replay again with a finer history interval",
            )
        columns: dict[str, NDArray[np.float64]] = {
            name: rows[name].to_numpy(dtype=float) for name in rows if name != "part"
        }
        time = columns["time_s"]
        for axis in "xyz":
            columns[f"a{axis}_m_per_s2"] = np.gradient(columns[f"v{axis}_m_per_s"], time, edge_order=2)
            columns[f"alpha_{axis}_rad_per_s2"] = np.gradient(columns[f"omega_{axis}_rad_per_s"], time, edge_order=2)
        return cls.from_columns(columns)

    def of_point(self, point_m: ArrayLike) -> Motion:
        """Return the motion of another point of the same rigid body.

        Parameters
        ----------
        point_m : (3,)
            Where the point is at the first sample [m].
        """
        turned = Rotation.from_quat(self.quaternion) * Rotation.from_quat(self.quaternion[0]).inv()
        arm = turned.apply(np.asarray(point_m, dtype=float) - self.position_m[0])
        omega, alpha = self.angular_velocity_rad_per_s, self.angular_acceleration_rad_per_s2
        swing = np.cross(omega, arm)
        return replace(
            self,
            position_m=self.position_m + arm,
            velocity_m_per_s=self.velocity_m_per_s + swing,
            acceleration_m_per_s2=self.acceleration_m_per_s2 + np.cross(alpha, arm) + np.cross(omega, swing),
        )


@dataclass(frozen=True)
class Comparison:
    """One quantity, target against applied.

    Parameters
    ----------
    rmse
        Root mean square of |applied - target|, in the unit of the quantity.
    rmse_percent_of_peak
        The same over the target's peak; None where that is zero.
    target_peak, applied_peak
        Of the resultants.
    delta_peak_percent
        100 (applied - target) / target; None where the target's peak is zero.
    delta_time_to_peak_ms
        Applied less target; None where the target's peak is zero.
    """

    rmse: float
    rmse_percent_of_peak: float | None
    target_peak: Peak
    applied_peak: Peak
    delta_peak_percent: float | None
    delta_time_to_peak_ms: float | None

    def to_json(self) -> dict[str, Any]:
        """Return plain values for fidelity.json."""
        return {
            "rmse": self.rmse,
            "rmse_percent_of_peak": self.rmse_percent_of_peak,
            "target_peak": self.target_peak.value,
            "target_peak_time_s": self.target_peak.time_s,
            "applied_peak": self.applied_peak.value,
            "applied_peak_time_s": self.applied_peak.time_s,
            "delta_peak_percent": self.delta_peak_percent,
            "delta_time_to_peak_ms": self.delta_time_to_peak_ms,
        }


def compare(target_time_s: ArrayLike, target: ArrayLike, applied_time_s: ArrayLike, applied: ArrayLike) -> Comparison:
    """Compare an applied history with its target over the span that both cover.

    Each peak is taken from its own samples within that span; the target is interpolated
    linearly at the applied times for the root mean square.

    Parameters
    ----------
    target_time_s, applied_time_s : (n,), (k,)
        Rising times [s].
    target, applied : (n, 3), (k, 3)
        Vectors in one frame.

    Raises
    ------
    ValueError
        When fewer than two samples of either lie in the common span.
    """
    t_target, t_applied = np.asarray(target_time_s, dtype=float), np.asarray(applied_time_s, dtype=float)
    v_target, v_applied = np.asarray(target, dtype=float), np.asarray(applied, dtype=float)
    start, end = max(t_target[0], t_applied[0]), min(t_target[-1], t_applied[-1])
    slack = 1e-9 * max(abs(end), 1e-6)
    in_target = (t_target >= start - slack) & (t_target <= end + slack)
    in_applied = (t_applied >= start - slack) & (t_applied <= end + slack)
    if in_target.sum() < 2 or in_applied.sum() < 2:
        message = f"target spans {t_target[0]:g}..{t_target[-1]:g} s, applied {t_applied[0]:g}..{t_applied[-1]:g} s"
        raise ValueError(message)
    at = t_applied[in_applied]
    wanted = np.stack([np.interp(at, t_target, column) for column in v_target.T], axis=1)
    rmse = float(np.sqrt((resultant(v_applied[in_applied] - wanted) ** 2).mean()))
    peak_target = peak(t_target[in_target], v_target[in_target])
    peak_applied = peak(at, v_applied[in_applied])
    told = peak_target.value > 0
    return Comparison(
        rmse=rmse,
        rmse_percent_of_peak=100 * rmse / peak_target.value if told else None,
        target_peak=peak_target,
        applied_peak=peak_applied,
        delta_peak_percent=100 * (peak_applied.value - peak_target.value) / peak_target.value if told else None,
        delta_time_to_peak_ms=1e3 * (peak_applied.time_s - peak_target.time_s) if told else None,
    )


def position_residual_mm(target: Motion, applied: Motion) -> float:
    """Greatest distance [mm] of the applied from the target position, both relative to their own start.

    The target is interpolated by the cubic Hermite polynomial of its positions and velocities.
    """
    curve = CubicHermiteSpline(target.time_s, target.position_m, target.velocity_m_per_s)
    inside = _inside(target, applied)
    at = applied.time_s[inside]
    wanted = curve(at) - curve(at[0])
    moved = applied.position_m[inside] - applied.position_m[inside][0]
    return float(1e3 * resultant(moved - wanted).max())


def rotation_residual_deg(target: Motion, applied: Motion) -> float:
    """Greatest angle [degrees] between the applied and the target orientation, both relative to their own start.

    The target's quaternion is interpolated by the cubic Hermite polynomial of its samples and
    of q' = omega q / 2, and normalised.
    """
    q = _continuous(target.quaternion)
    curve = CubicHermiteSpline(target.time_s, q, 0.5 * _product(_pure(target.angular_velocity_rad_per_s), q))
    inside = _inside(target, applied)
    at = applied.time_s[inside]
    wanted = curve(at)
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    given = applied.quaternion[inside] / np.linalg.norm(applied.quaternion[inside], axis=1, keepdims=True)
    turned = _product(given, _conjugate(given[:1]))
    difference = _product(turned, _conjugate(_product(wanted, _conjugate(wanted[:1]))))
    angle = 2 * np.arctan2(np.linalg.norm(difference[:, :3], axis=1), np.abs(difference[:, 3]))
    return float(np.degrees(angle.max()))


def fidelity(target: Motion, applied: Motion) -> dict[str, Any]:
    """Return the content of fidelity.json: each quantity of the article's Table 4, and the residuals."""
    return {
        "linear_acceleration": _entry("m/s^2", target, applied, "acceleration_m_per_s2"),
        "angular_acceleration": _entry("rad/s^2", target, applied, "angular_acceleration_rad_per_s2"),
        "angular_velocity": _entry("rad/s", target, applied, "angular_velocity_rad_per_s"),
        "position_residual_mm": position_residual_mm(target, applied),
        "rotation_residual_deg": rotation_residual_deg(target, applied),
    }


def _entry(unit: str, target: Motion, applied: Motion, name: str) -> dict[str, Any]:
    """One quantity: its comparison, and the ISO/TS 18571 rating of its resultant (None where that is constant)."""
    wanted, given = getattr(target, name), getattr(applied, name)
    try:
        rating = rate(target.time_s, resultant(wanted), applied.time_s, resultant(given)).overall
    except ValueError:
        rating = None
    return {
        "unit": unit,
        **compare(target.time_s, wanted, applied.time_s, given).to_json(),
        "iso_18571_rating": rating,
    }


def _inside(target: Motion, applied: Motion) -> NDArray[np.bool_]:
    slack = 1e-9 * max(abs(float(target.time_s[-1])), 1e-6)
    inside = (applied.time_s >= target.time_s[0] - slack) & (applied.time_s <= target.time_s[-1] + slack)
    if not inside.any():
        message = "the applied motion lies outside the target's time span"
        raise ValueError(message)
    return inside


def _continuous(quaternion: NDArray) -> NDArray[np.float64]:
    """Choose of q and -q the one nearer to the sample before."""
    q = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    turns = np.where((q[1:] * q[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(turns)])[:, None]


def _pure(vector: NDArray) -> NDArray[np.float64]:
    return np.concatenate([vector, np.zeros((len(vector), 1))], axis=1)


def _conjugate(q: NDArray) -> NDArray[np.float64]:
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def _product(p: NDArray, q: NDArray) -> NDArray[np.float64]:
    vector = p[:, 3:] * q[:, :3] + q[:, 3:] * p[:, :3] + np.cross(p[:, :3], q[:, :3])
    scalar = p[:, 3:] * q[:, 3:] - (p[:, :3] * q[:, :3]).sum(axis=1, keepdims=True)
    return np.concatenate([vector, scalar], axis=1)
