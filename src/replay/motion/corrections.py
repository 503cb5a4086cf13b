"""What the camera itself did, taken out of the tracks: its pan, told by points that stand still; rolling shutter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from replay.motion.camera import Lens
from replay.motion.tracks import Tracks

_ROUNDS = 3
"""Refinements of where the static points are in the steadied picture."""


@dataclass(frozen=True)
class Steadied:
    """Tracks as a camera that stands still would have seen them.

    Parameters
    ----------
    tracks
        Corrected.
    reference
        Index of the frame whose picture all others are turned to: the one of most static points, nearest the middle.
    rotation_deg
        ``(k, 3)`` rotation vector of the camera against that frame, camera axes: tilt up, pan right, roll.
    zoom_percent
        ``(k,)`` focal length against that frame's.
    residual_px
        Root mean square of what the static points still move [px]; None with one point, which fits exactly.
    """

    tracks: Tracks
    reference: int
    rotation_deg: np.ndarray
    zoom_percent: np.ndarray
    residual_px: float | None


def steady(tracks: Tracks, static_px: np.ndarray, focal_px: float, lens: Lens) -> Steadied:
    """Remove the camera's rotation and zoom, frame by frame.

    A camera that turns about its centre maps a pixel ray d to R d whatever its depth. Pan and tilt are estimated from
    one static point; roll and zoom too where two are seen, and are interpolated where only one is. Robust (soft L1 at
    2 px), so that a static point that a player hides does not steer the picture. A camera that travels is not
    modelled: its static points leave a residual.

    Parameters
    ----------
    tracks
        Landmarks.
    static_px
        ``(k, m, 2)`` static points [px]; every frame has one.
    focal_px
        Focal length [px]; at telephoto range its error hardly matters, for a pan is then a shift.
    lens
        Principal point. Distortion is not undone here: it is small against a pan at the places where a head is.
    """
    centre = np.array(lens.principal_point)
    seen = np.isfinite(static_px[..., 0])
    every = np.arange(len(seen))
    reference = int(np.argmax(seen.sum(axis=1) - np.abs(every / len(seen) - 0.5)))
    places = static_px[reference]
    state = np.zeros((len(seen), 4))
    for _ in range(_ROUNDS):
        known = seen & np.isfinite(places[:, 0])
        several, one = known.sum(axis=1) > 1, known.sum(axis=1) == 1
        for k in every[several]:
            state[k] = _attitude(static_px[k, known[k]], places[known[k]], state[k], 4, focal_px, centre)
        if several.any():
            for i in (2, 3):
                state[~several, i] = np.interp(every[~several], every[several], state[several, i])
        for k in every[one]:
            state[k] = _attitude(static_px[k, known[k]], places[known[k]], state[k], 2, focal_px, centre)
        told = several | one
        for i in (0, 1):
            state[~told, i] = np.interp(every[~told], every[told], state[told, i])
        # all frames together say where a point is: no frame's noise becomes everybody's
        places = np.nanmean(_turned(static_px, state, focal_px, centre), axis=0)
    left = (_turned(static_px, state, focal_px, centre) - places)[seen]
    freedom = 2 * seen.sum() - np.where(seen.sum(axis=1) > 1, 4, 2).sum() - 2 * static_px.shape[1]
    residual = float(np.sqrt(np.sum(left**2) / freedom)) if freedom > 0 else None
    return Steadied(
        tracks=replace(tracks, pixels=_turned(tracks.pixels, state, focal_px, centre)),
        reference=reference,
        rotation_deg=np.degrees(state[:, :3]),
        zoom_percent=100.0 * np.expm1(state[:, 3]),
        residual_px=residual,
    )


def _turned(pixels: np.ndarray, state: np.ndarray, focal_px: float, centre: np.ndarray) -> np.ndarray:
    """Pixels ``(k, n, 2)`` as the camera sees them in the attitude and with the focal length of the reference."""
    rays = np.empty((*pixels.shape[:2], 3))
    rays[..., :2] = (pixels - centre) / (focal_px * np.exp(state[:, 3]))[:, None, None]
    rays[..., 2] = 1.0
    turned = np.einsum("kij,knj->kni", Rotation.from_rotvec(state[:, :3]).as_matrix(), rays)
    return centre + focal_px * turned[..., :2] / turned[..., 2:]


def _attitude(
    seen_px: np.ndarray, places: np.ndarray, start: np.ndarray, free: int, focal_px: float, centre: np.ndarray
) -> np.ndarray:
    """Pan, tilt, roll and log zoom of one frame; the first `free` of them unknown, the others as in `start`."""

    def error(values: np.ndarray) -> np.ndarray:
        state = np.concatenate([values, start[free:]])[None]
        return (_turned(seen_px[None], state, focal_px, centre)[0] - places).ravel()

    scale = [1.0 / focal_px] * 2 + [1e-3] * 2
    fit = least_squares(error, start[:free], x_scale=scale[:free], loss="soft_l1", f_scale=2.0, xtol=1e-12, ftol=1e-12)
    return np.concatenate([fit.x, start[free:]])


def at_one_time(tracks: Tracks, row_time_s: float, fps: float, row: float | None = None) -> tuple[Tracks, float]:
    """Undo a rolling shutter: every click moved to the time of one row, the same in all frames.

    A click in row v belongs to the time ``frame / fps + v row_time``. Each landmark's track is interpolated at
    ``frame / fps + v0 row_time`` by the parabola through the click and its two neighbours in time (a line at the ends
    of a track; a click without neighbours stays). v0 is the median row of all clicks, so that what is interpolated over
    is short: the head's own height.

    Parameters
    ----------
    tracks
        Clicks.
    row_time_s
        Time between the exposures of two rows [s].
    fps
        Frame rate [Hz].
    row
        v0 where it is given [px].

    Returns
    -------
    tracks
        Corrected.
    row
        v0 [px]: the clip's times are late by ``v0 row_time``, all alike.
    """
    v = tracks.pixels[..., 1]
    row = float(np.nanmedian(v)) if row is None else row
    time = tracks.frames[:, None] / fps + (v - row) * row_time_s
    wanted = tracks.frames / fps
    out = tracks.pixels.copy()
    for j in range(v.shape[1]):
        at = np.flatnonzero(np.isfinite(v[:, j]))
        for place, k in enumerate(at):
            near = [i for i in at[max(place - 1, 0) : place + 2] if abs(i - k) <= 1]
            if len(near) > 1:
                out[k, j] = _lagrange(time[near, j], tracks.pixels[near, j], wanted[k])
    return replace(tracks, pixels=out), row


def _lagrange(time: np.ndarray, values: np.ndarray, wanted: float) -> np.ndarray:
    """Value at `wanted` of the polynomial through ``(n,)`` times and ``(n, 2)`` values."""
    out = np.zeros(values.shape[1])
    for i in range(len(time)):
        others = np.delete(time, i)
        out += values[i] * np.prod((wanted - others) / (time[i] - others))
    return out
