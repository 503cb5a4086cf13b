"""All measures of a head's motion as one table: value, unit, definition, source."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from replay.errors import InputError
from replay.measures.head import (
    DAMAGE_BETA_UNVERIFIED_PER_M,
    bric,
    damage_deflection,
    hic,
    peak,
    severity_index,
)

_COLUMNS = (
    "time_s",
    *(f"a_head_{axis}_m_per_s2" for axis in "xyz"),
    *(f"omega_head_{axis}_rad_per_s" for axis in "xyz"),
    *(f"alpha_head_{axis}_rad_per_s2" for axis in "xyz"),
)


def head_measures(table: Mapping[str, ArrayLike], *, file: str = "kinematics") -> list[dict[str, Any]]:
    """Measure the motion of the head's centre of gravity.

    Parameters
    ----------
    table
        ``time_s`` and the head-axis columns ``a_head_{x,y,z}_m_per_s2``,
        ``omega_head_{x,y,z}_rad_per_s``, ``alpha_head_{x,y,z}_rad_per_s2``.
    file
        Named in errors.

    Returns
    -------
    list of dict
        ``name``, ``value``, ``unit``, ``definition``, ``source`` and, where there is one,
        ``time_s`` of the peak or ``window_s`` of the criterion.

    Raises
    ------
    InputError
        When a column is missing, a value is not finite, or times do not rise.
    """
    missing = [name for name in _COLUMNS if name not in table]
    if missing:
        raise InputError(file, f"column {', '.join(missing)} is missing", expected=", ".join(_COLUMNS))
    time = np.asarray(table["time_s"], dtype=float)
    acceleration, omega, alpha = (
        np.stack([np.asarray(table[name.format(axis)], dtype=float) for axis in "xyz"], axis=1)
        for name in ("a_head_{}_m_per_s2", "omega_head_{}_rad_per_s", "alpha_head_{}_rad_per_s2")
    )
    try:
        peaks = [peak(time, history) for history in (acceleration, omega, alpha)]
        criteria = [hic(time, acceleration, window) for window in (0.015, 0.036)]
        severity = severity_index(time, acceleration)
    except ValueError as error:
        raise InputError(file, str(error), mend="run the stage again that writes it") from None
    rows: list[dict[str, Any]] = []
    for name, unit, found, what in zip(
        ("peak_linear_acceleration", "peak_angular_velocity", "peak_angular_acceleration"),
        ("m/s^2", "rad/s", "rad/s^2"),
        peaks,
        ("acceleration of the centre of gravity", "angular velocity", "angular acceleration"),
    ):
        rows.append(_row(name, found.value, unit, f"greatest resultant {what}", "article, protocol 2.4"))
        rows[-1]["time_s"] = found.time_s
    for name, window, result in zip(("HIC15", "HIC36"), (15, 36), criteria):
        definition = f"greatest (t2 - t1) mean(a)^2.5 with t2 - t1 <= {window} ms, a in g, t in s"
        rows.append(_row(name, result.value, "1", definition, "Versace 1971; SAE J885"))
        rows[-1]["window_s"] = [result.start_s, result.end_s]
    rows.append(_row("SI", severity, "1", "integral of a^2.5, a in g, t in s", "Gadd 1966"))
    rows.append(
        _row(
            "BrIC",
            bric(omega),
            "1",
            "root of the sum of (max|omega_i| / critical_i)^2, critical 66.25, 56.45, 42.87 rad/s, head axes",
            "Takhounts et al. 2013",
        )
    )
    try:
        deflection = damage_deflection(time, alpha)
    except ValueError:
        return rows  # DAMAGE needs uniform samples; the other measures do not
    rows.append(
        _row(
            "DAMAGE_deflection",
            deflection,
            "m",
            "greatest deflection of a coupled three-axis oscillator driven by the angular acceleration",
            "Gabler, Crandall, Panzer 2019",
        )
    )
    rows.append(
        _row(
            "DAMAGE_unverified",
            deflection * DAMAGE_BETA_UNVERIFIED_PER_M,
            "1",
            f"the deflection times {DAMAGE_BETA_UNVERIFIED_PER_M} 1/m; this scale is not verified here",
            "Gabler, Crandall, Panzer 2019",
        )
    )
    return rows


def _row(name: str, value: float, unit: str, definition: str, source: str) -> dict[str, Any]:
    return {"name": name, "value": value, "unit": unit, "definition": definition, "source": source}
