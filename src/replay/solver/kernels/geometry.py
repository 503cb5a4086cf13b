"""Volumes and reference gradients of all elements, from the element's own formula."""

from __future__ import annotations

from numba import prange

from replay.solver.kernels.device import compiled
from replay.solver.kernels.hexahedron import mean_gradient, modes


def _corner(coordinates, hexes, element, axis):
    return (
        coordinates[hexes[element, 0], axis],
        coordinates[hexes[element, 1], axis],
        coordinates[hexes[element, 2], axis],
        coordinates[hexes[element, 3], axis],
        coordinates[hexes[element, 4], axis],
        coordinates[hexes[element, 5], axis],
        coordinates[hexes[element, 6], axis],
        coordinates[hexes[element, 7], axis],
    )


_corner = compiled(_corner)


def _element_gradients(coordinates, hexes, gradient, volume):
    """Modal gradient (n, 18) [m^2] and volume (n,) [m^3] of every element, into the last two arguments."""
    for element in prange(hexes.shape[0]):
        m = modes(
            _corner(coordinates, hexes, element, 0),
            _corner(coordinates, hexes, element, 1),
            _corner(coordinates, hexes, element, 2),
        )
        g, v = mean_gradient(m)
        for axis in range(3):
            gradient[element, axis] = g[0][axis]
            gradient[element, 3 + axis] = g[1][axis]
            gradient[element, 6 + axis] = g[2][axis]
            gradient[element, 9 + axis] = g[3][axis]
            gradient[element, 12 + axis] = g[4][axis]
            gradient[element, 15 + axis] = g[5][axis]
        volume[element] = v


def _element_modes(coordinates, hexes, result):
    """First six modal coordinates (n, 6, 3) of every element [m], into the last argument."""
    for element in prange(hexes.shape[0]):
        m = modes(
            _corner(coordinates, hexes, element, 0),
            _corner(coordinates, hexes, element, 1),
            _corner(coordinates, hexes, element, 2),
        )
        for axis in range(3):
            result[element, 0, axis] = m[0][axis]
            result[element, 1, axis] = m[1][axis]
            result[element, 2, axis] = m[2][axis]
            result[element, 3, axis] = m[3][axis]
            result[element, 4, axis] = m[4][axis]
            result[element, 5, axis] = m[5][axis]


element_gradients = compiled(_element_gradients, parallel=True)
element_modes = compiled(_element_modes, parallel=True)
