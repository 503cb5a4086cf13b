"""Mechanical action: closed forms, and the crossover of two histories."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from replay.errors import InputError
from replay.measures import ACTION_TABLE, crossover_time, kinetic_energy_of, mechanical_action, write_action


def test_action_of_a_free_body():
    t = np.linspace(0, 0.030, 61)
    assert mechanical_action(t, np.full(61, 0.5 * 5 * 9.3**2))[-1] == pytest.approx(6.486750, rel=1e-6)


def test_action_of_an_oscillator_over_one_period():
    t = np.linspace(0, 1, 1001)
    velocity = -2 * np.pi * np.sin(2 * np.pi * t)
    assert mechanical_action(t, 0.5 * velocity**2)[-1] == pytest.approx(9.869604, rel=1e-6)


def test_action_starts_at_zero_and_never_falls():
    t = np.linspace(0, 1, 50)
    action = mechanical_action(t, np.abs(np.sin(9 * t)))
    assert action[0] == 0.0
    assert (np.diff(action) >= 0).all()


def test_crossover_is_found_between_samples():
    t = np.array([0.0, 1.0, 2.0, 3.0])
    assert crossover_time(t, [0, 3, 4, 4], [0, 1, 3, 6]) == pytest.approx(2.0 + 1 / 3)


def test_curves_that_never_cross_have_no_crossover():
    t = np.arange(4.0)
    assert np.isnan(crossover_time(t, [0, 2, 4, 6], [0, 1, 2, 3]))
    assert np.isnan(crossover_time(t, np.ones(4), np.ones(4)))


def test_lengths_must_agree():
    with pytest.raises(ValueError, match="times for"):
        mechanical_action([0, 1], [1, 2, 3])


def test_driven_head_has_an_empty_impactor_column(tmp_path):
    write_action(tmp_path / "action.csv", [0.0, 1.0], [0.0, 2.0], [0.0, 1.0])
    table = ACTION_TABLE.read(tmp_path / "action.csv")
    assert table["impactor_J_s"].isna().all()
    assert table["head_J_s"].tolist() == [0.0, 2.0]


def test_kinetic_energy_is_summed_over_the_parts_of_a_body():
    table = pd.DataFrame(
        {"time_s": [0.0, 0.0, 0.0, 1.0, 1.0, 1.0], "pid": [1, 2, 3] * 2, "kinetic_J": [1, 2, 4, 8, 16, 32]}
    )
    assert kinetic_energy_of(table, [1, 3]).tolist() == [5.0, 40.0]
    with pytest.raises(InputError, match="part 9 is not there"):
        kinetic_energy_of(table, [1, 9])
