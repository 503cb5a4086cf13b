"""Head measures against closed forms and against an independent implementation."""

from __future__ import annotations

import dynars.injury as oracle
import numpy as np
import pytest

from replay.errors import InputError
from replay.measures import bric, damage_deflection, head_measures, hic, peak, severity_index
from replay.measures.head import STANDARD_GRAVITY

G = STANDARD_GRAVITY


def pulse(shape: str, duration_s: float, samples: int = 4001) -> tuple[np.ndarray, np.ndarray]:
    """A 100 g pulse [m/s^2] and its times."""
    t = np.linspace(0, duration_s, samples)
    s = t / duration_s
    form = {
        "half-sine": np.sin(np.pi * s),
        "triangle": 1 - np.abs(2 * s - 1),
        "haversine": np.sin(np.pi * s) ** 2,
        "constant": np.ones_like(s),
    }[shape]
    return t, 100 * G * form


@pytest.mark.parametrize(
    ("shape", "coefficient"), [("half-sine", 0.4146456495), ("triangle", 0.2464006574), ("haversine", 0.3029388550)]
)
def test_hic_of_a_short_pulse_is_its_closed_form(shape, coefficient):
    """The optimum window fits into 15 ms; sampling the window's ends at T/4000 costs less than 1e-6."""
    t, a = pulse(shape, 0.010)
    assert hic(t, a, 0.015).value == pytest.approx(coefficient * 0.010 * 1e5, rel=1e-6)


@pytest.mark.parametrize(
    ("duration_ms", "hic15", "hic36", "si"),
    [(10, 414.6456, 414.6456, 457.6559), (20, 829.2913, 829.2913, 915.3117), (30, 1153.6633, 1243.9369, 1372.9676)],
)
def test_hic_and_si_of_a_100_g_half_sine(duration_ms, hic15, hic36, si):
    t, a = pulse("half-sine", duration_ms / 1e3, 6001)
    assert hic(t, a, 0.015).value == pytest.approx(hic15, rel=1e-6)
    assert hic(t, a, 0.036).value == pytest.approx(hic36, rel=1e-6)
    assert severity_index(t, a) == pytest.approx(si, rel=1e-6)


def test_optimum_window_of_a_half_sine_is_where_calculus_puts_it():
    t, a = pulse("half-sine", 0.010)
    result = hic(t, a, 0.036)
    assert result.end_s - result.start_s == pytest.approx(0.6702296636 * 0.010, abs=1e-5)
    assert result.start_s + result.end_s == pytest.approx(0.010, abs=1e-5)


@pytest.mark.parametrize(("duration_s", "window_s"), [(0.010, 0.015), (0.060, 0.015), (0.060, 0.036)])
def test_hic_of_a_constant_pulse_is_limited_by_pulse_or_window(duration_s, window_s):
    t, a = pulse("constant", duration_s)
    assert hic(t, a, window_s).value == pytest.approx(min(duration_s, window_s) * 1e5, rel=1e-9)


@pytest.mark.parametrize(("shape", "coefficient"), [("triangle", 2 / 7), ("haversine", 0.3395305453)])
def test_severity_index_is_its_closed_form(shape, coefficient):
    t, a = pulse(shape, 0.012)
    assert severity_index(t, a) == pytest.approx(coefficient * 0.012 * 1e5, rel=1e-6)


