"""A wearable's table to skull-CG motion: columns, units, axes, filter and offset as the play says.

Nothing is guessed: a column that the play does not name is not read, a unit that it does not state is an error.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from replay.errors import InputError
from replay.motion.filters import butterworth, channel_frequency_class, channel_frequency_class_cutoff
from replay.motion.kinematics import STANDARD_GRAVITY, Kinematics
from replay.motion.rates import carried, integrate_rotation
from replay.play import (
    AccelerationColumns,
    AngularAccelerationColumns,
    AngularVelocityColumns,
    ButterworthFilter,
    CfcFilter,
    Filter,
    WearableSource,
)
from replay.tables import Column, TableFormat

_Columns = AccelerationColumns | AngularVelocityColumns | AngularAccelerationColumns
_FACTORS = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "g": STANDARD_GRAVITY,
    "m/s^2": 1.0,
    "rad/s": 1.0,
    "deg/s": float(np.pi / 180.0),
    "rad/s^2": 1.0,
    "deg/s^2": float(np.pi / 180.0),
}
_PLAY = "play.yaml"
LARGEST_JITTER = 0.02
"""Share of the sampling interval by which one may differ: more is uneven sampling, less is rounding."""
FEWEST_SAMPLES = 20
_ACCELERATION_LIMIT = 5000.0
_SPIN_LIMIT = 300.0


@dataclass(frozen=True)
class WearableMotion:
    """Motion of the skull CG from a wearable, and what its record is worth.

    Parameters
    ----------
    kinematics
        Of the skull CG, global axes.
    rate_hz, jitter_percent
        Median sampling rate; greatest deviation of an interval.
    cutoff_hz
        -3 dB of the filter; None without one.
    range_used
        Greatest raw value over the sensor's full range; None where the play states no range.
    saturated_samples
        Samples in runs of three or more equal values at a channel's extreme.
    """

    kinematics: Kinematics
    rate_hz: float
    jitter_percent: float
    cutoff_hz: float | None
    range_used: float | None
    saturated_samples: int


def read_wearable(path: Path, source: WearableSource) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Read the columns that the play names, in SI units and sensor axes.

    Returns
    -------
    time_s
        ``(n,)``.
    channels
        ``acceleration`` and ``angular_velocity``, and ``angular_acceleration`` where the play names it,
        ``(n, 3)``.

    Raises
    ------
    InputError, InputErrors
        Missing columns or numbers, time that stands or runs back, uneven sampling, values that only a wrong
        unit explains.
    """
    columns = source.columns
    groups: dict[str, _Columns] = {
        "acceleration": columns.acceleration,
        "angular_velocity": columns.angular_velocity,
    }
    if columns.angular_acceleration is not None:
        groups["angular_acceleration"] = columns.angular_acceleration
    names = [columns.time.name, *(name for group in groups.values() for name in group.names)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        found = f"column {twice[0]!r} is named twice"
        raise InputError(_PLAY, found, column="source.columns", mend="name each column once")
    frame = TableFormat("wearable table", tuple(Column(name, "") for name in names)).read(path)
    lines = frame.attrs["lines"]
    # a number too large for its unit becomes infinite, and is refused as such
    with np.errstate(over="ignore"):
        time = frame[columns.time.name].to_numpy() * _FACTORS[columns.time.unit]
        _refuse_uneven(path, columns.time.name, time, lines)
        channels = {key: frame[list(group.names)].to_numpy() * _FACTORS[group.unit] for key, group in groups.items()}
    for key, limit, unit in (
        ("acceleration", _ACCELERATION_LIMIT, "m/s^2"),
        ("angular_velocity", _SPIN_LIMIT, "rad/s"),
    ):
        row = int(np.argmax(np.abs(channels[key]).max(axis=1)))
        value = float(np.abs(channels[key][row]).max())
        if value > limit:
            raise InputError(
                path,
                f"{key} reaches {value:.4g} {unit}, which no head survives",
                line=lines[row],
                column=", ".join(groups[key].names),
                expected=f"below {limit:g} {unit}",
                mend=f"check source.columns.{key}.unit (now {groups[key].unit})",
            )
    return time, channels


def _refuse_uneven(path: Path, column: str, time: np.ndarray, lines: list[int]) -> None:
    if len(time) < FEWEST_SAMPLES:
        raise InputError(
            path,
            f"{len(time)} samples are too few",
            expected=f"at least {FEWEST_SAMPLES}",
            mend="export the whole event",
        )
    steps = np.diff(time)
    if (steps <= 0.0).any():
        at = int(np.argmax(steps <= 0.0)) + 1
        raise InputError(
            path,
            f"time stands still or runs back ({time[at - 1]:g} s, then {time[at]:g} s)",
            line=lines[at],
            column=column,
            expected="time that grows with every row",
            mend="sort the rows, and remove repeated ones",
        )
    step = float(np.median(steps))
    off = np.abs(steps - step) > LARGEST_JITTER * step
    if off.any():
        worst = int(np.argmax(off))
        raise InputError(
            path,
            f"the samples are uneven: {steps[worst] * 1e3:.4g} ms here, {step * 1e3:.4g} ms elsewhere",
            line=lines[worst + 1],
            column=column,
            expected=f"one interval, within {100 * LARGEST_JITTER:g} %",
            mend="fill the missing samples from the device's raw buffer, or resample before",
        )


def filter_cutoff(choice: Filter) -> float | None:
    """-3 dB of a play's filter [Hz]; None without one."""
    if isinstance(choice, CfcFilter):
        return channel_frequency_class_cutoff(choice.channel_class)
    return choice.cutoff_hz if isinstance(choice, ButterworthFilter) else None


def _filtered(values: np.ndarray, choice: Filter, rate_hz: float) -> np.ndarray:
    if isinstance(choice, CfcFilter):
        return channel_frequency_class(values, choice.channel_class, rate_hz)
    if isinstance(choice, ButterworthFilter):
        return butterworth(values, choice.cutoff_hz, rate_hz)
    return values


def reconstruct_wearable(path: Path, source: WearableSource) -> WearableMotion:
    """Motion of the skull CG from a wearable's table.

    Sensor axes are turned to head axes, all channels filtered alike, angular acceleration differentiated where
    the device does not give it, and the linear acceleration moved to the CG by a + alpha x r + omega x
    (omega x r). Orientation, velocity and position are integrated from the play's initial values.

    Parameters
    ----------
    path
        The table.
    source
        The play's description of it.

    Raises
    ------
    InputError, InputErrors
        As `read_wearable`.
    """
    time, channels = read_wearable(path, source)
    step = float((time[-1] - time[0]) / (len(time) - 1))
    rate = 1.0 / step
    to_head = source.axis_matrix
    head = {key: _filtered(values @ to_head.T, source.filter, rate) for key, values in channels.items()}
    omega = head["angular_velocity"]
    alpha = head.get("angular_acceleration")
    if alpha is None:
        # components in head axes: their rates are the angular acceleration, omega x omega being zero
        alpha = np.gradient(omega, step, axis=0)
    rotation = integrate_rotation(Rotation.from_quat(source.initial_orientation), omega, step, body_axes=True)
    acceleration = carried(head["acceleration"], alpha, omega, np.array(source.sensor_to_cg_m))
    a_global = rotation.apply(acceleration)
    if source.gravity == "included":
        a_global = a_global - np.array([0.0, 0.0, STANDARD_GRAVITY])
    even = time[0] + step * np.arange(len(time))
    curve = PchipInterpolator(even, a_global)
    velocity = np.array(source.initial_velocity_m_per_s) + curve.antiderivative(1)(even)
    position = np.array(source.initial_velocity_m_per_s) * (even - even[0])[:, None] + curve.antiderivative(2)(even)
    motion = Kinematics(even, position, rotation, velocity, a_global, rotation.apply(omega), rotation.apply(alpha))
    steps = np.diff(time)
    used = [
        float(np.abs(channels[key]).max()) / limit
        for key, limit in (
            ("acceleration", source.acceleration_range_m_per_s2),
            ("angular_velocity", source.angular_velocity_range_rad_per_s),
        )
        if limit is not None
    ]
    return WearableMotion(
        kinematics=motion,
        rate_hz=_rounded(1.0 / float(np.median(steps))),
        jitter_percent=100.0 * float(np.abs(steps / np.median(steps) - 1.0).max()),
        cutoff_hz=filter_cutoff(source.filter),
        range_used=max(used) if used else None,
        saturated_samples=sum(_saturated(values[:, i]) for values in channels.values() for i in range(3)),
    )


def _rounded(rate_hz: float) -> float:
    """Nine digits of a rate: 1 ms written in binary is not quite 1 kHz."""
    return float(f"{rate_hz:.9g}")


def _saturated(values: np.ndarray) -> int:
    """Samples in runs of three or more equal values at the channel's extreme; a channel at rest has none."""
    if np.ptp(values) == 0.0:
        return 0
    count = 0
    for extreme in (values.max(), values.min()):
        run = 0
        for hit in [*(values == extreme), False]:
            if hit:
                run += 1
            else:
                count += run if run >= 3 else 0
                run = 0
    return count
