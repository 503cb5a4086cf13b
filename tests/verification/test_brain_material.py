"""The brain's law where its answer is known in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from replay.models import brain_material
from replay.solver.kernels.element import Motion
from replay.solver.kernels.materials import brain_isv
from replay.solver.kernels.pore_growth import grow_pores, lode_function

SETS = ("compression", "compression_and_shear")
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
#: phi after a plastic strain of 0.3 from 1e-6, by m and sigma_H / sigma_vm.
GROWN = {
    1.2: {1 / 3: 1.20e-6, 1.0: 1.84e-6, 2.0: 5.21e-6, 3.0: 4.82e-5},
    1.5: {1 / 3: 1.29e-6, 1.0: 2.41e-6, 2.0: 1.52e-5, 3.0: 1.83e-3},
    2.0: {1 / 3: 1.45e-6, 1.0: 3.89e-6, 2.0: 1.37e-4},
}


def stress_of(name: str) -> Callable[[np.ndarray], np.ndarray]:
    """Stress of a shipped set after a deformation from rest too fast to flow."""
    law = brain_isv.Parameters(**brain_material(name)["parameters"])
    constants, rest = law.constants(), law.initial_state()

    def stress(f: np.ndarray) -> np.ndarray:
        motion = Motion((0.0,) * 6, IDENTITY, tuple(map(tuple, f)), float(np.linalg.det(f)))
        s = brain_isv.update(motion, (0.0,) * 6, rest, 1e-9, constants)[0]
        return np.array([[s[0], s[3], s[5]], [s[3], s[1], s[4]], [s[5], s[4], s[2]]])

    return stress


@pytest.mark.parametrize("name", SETS)
def test_small_strain_gives_the_elastic_moduli(name: str, report: Callable[..., None]) -> None:
    stress, parameters = stress_of(name), brain_material(name)["parameters"]
    e = 1e-7
    bulk = np.trace(stress(np.eye(3) * (1 + e)) - stress(np.eye(3) * (1 - e))) / (18 * e)
    sheared = np.eye(3)
    sheared[0, 1] = 1e-5
    problem = f"brain, small strain, set {name}"
    report(problem, "bulk modulus [Pa]", parameters["bulk_modulus_pa"], bulk, 1e-6)
    report(problem, "shear modulus [Pa]", parameters["shear_modulus_pa"], stress(sheared)[0, 1] / 1e-5, 1e-6)


@pytest.mark.parametrize("exponent", GROWN)
def test_pores_grow_as_the_closed_form(exponent: float, report: Callable[..., None]) -> None:
    start = -math.expm1((exponent + 1) * math.log1p(-1e-6))
    for triaxiality, told in GROWN[exponent].items():
        # uniaxial deviator, so that the shear term has no part in it
        stress = (*(triaxiality + d for d in (2 / 3, -1 / 3, -1 / 3)), 0.0, 0.0, 0.0)
        w, phi = start, 1e-6
        for _ in range(30):
            w, phi, _ = grow_pores(w, phi, stress, (0.0,) * 6, 0.01, exponent, 0.0, 20.0)
        rate = (exponent + 1) * math.sinh(2 * (2 * exponent - 1) / (2 * exponent + 1) * triaxiality)
        exact = -math.expm1(math.log1p(-start * math.exp(rate * 0.3)) / (exponent + 1))
        problem = f"pore growth of Cocks and Ashby, m {exponent:g}"
        quantity = f"phi at plastic strain 0.3, triaxiality {triaxiality:.3g}"
        assert exact == pytest.approx(told, rel=5e-3), quantity
        report(problem, quantity, exact, phi, 1e-9)


def test_pores_saturate_below_one(report: Callable[..., None]) -> None:
    w, phi = -math.expm1(3 * math.log1p(-1e-6)), 1e-6
    for _ in range(30):
        stress = (3 + 2 / 3, 3 - 1 / 3, 3 - 1 / 3, 0.0, 0.0, 0.0)
        w, phi, _ = grow_pores(w, phi, stress, (0.0,) * 6, 0.01, 2.0, 0.0, 20.0)
    report("pore growth of Cocks and Ashby, m 2", "phi at plastic strain 0.3, triaxiality 3: saturated", 1.0, phi, 2e-3)
    assert phi < 1.0


def test_lode_function_tells_shear_from_tension(report: Callable[..., None]) -> None:
    for name, deviator, told in (
        ("uniaxial tension", (2 / 3, -1 / 3, -1 / 3, 0.0, 0.0, 0.0), 0.0),
        ("uniaxial compression", (-2 / 3, 1 / 3, 1 / 3, 0.0, 0.0, 0.0), 0.0),
        ("pure shear", (0.0, 0.0, 0.0, 3**-0.5, 0.0, 0.0), 1.0),
        ("pure shear, turned", (3**-0.5, -(3**-0.5), 0.0, 0.0, 0.0, 0.0), 1.0),
    ):
        report("Lode function of the shear term", name, told, lode_function(deviator, 1.0), 1e-12)


@pytest.mark.parametrize("name", SETS)
def test_a_rotation_on_top_of_a_path_turns_the_stress(name: str, report: Callable[..., None]) -> None:
    law = brain_isv.Parameters(**brain_material(name)["parameters"])
    constants = law.constants()
    states = [law.initial_state(), law.initial_state()]
    stretch = np.array([[0.3, 0.4, 0.0], [-0.1, -0.2, 0.2], [0.1, 0.0, -0.1]])
    worst = 0.0
    for k in range(1, 201):
        f = np.eye(3) + stretch * k / 200
        f /= np.linalg.det(f) ** (1 / 3)
        c, s = math.cos(0.11 * k), math.sin(0.11 * k)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        found = []
        for j, g in enumerate((f, turn @ f)):
            motion = Motion((0.0,) * 6, IDENTITY, tuple(map(tuple, g)), 1.0)
            t, states[j], _ = brain_isv.update(motion, (0.0,) * 6, states[j], 1e-4, constants)
            found.append(np.array([[t[0], t[3], t[5]], [t[3], t[1], t[4]], [t[5], t[4], t[2]]]))
        worst = max(worst, np.abs(found[1] - turn @ found[0] @ turn.T).max() / np.abs(found[0]).max())
    report(f"brain, rotation on top of a path, set {name}", "largest difference of stress, relative", 0.0, worst, 1e-10)