def test_hic_is_the_best_of_every_window():
    """The dumb reference tries all pairs of samples, at uneven times too."""
    rng = np.random.default_rng(7)
    t = np.cumsum(rng.uniform(2e-4, 1.2e-3, 60))
    a = rng.uniform(0, 900, 60)
    v = np.concatenate([[0], np.cumsum(0.5 * (a[1:] + a[:-1]) / G * np.diff(t))])
    for window in (0.005, 0.015, 0.036):
        best = max(
            (t[j] - t[i]) * ((v[j] - v[i]) / (t[j] - t[i])) ** 2.5
            for i in range(60)
            for j in range(i + 1, 60)
            if t[j] - t[i] <= window * (1 + 1e-9)
        )
        assert hic(t, a, window).value == pytest.approx(best, rel=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_hic_si_and_bric_agree_with_an_independent_implementation(seed):
    rng = np.random.default_rng(seed)
    dt, n = 1e-4, 800
    t = np.arange(n) * dt
    a = 60 * np.exp(-(((t - 0.03) / 0.006) ** 2)) + rng.uniform(0, 8, n)
    assert hic(t, a * G, 0.015).value == pytest.approx(oracle.hic15(a, dt), rel=1e-6)
    assert hic(t, a * G, 0.036).value == pytest.approx(oracle.hic36(a, dt), rel=1e-6)
    assert severity_index(t, a * G) == pytest.approx(oracle.severity_index(a, dt), rel=1e-3)
    omega = rng.normal(0, 20, (n, 3))
    assert bric(omega) == pytest.approx(oracle.bric(*omega.T, 66.25, 56.45, 42.87), rel=1e-12)


def test_bric_of_30_rad_per_s_about_each_axis():
    assert bric(np.full((4, 3), -30.0)) == pytest.approx(0.9885311, abs=5e-8)


@pytest.mark.parametrize(("axis", "expected"), [(0, 0.0841288), (1, 0.1122468), (2, 0.1347700)])
def test_damage_deflection_of_a_half_sine(axis, expected):
    t = np.linspace(0, 0.05, 5001)
    alpha = np.zeros((t.size, 3))
    alpha[:, axis] = np.where(t <= 0.010, 5000 * np.sin(np.pi * t / 0.010), 0.0)
    assert damage_deflection(t, alpha) == pytest.approx(expected, rel=2e-5)


def test_peak_is_of_the_resultant_and_the_first_of_equals():
    found = peak([0.0, 1.0, 2.0, 3.0], [[0, 0, 0], [3, 4, 0], [0, 0, -5], [1, 1, 1]])
    assert (found.value, found.time_s) == (5.0, 1.0)


@pytest.mark.parametrize(
    ("time", "values", "message"),
    [
        ([0.0, 1.0, 1.0], [1, 2, 3], "time does not rise after sample 2"),
        ([0.0, 1.0, 2.0], [1, np.nan, 3], "sample 2 is not a finite number"),
        ([0.0, 1.0], [1, 2, 3], "2 times for 3 values"),
        ([0.0], [1], "two or more"),
    ],
)
def test_history_that_is_none_is_refused(time, values, message):
    with pytest.raises(ValueError, match=message):
        hic(time, values, 0.015)


def test_window_of_nothing_is_refused():
    with pytest.raises(ValueError, match="must be positive"):
        hic([0, 1], [1, 1], 0.0)


def kinematics(n: int = 400) -> dict[str, np.ndarray]:
    t = np.linspace(0, 0.04, n)
    bump = np.exp(-(((t - 0.02) / 0.004) ** 2))
    table = {"time_s": t}
    for axis, share in zip("xyz", (1.0, 0.5, -0.2)):
        table[f"a_head_{axis}_m_per_s2"] = 700 * share * bump
        table[f"omega_head_{axis}_rad_per_s"] = 30 * share * bump
        table[f"alpha_head_{axis}_rad_per_s2"] = 4000 * share * bump
    return table


def test_every_head_measure_has_a_unit_a_definition_and_a_source():
    rows = head_measures(kinematics())
    names = [row["name"] for row in rows]
    assert names == [
        "peak_linear_acceleration",
        "peak_angular_velocity",
        "peak_angular_acceleration",
        "HIC15",
        "HIC36",
        "SI",
        "BrIC",
        "DAMAGE_deflection",
        "DAMAGE_unverified",
    ]
    assert all(row["unit"] and row["definition"] and row["source"] and np.isfinite(row["value"]) for row in rows)
    assert rows[0]["time_s"] == pytest.approx(0.02, abs=1e-4)
    assert rows[0]["value"] == pytest.approx(700 * np.sqrt(1 + 0.25 + 0.04), rel=1e-3)


def test_uneven_times_leave_out_only_damage():
    table = kinematics()
    table["time_s"] = table["time_s"] + 2e-5 * np.sin(np.arange(400))
    assert [row["name"] for row in head_measures(table)][-1] == "BrIC"


def test_table_that_cannot_be_measured_is_one_message():
    table = kinematics()
    del table["omega_head_y_rad_per_s"]
    with pytest.raises(InputError, match=r"driver.csv: column omega_head_y_rad_per_s is missing"):
        head_measures(table, file="driver.csv")
    table = kinematics()
    table["a_head_x_m_per_s2"][3] = np.nan
    with pytest.raises(InputError, match="sample 4 is not a finite number"):
        head_measures(table)
