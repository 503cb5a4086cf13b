"""Each law alone: elastic limits, closed forms, dissipation, and what a user may write."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from material_point import PARAMETERS, Point, turned

from replay.errors import InputError
from replay.solver import LAWS, Material, law_parameters

SMALL = 1e-6


@pytest.mark.parametrize("law", PARAMETERS)
def test_moduli_at_small_strain_are_those_of_the_parameters(law: str) -> None:
    bulk, shear = LAWS[law].Parameters(**PARAMETERS[law]).elastic_moduli()
    e = SMALL if law != "crushable_foam" else 1e-8
    pressure = np.trace(Point(law, **PARAMETERS[law]).to(np.eye(3) * (1 + e), dt=1e-9)) / 3
    assert pressure == pytest.approx(3 * bulk * e, rel=3e-6)
    f = np.eye(3)
    f[0, 1] = f[1, 0] = e / 2
    assert Point(law, **PARAMETERS[law]).to(f, dt=1e-9)[0, 1] == pytest.approx(shear * e, rel=3e-6)


@pytest.mark.parametrize("law", PARAMETERS)
def test_a_turn_on_top_of_any_path_turns_the_stress(law: str) -> None:
    rng = np.random.default_rng(3)
    plain, spun = Point(law, **PARAMETERS[law]), Point(law, **PARAMETERS[law])
    target = np.eye(3) + 0.15 * rng.uniform(-1, 1, (3, 3))
    steps = 2000
    for k in range(1, steps + 1):
        f = np.eye(3) + (target - np.eye(3)) * k / steps
        a = plain.to(f)
        # first the deformation, then the turn: each step is exact on its own
        b = spun.to(f)
    for k in range(1, 201):
        b = spun.to(turned(0.02 * k) @ target, dt=0.0)
    r = turned(4.0)
    assert np.abs(b - r @ a @ r.T).max() < 1e-10 * np.abs(a).max()


@pytest.mark.parametrize("law", ["viscohyperelastic", "brain_isv", "crushable_foam"])
def test_laws_in_total_form_are_objective_along_the_way(law: str) -> None:
    rng = np.random.default_rng(4)
    plain, spun = Point(law, **PARAMETERS[law]), Point(law, **PARAMETERS[law])
    target = np.eye(3) + 0.2 * rng.uniform(-1, 1, (3, 3))
    for k in range(1, 101):
        f = np.eye(3) + (target - np.eye(3)) * k / 100
        r = turned(0.05 * k)
        a, b = plain.to(f), spun.to(r @ f)
        assert np.abs(b - r @ a @ r.T).max() < 1e-9 * max(np.abs(a).max(), 1.0)


@pytest.mark.parametrize("law", PARAMETERS)
@pytest.mark.parametrize("dt", [1e-9, 1e-4, 1.0])
def test_any_step_and_any_stretch_stay_finite(law: str, dt: float) -> None:
    for stretch in (0.08, 0.3, 3.0):
        for axes in ((1, 0, 0), (1, 1, 0), (1, 1, 1)):
            point = Point(law, **PARAMETERS[law])
            f = np.diag([stretch if a else 1.0 for a in axes])
            f[0, 1] += 0.2
            assert np.isfinite(point.to(f, dt)).all()
            assert np.isfinite(point.state).all()
            assert np.isfinite(point.moduli).all()
            assert point.moduli[0] + 2 * point.moduli[1] > 0
            assert np.isfinite(point.to(np.eye(3), dt)).all()


@pytest.mark.parametrize("law", ["viscohyperelastic", "brain_isv", "fluid", "crushable_foam", "elastic_plastic"])
def test_closed_cycles_never_give_energy(law: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(6):
        point = Point(law, **PARAMETERS[law])
        direction = 0.2 * rng.uniform(-1, 1, (3, 3))
        if law == "crushable_foam":
            direction += np.diag([-0.6, 0.0, 0.0])
        for phase in np.linspace(0, 4 * np.pi, 4001)[1:]:
            point.to(np.eye(3) + 0.5 * (1 - math.cos(phase)) * direction, dt=2e-5)
        assert point.work > -1e-6 * point.parameters.elastic_moduli()[1]


def test_prony_relaxation_is_the_closed_form() -> None:
    point = Point("viscohyperelastic", **PARAMETERS["viscohyperelastic"])
    gamma, mu = 0.2, 6e3
    f = np.eye(3)
    f[0, 1] = gamma
    point.to(f, dt=1e-9)
    t = 0.0
    for dt in [1e-4] * 100 + [1e-3] * 100 + [0.03] * 20:
        tau = point.to(f, dt)[0, 1]
        t += dt
        exact = mu * gamma * (1 - 0.5 * (1 - math.exp(-t / 0.01)) - 0.3 * (1 - math.exp(-t / 0.1)))
        assert tau == pytest.approx(exact, rel=1e-6)


def test_prony_ramp_converges_with_the_second_order() -> None:
    mu, g, tau, rate, end = 6e3, 0.5, 0.01, 2e-4, 0.02
    exact = mu * rate * ((1 - g) * end + g * tau * (1 - math.exp(-end / tau)))
    errors = []
    for n in (8, 16, 32):
        point = Point("viscohyperelastic", bulk_modulus_pa=2e6, shear_modulus_pa=mu, prony_ratios=g, prony_times_s=tau)
        for k in range(1, n + 1):
            f = np.eye(3)
            f[0, 1] = rate * end * k / n
            stress = point.to(f, end / n)
        errors.append(abs(stress[0, 1] - exact))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)


def test_neo_hookean_uniaxial_stretch_is_the_closed_form() -> None:
    point = Point("viscohyperelastic", bulk_modulus_pa=2e6, shear_modulus_pa=6e3)
    for stretch in (0.5, 1.5, 2.5):
        s = point.to(np.diag([stretch, stretch**-0.5, stretch**-0.5]))
        assert s[0, 0] - s[1, 1] == pytest.approx(6e3 * (stretch**2 - 1 / stretch), rel=1e-9)


def test_neo_hookean_simple_shear_is_the_closed_form() -> None:
    point = Point("viscohyperelastic", bulk_modulus_pa=2e6, shear_modulus_pa=6e3)
    f = np.eye(3)
    for f[0, 1] in (0.3, 1.0, 2.0):
        s = point.to(f)
        assert s[0, 1] == pytest.approx(6e3 * f[0, 1], rel=1e-12)
        assert s[0, 0] - s[1, 1] == pytest.approx(6e3 * f[0, 1] ** 2, rel=1e-12)
        assert s[1, 1] == pytest.approx(s[2, 2], rel=1e-12)
        assert np.trace(s) == pytest.approx(0.0, abs=1e-8)


def test_elastic_uniaxial_strain_is_logarithmic_and_simple_shear_is_that_of_the_jaumann_rate() -> None:
    lame, shear = 1e6 * 0.3 / (1.3 * 0.4), 1e6 / 2.6
    point = Point("elastic", **PARAMETERS["elastic"])
    for stretch in np.linspace(1.0, 1.5, 1001)[1:]:
        s = point.to(np.diag([stretch, 1.0, 1.0]))
    assert s[0, 0] == pytest.approx((lame + 2 * shear) * math.log(1.5), rel=1e-6)
    point, f = Point("elastic", **PARAMETERS["elastic"]), np.eye(3)
    for f[0, 1] in np.linspace(0.0, 1.0, 1001)[1:]:
        s = point.to(f)
    assert s[0, 1] == pytest.approx(shear * math.sin(1.0), rel=1e-6)
    assert s[0, 0] == pytest.approx(shear * (1 - math.cos(1.0)), rel=1e-6)


def test_fluid_pressure_is_a_function_of_volume_alone() -> None:
    point = Point("fluid", **PARAMETERS["fluid"])
    for k in range(1, 50):
        f = np.eye(3)
        f[0, 1] = 0.1 * k
        assert np.trace(point.to(f)) == pytest.approx(0.0, abs=1e-6)
    for j in (0.9, 1.1):
        assert np.trace(point.to(np.eye(3) * j ** (1 / 3))) / 3 == pytest.approx(1e6 * (j - 1 / j), rel=1e-9)


def test_foam_meets_its_curve_exactly_and_has_no_lateral_stress() -> None:
    strains, stresses = (0.0, 0.05, 0.3, 0.6, 0.8), (0.0, 4e4, 6e4, 1.5e5, 9e5)
    point = Point(
        "crushable_foam", youngs_modulus_pa=1e6, plateau_stress_pa=5e4, densification_strain=0.6,
        curve_strains=strains, curve_stresses_pa=stresses,
    )  # fmt: skip
    r = turned(0.7)
    for e in np.linspace(0.001, 0.8, 200):
        s = r.T @ point.to(r @ np.diag([1 - e, 1.0, 1.0])) @ r
        assert -s[0, 0] == pytest.approx(np.interp(e, strains, stresses), rel=1e-9)
        assert np.abs(s[1:, 1:]).max() < 1e-9 * abs(s[0, 0])


def test_foam_stress_rises_without_end_beyond_its_curve() -> None:
    point = Point("crushable_foam", **PARAMETERS["crushable_foam"])
    stress = [-point.to(np.diag([1 - e, 1.0, 1.0]))[0, 0] for e in np.linspace(0, 0.995, 400)]
    assert (np.diff(stress) >= 0).all()
    assert stress[-1] > 100 * 1e5


def test_foam_loses_most_of_the_energy_on_unloading_and_reloads_below_the_curve() -> None:
    taken = {}
    for u in (0.1, 0.5, 1.0):
        point = Point("crushable_foam", **PARAMETERS["crushable_foam"], unloading_factor=u)
        for e in np.linspace(0, 0.6, 1201)[1:]:
            top = -point.to(np.diag([1 - e, 1.0, 1.0]))[0, 0]
        given = point.work
        half = [-point.to(np.diag([1 - e, 1.0, 1.0]))[0, 0] for e in np.linspace(0.6, 0.3, 601)][-1]
        for e in np.linspace(0.3, 0, 601):
            point.to(np.diag([1 - e, 1.0, 1.0]))
        taken[u] = point.work / given
        again = [-point.to(np.diag([1 - e, 1.0, 1.0]))[0, 0] for e in np.linspace(0, 0.3, 601)][-1]
        assert again == pytest.approx(half, rel=1e-9)
        assert half <= top
    # pseudo-elastic: the loss is (1 - u)/2 of the energy
    for u, lost in taken.items():
        assert lost == pytest.approx(0.5 * (1 - u), abs=2e-3)


@pytest.mark.parametrize("cutoff", [0.0, 3e4])
@pytest.mark.parametrize("left", [0.2, 1.0])
def test_foam_gives_no_energy_when_it_leaves_in_extension_and_comes_back_in_shear(cutoff: float, left: float) -> None:
    point = Point("crushable_foam", **PARAMETERS["crushable_foam"], tension_cutoff_pa=cutoff, unloading_factor=left)
    extension = np.diag([0.3, 0.0, 0.0])
    shear = 0.3 / math.sqrt(2) * np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    peak = 0.0
    for path in (
        lambda t: t * extension,
        lambda t: math.cos(0.5 * math.pi * t) * extension + math.sin(0.5 * math.pi * t) * shear,
        lambda t: (1 - t) * shear,
    ):
        for t in np.linspace(0, 1, 301)[1:]:
            point.to(np.eye(3) + path(t))
            peak = max(peak, point.work)
    assert point.work / peak == pytest.approx(0.5 * (1 - left), abs=1e-3)


def test_foam_stress_is_the_derivative_of_an_energy_and_its_modulus_bounds_the_second() -> None:
    def nominal(strain: np.ndarray) -> tuple[np.ndarray, float]:
        point = Point("crushable_foam", **PARAMETERS["crushable_foam"], tension_cutoff_pa=3e4, unloading_factor=1.0)
        stretch = np.eye(3) + strain
        volume = np.linalg.det(stretch)
        stress = volume * point.to(stretch, dt=0.0) @ np.linalg.inv(stretch)
        return stress, 2 * point.moduli[1] / max(1 / volume, 1.0) / np.linalg.eigvalsh(stretch @ stretch)[-1]

    units = []
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)):
        unit = np.zeros((3, 3))
        unit[i, j] = unit[j, i] = 1.0 if i == j else math.sqrt(0.5)
        units.append(unit)
    rng = np.random.default_rng(8)
    between = 0
    for _ in range(60):
        strain = rng.uniform(-1, 1, (3, 3)) + 0.3 * np.eye(3)
        strain = 0.5 * (strain + strain.T)
        strain *= 10 ** rng.uniform(-2.0, -0.4) / np.linalg.norm(strain)
        between += 0.0 < np.trace(strain) < np.linalg.norm(strain)
        h = 1e-6
        tangent = np.array(
            [[((nominal(strain + h * e)[0] - nominal(strain - h * e)[0]) * f).sum() / (2 * h) for f in units]
             for e in units]
        )  # fmt: skip
        assert np.abs(tangent - tangent.T).max() < 1e-6 * np.abs(tangent).max()
        assert np.linalg.eigvalsh(tangent)[-1] <= nominal(strain)[1] * (1 + 1e-6)
    assert between > 20


def test_foam_tension_stops_at_the_cut_off() -> None:
    point = Point("crushable_foam", **PARAMETERS["crushable_foam"], tension_cutoff_pa=3e4)
    assert point.to(np.diag([1.3, 1.0, 1.0]))[0, 0] * 1.0 == pytest.approx(3e4, rel=1e-9)
    assert point.to(np.diag([1.01, 1.0, 1.0]))[0, 0] < 3e4


def test_foam_is_stiffer_when_crushed_fast_and_not_when_released() -> None:
    def crush(rate: float) -> tuple[float, float]:
        point = Point("crushable_foam", **PARAMETERS["crushable_foam"], rate_coefficient=0.2, rate_average_s=1e-5)
        n = 400
        for k in range(1, n + 1):
            stress = -point.to(np.diag([1 - 0.3 * k / n, 1.0, 1.0]), 0.3 / rate / n)[0, 0]
        return stress, point.state[1]

    slow, _ = crush(1e-3)
    fast, seen = crush(500.0)
    curve = -Point("crushable_foam", **PARAMETERS["crushable_foam"]).to(np.diag([0.7, 1, 1]))[0, 0]
    assert slow == pytest.approx(curve, rel=1e-3)
    assert fast / slow == pytest.approx(1 + 0.2 * math.log(1 + seen / 10.0), rel=1e-3)
    assert seen > 500.0


@pytest.mark.parametrize("law", sorted(LAWS))
def test_parameters_say_their_unit_and_are_documented(law: str) -> None:
    kind = LAWS[law].Parameters
    plain = {"poisson_ratio", "prony_ratios", "densification_strain", "curve_strains", "unloading_factor",
             "rate_coefficient"}  # fmt: skip
    if law == "brain_isv":  # dimensionless, under the article's own names
        plain |= {f.name for f in dataclasses.fields(kind) if not f.name.endswith(("_pa", "_per_s"))}
    for f in dataclasses.fields(kind):
        assert f.name in kind.__doc__
        assert f.name in plain or f.name.endswith(("_pa", "_s", "_per_s")), f.name


@pytest.mark.parametrize(
    ("law", "changes", "found"),
    [
        ("elastik", {}, "did you mean 'elastic'"),
        ("elastic", {"young_modulus_pa": 1.0}, "did you mean 'youngs_modulus_pa'"),
        ("elastic", {"poisson_ratio": 0.5}, "must lie between -1 and 0.5"),
        ("elastic", {"youngs_modulus_pa": "soft"}, "youngs_modulus_pa is 'soft'"),
        ("elastic", {"youngs_modulus_pa": float("nan")}, "youngs_modulus_pa is nan"),
        ("elastic_plastic", {"yield_stress_pa": 0.0}, "yield_stress_pa is 0"),
        ("elastic_plastic", {"curve_strains": [0.1, 0.2], "curve_stresses_pa": [4e4, 3e4]}, "must not fall"),
        ("elastic_plastic", {"curve_strains": [0.0], "curve_stresses_pa": [4e4]}, "increase from above 0"),
        ("elastic_plastic", {"poisson_ratio": 0.5}, "must lie between -1 and 0.5"),
        ("viscohyperelastic", {"prony_ratios": [0.6, 0.5]}, "sum must stay below 1"),
        ("viscohyperelastic", {"prony_times_s": [0.1]}, "as many of the one as of the other"),
        ("crushable_foam", {"curve_strains": [0.0, 0.5], "curve_stresses_pa": [0.0, -1.0]}, "must not fall"),
        ("fluid", {"shear_modulus_pa": -1.0}, "between 0 and the bulk modulus"),
    ],
)
def test_a_wrong_material_is_refused_with_its_name(law: str, changes: dict[str, Any], found: str) -> None:
    material = Material("gray matter", law, 1000.0, {**PARAMETERS.get(law, {}), **changes})
    with pytest.raises(InputError, match="gray matter") as caught:
        law_parameters(material)
    assert found in str(caught.value)


def test_a_missing_parameter_and_a_bad_density_are_refused() -> None:
    with pytest.raises(InputError, match="poisson_ratio is missing"):
        law_parameters(Material("m", "elastic", 1.0, {"youngs_modulus_pa": 1.0}))
    with pytest.raises(InputError, match="the density is 0"):
        law_parameters(Material("m", "elastic", 0.0, PARAMETERS["elastic"]))


def test_wave_speed_is_that_of_the_confined_bar() -> None:
    steel = Material("steel", "elastic", 7800.0, {"youngs_modulus_pa": 210e9, "poisson_ratio": 0.3})
    assert steel.wave_speed_m_per_s() == pytest.approx(6020.183, rel=1e-6)


def test_foam_keeps_its_hourglass_stiffness_through_crush_and_release() -> None:
    # a stiffness that fell on the way back would let hourglass forces give more than they took
    point = Point("crushable_foam", **PARAMETERS["crushable_foam"])
    seen = set()
    for e in (0.001, 0.3, 0.7, 0.3, 0.0, -0.2):
        point.to(np.diag([1 - e, 1.0, 1.0]))
        seen.add(point.moduli[2])
    assert len(seen) == 1
    assert 0 < seen.pop() < 0.5 * 1e6
