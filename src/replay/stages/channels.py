"""Peaks of a struck head as instruments would give them: behind the channel filters of SAE J211."""

from __future__ import annotations

from typing import Any

import numpy as np

from replay.measures import Motion, peak
from replay.motion.filters import channel_frequency_class, channel_frequency_class_cutoff

CHANNEL_CLASSES = (1000, 180)
"""Channel frequency classes: 1000, that of SAE J211 for head acceleration, and a low one, to show what hangs on it."""
NAMES = tuple(f"peak_{quantity}_acceleration_cfc{k}" for quantity in ("linear", "angular") for k in CHANNEL_CLASSES)
_SAMPLES_PER_CLASS = 10


def peaks_behind_filters(motion: Motion) -> list[dict[str, Any]]:
    """Peaks of linear and angular acceleration, components filtered, as rows of ``measures.json``.

    A class is left out where there are fewer samples a second than the ten times its number that J211 asks for, or
    where they are not uniform. A driven head needs no filter: its motion was filtered before. The last period of a
    filter's corner is not looked at.

    Parameters
    ----------
    motion
        Of the head's centre of gravity.
    """
    step = np.diff(motion.time_s)
    if not np.allclose(step, step[0], rtol=1e-6):
        return []
    rate = 1.0 / float(step[0])
    rows = []
    for quantity, unit, vectors in (
        ("linear", "m/s^2", motion.acceleration_m_per_s2),
        ("angular", "rad/s^2", motion.angular_acceleration_rad_per_s2),
    ):
        for channel_class in CHANNEL_CLASSES:
            if rate * (1 + 1e-6) < _SAMPLES_PER_CLASS * channel_class:
                continue
            # a filter says nothing of the last period of its corner: there it ends where the record happens to end
            inside = motion.time_s <= motion.time_s[-1] - 1.0 / channel_frequency_class_cutoff(channel_class)
            behind = channel_frequency_class(vectors, channel_class, rate)
            if not inside.any():
                continue
            found = peak(motion.time_s[inside], behind[inside])
            rows.append(
                {
                    "name": f"peak_{quantity}_acceleration_cfc{channel_class}",
                    "value": found.value,
                    "unit": unit,
                    "definition": f"greatest resultant {quantity} acceleration behind class {channel_class}",
                    "source": "SAE J211",
                    "time_s": found.time_s,
                }
            )
    return rows
