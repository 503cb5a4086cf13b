"""The unit that a name carries: ``alpha_x_rad_per_s2`` is in rad/s^2."""

from __future__ import annotations

import re

_UNITS = {
    **{u: u for u in ("m", "s", "kg", "g", "N", "Pa", "J", "W", "K", "rad", "deg", "mm", "cm", "ms", "us", "px", "Hz")},
    "hz": "Hz",
    "percent": "%",
}
_TOKEN = re.compile(r"([A-Za-z]+?)([2-9]?)")


def unit_of(name: str) -> str:
    """Read the unit off the end of a name of a column, dataset or setting; "" where it carries none.

    Parameters
    ----------
    name
        As `replay.bundle.numbers.worst` names an entry: ``line 5, vx_m_per_s``, ``solver.plot_interval_s``,
        ``nodes/coordinates_m[3, 1]``.
    """
    leaf = re.split(r"[ ./]", re.sub(r"\[[^\]]*\]", "", name))[-1]
    parts = leaf.split("_")
    for start in range(1, len(parts)):
        if parts[start - 1] != "per" and (unit := _unit(parts[start:])) is not None:
            return unit
    return ""


def _unit(parts: list[str]) -> str | None:
    """Write ``["rad", "per", "s2"]`` as rad/s^2, or None when it is no unit."""
    above: list[str] = []
    below: list[str] = []
    under = False
    for part in parts:
        if part == "per" and not under:
            under = True
            continue
        match = _TOKEN.fullmatch(part)
        if not match or match[1] not in _UNITS:
            return None
        (below if under else above).append(_UNITS[match[1]] + (f"^{match[2]}" if match[2] else ""))
    if not above or (under and not below):
        return None
    return " ".join(above) + (f"/{' '.join(below)}" if below else "")
