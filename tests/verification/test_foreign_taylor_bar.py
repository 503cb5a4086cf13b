"""Taylor's bar on somebody else's mesh: a real keyword file, scaled and given a material as a user would."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from marching import March, controls, one_part

from replay.solver import Material
from replay.stages.foreign_deck import read_deck_as_model

LENGTH, RADIUS, SPEED, END = 32.4e-3, 3.2e-3, 227.0, 80e-6
# mm, tonne, s, MPa. The mesh is a quarter of a bar of radius 4 and length 30 mm along y; *MAT_003 wants the tangent
# modulus E H / (E + H) for H = 100 MPa.
DECK = """*KEYWORD
*PARAMETER
R        e  117000.0R        h     100.0
*PARAMETER_EXPRESSION
R     etan &e*&h/(&e+&h)
*DEFINE_TRANSFORMATION
         1
$   option        a1        a2        a3
     SCALE       0.8      1.08       0.8
*INCLUDE_PATH
{folder}
*INCLUDE_TRANSFORM
taylor_bar_mesh.k
         0         0         0         0         0         0         0
         0
       1.0       1.0       1.0       1.0
         1
*PART
copper bar
         1         1         1
*SECTION_SOLID
         1         1
*MAT_PLASTIC_KINEMATIC
         1   8.93e-9        &e      0.35     400.0     &etan       1.0
*END
"""


def test_a_real_mesh_meets_the_taylor_row(shared: Path, tmp_path: Path, report: Callable[..., None]) -> None:
    path = tmp_path / "bar.k"
    path.write_text(DECK.format(folder=shared / "real" / "decks"))
    model = read_deck_as_model([path], units="mm-tonne-s")
    nodes = model.nodes - [0.0, model.nodes[:, 1].min(), 0.0]
    np.testing.assert_allclose(nodes[:, 1].max(), LENGTH, atol=2e-9)
    np.testing.assert_allclose(np.hypot(nodes[:, 0], nodes[:, 2]).max(), RADIUS, rtol=1e-4)
    law = model.materials[model.parts[0].material]
    copper = Material("copper", law["law"], law["density_kg_per_m3"], law["parameters"])
    np.testing.assert_allclose(law["parameters"]["hardening_modulus_pa"], 100e6, rtol=1e-9)

    held = np.abs(nodes) < 1e-9  # two planes of symmetry, and the frictionless wall at the foot
    velocity = np.zeros_like(nodes)
    velocity[~held[:, 1], 1] = -SPEED
    problem = one_part(nodes, model.hexes, copper, controls(1.0), initial_velocity=velocity, fixed=held)
    march = March(problem)
    march.until(END, lambda m: None, every=50)
    place, foot = march.u + nodes, held[:, 1]
    name = "Taylor bar, a foreign mesh of 768 elements a quarter"
    report(name, "length at rest [mm]", 21.45, 1e3 * place[:, 1].max(), 0.2 / 21.45)
    radius = 1e3 * np.hypot(place[foot, 0], place[foot, 2]).max()
    report(name, "radius of the foot [mm], 6.7 to 7.2", 6.95, radius, 0.25 / 6.95)
    energies = march.run.energies()
    report(name, "energy ratio", 1.0, energies.ratio, 1e-3)
    assert energies.kinetic < 0.005 * energies.initial
