"""Falx and tentorium as nets of cables with the stiffness of a sheet, and the outlet below the brainstem."""

from __future__ import annotations

import numpy as np
import pytest

from replay.models import CableNet, Model, build_model, falx, tentorium
from replay.models.cubed_sphere import cube_lattice
from replay.models.membranes import THICKNESS_M, YOUNGS_MODULUS_PA, _net
from replay.stages.problem import membrane_cables


def energy(net: CableNet, nodes: np.ndarray, strain: np.ndarray) -> float:
    """Energy of the net under a small uniform strain, (3, 3) [J]."""
    span = nodes[net.nodes[:, 1]] - nodes[net.nodes[:, 0]]
    squared = np.einsum("ij,ij->i", span, span)
    stretch = np.einsum("ij,jk,ik->i", span, strain, span) / np.sqrt(squared)
    return float(0.5 * net.stiffness_n_per_m @ stretch**2)


@pytest.mark.parametrize(
    ("strain", "density"),
    [  # energy of plane stress with nu = 1/3 over E t, per area
        ([[1, 0, 0], [0, 0, 0], [0, 0, 0]], 9 / 16),
        ([[1, 0, 0], [0, 1, 0], [0, 0, 0]], 3 / 2),
        ([[1, 0, 0], [0, -1 / 3, 0], [0, 0, 0]], 1 / 2),  # uniaxial stress: E
        ([[0, 0.5, 0], [0.5, 0, 0], [0, 0, 0]], 3 / 16),  # shear: G = 3/8 E
    ],
)
def test_a_net_of_squares_is_as_stiff_as_the_sheet(strain: list[list[float]], density: float) -> None:
    lattice = cube_lattice(24)
    quads = lattice.quads[lattice.quad_centres[:, 2] == 1]
    nodes = lattice.surface_cube * 0.05
    net = _net(nodes, quads)
    assert net.area_m2 == pytest.approx(0.01)
    found = energy(net, nodes, 1e-3 * np.array(strain)) / (1e-6 * YOUNGS_MODULUS_PA * THICKNESS_M * 0.01)
    assert found == pytest.approx(density, rel=1e-9)


def test_the_falx_hangs_in_the_midline_over_the_corpus_callosum_from_the_skull(coarse: Model) -> None:
    net = falx(coarse)
    used = np.unique(net.nodes)
    points = coarse.nodes[used]
    np.testing.assert_allclose(points[:, 1], 0, atol=1e-7)
    assert 60e-4 < net.area_m2 < 110e-4
    assert np.ptp(points[:, 0]) > 0.12
    callosum = coarse.hexes[coarse.element_region == coarse.region_names.index("corpus_callosum")]
    assert points[:, 2].max() > coarse.nodes[callosum][..., 2].max() + 0.02
    skull = np.unique(coarse.hexes[coarse.elements_of(role="skull")])
    assert len(np.intersect1d(used, skull)) > 10


def test_the_tentorium_lies_on_the_cerebellum_and_reaches_the_skull_on_both_sides(coarse: Model) -> None:
    net = tentorium(coarse)
    used = np.unique(net.nodes)
    points = coarse.nodes[used]
    cerebellum = coarse.hexes[coarse.element_region == coarse.region_names.index("cerebellum")]
    assert np.isin(used, cerebellum).mean() > 0.6
    assert 40e-4 < net.area_m2 < 120e-4
    assert points[:, 1].max() == pytest.approx(-points[:, 1].min(), abs=1e-7)
    skull = coarse.nodes[np.intersect1d(used, coarse.hexes[coarse.elements_of(role="skull")])]
    assert skull[:, 1].min() < -0.04 < 0.04 < skull[:, 1].max()


def test_cables_are_in_the_problem_only_where_the_play_asks_for_them(tiny: Model) -> None:
    assert membrane_cables(tiny) == ()
    model = build_model("nfl", "tiny", membranes="cables")
    cables = membrane_cables(model)
    assert len(cables) == len(falx(model).nodes) + len(tentorium(model).nodes)
    assert not any(cable.recorded for cable in cables)
    np.testing.assert_array_equal(model.nodes, tiny.nodes)
    with pytest.raises(ValueError, match="no membranes 'steel'"):
        build_model("nfl", "tiny", membranes="steel")


@pytest.mark.parametrize("resolution", ["tiny", "coarse"])
def test_the_foramen_magnum_is_fluid_from_the_brainstem_to_the_neck(resolution: str) -> None:
    closed, opened = (build_model("nfl", resolution, helmet=False, outlet=outlet) for outlet in ("closed", "open"))
    np.testing.assert_allclose(np.ptp(opened.nodes, axis=0), np.ptp(closed.nodes, axis=0), atol=1e-12)
    assert opened.elements_of(role="csf").sum() - closed.elements_of(role="csf").sum() == (
        closed.elements_of(role="skull").sum() - opened.elements_of(role="skull").sum()
    )
    skull, fluid = (np.unique(opened.hexes[opened.elements_of(role=role)]) for role in ("skull", "csf"))
    neck = np.unique(
        np.concatenate([opened.hexes[opened.elements_of(role=role)].ravel() for role in ("scalp", "face")])
    )
    window = opened.nodes[np.setdiff1d(np.intersect1d(fluid, neck), skull)]
    assert len(window)  # fluid that touches the neck's flesh and no bone
    rim = opened.nodes[np.intersect1d(np.intersect1d(fluid, neck), skull)]
    assert 0.025 < np.ptp(rim[:, 1]) < 0.060
    assert (rim[:, 2] < -0.04).all()
    with pytest.raises(ValueError, match="no outlet 'ajar'"):
        build_model("nfl", "tiny", outlet="ajar")
