"""Two digitisations of one play: one clock, one scale, one motion; and each difference is found where it is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.measures import Digitisation, Motion, agreement
from replay.measures.agreement import ACROSS, LINEAR, clock_shift, template_fit

RATE = 240.0
TEMPLATE = {"A": (0.18, 0.0, -0.04), "B": (0.13, 0.09, -0.05), "C": (0.0, 0.0, 0.16), "D": (0.0, 0.12, 0.0)}


def motion(time: np.ndarray, *, peak: float = 400.0, along: float = 0.0, spin: float = 30.0) -> Motion:
    """A head 2 m in front of the camera: a pulse of acceleration to the right, and some of it along the ray."""
    bump = np.exp(-(((time - 0.1) / 0.006) ** 2))
    turn = spin * (1 + np.tanh((time - 0.1) / 0.004)) / 2
    zero = np.zeros_like(time)
    gentle = np.sin(300 * time)
    return Motion(
        time_s=time,
        position_m=np.stack([zero, zero + 2.0, zero], axis=1),
        quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1)),
        velocity_m_per_s=np.stack([zero + 1.0, zero, zero], axis=1),
        acceleration_m_per_s2=np.stack([peak * bump, along * gentle, zero], axis=1),
        angular_velocity_rad_per_s=np.stack([zero, zero, turn], axis=1),
        angular_acceleration_rad_per_s2=np.stack([zero, zero, np.gradient(turn, time)], axis=1),
    )


def laboratory(name: str, *, clock_s: float = 0.0, changes: dict | None = None, **of_motion: float) -> Digitisation:
    record, driver = np.arange(48) / RATE, np.linspace(0.09, 0.12, 601)

    def on_clock(m: Motion) -> Motion:
        return dataclasses.replace(m, time_s=m.time_s + clock_s)

    base = Digitisation(
        name=name,
        record=on_clock(motion(record, **of_motion)),
        driver=on_clock(motion(driver, **of_motion)),
        t0_s=0.1 + clock_s,
        rate_hz=RATE,
        noise_along_m_per_s2=100.0,
        template=TEMPLATE,
        helmet_to_com_m=(0.01, 0.0, 0.03),
        cutoffs_hz={"linear": 40.0},
        video_sha256="a" * 64,
    )
    return dataclasses.replace(base, **(changes or {}))


def test_a_laboratory_agrees_with_itself_whatever_its_clock():
    for frames in (0, 3, -7):
        found = agreement(laboratory("north"), laboratory("south", clock_s=frames / RATE))
        assert found.clock_shift_samples == -frames
        assert found.t0_difference_samples == pytest.approx(0, abs=1e-9)
        for comparison, rating in found.quantities.values():
            assert comparison.rmse_percent_of_peak < 1e-6
            assert rating.overall == pytest.approx(1, abs=1e-6)
        assert found.inputs == {
            "same_video": True,
            "frame_rate_difference_percent": 0.0,
            "template_scale_percent": 0.0,
            "template_residual_mm": pytest.approx(0, abs=1e-9),
            "helmet_to_com_difference_mm": 0.0,
            "same_filters": True,
        }


def test_clips_cut_differently_still_find_their_common_clock():
    whole, short = motion(np.arange(48) / RATE), motion(np.arange(10, 40) / RATE)
    assert clock_shift(whole, short) == 0
    renumbered = dataclasses.replace(short, time_s=short.time_s - 10 / RATE)
    assert clock_shift(whole, renumbered) == 10
    assert clock_shift(renumbered, whole) == -10


def test_acceleration_is_compared_across_the_line_of_sight_and_along_it_only_with_the_noise():
    found = agreement(laboratory("north"), laboratory("south", along=80.0))
    across, _ = found.quantities[ACROSS]
    assert across.rmse == pytest.approx(0, abs=1e-9)
    assert found.along_ray_over_noise == pytest.approx(80 / np.sqrt(2) / 100, rel=0.05)
    changes = {"from_camera": False}
    whole = agreement(laboratory("north", changes=changes), laboratory("south", along=80.0, changes=changes))
    assert whole.quantities[LINEAR][0].rmse == pytest.approx(80 / np.sqrt(2), rel=0.05)
    assert whole.along_ray_over_noise == "no camera: compared whole"


def test_peaks_and_turns_that_differ_are_told_in_per_cent_and_in_samples():
    found = agreement(laboratory("north"), laboratory("south", peak=440.0, spin=27.0))
    assert found.quantities[ACROSS][0].delta_peak_percent == pytest.approx(10.0, abs=1e-6)
    assert found.quantities["angular velocity"][0].delta_peak_percent == pytest.approx(-10.0, abs=0.01)
    assert found.samples_to_peak(ACROSS, RATE) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("scale", [1.02, 0.98])
def test_a_template_of_another_scale_is_found_however_its_axes_lie(scale):
    turn = Rotation.from_rotvec([0.3, -0.5, 1.1])
    other = {name: tuple(scale * turn.apply(point) + [0.1, 0, -0.2]) for name, point in TEMPLATE.items()}
    found_scale, rest = template_fit(TEMPLATE, other)
    assert found_scale == pytest.approx(scale, rel=1e-12)
    assert rest < 1e-12
    found = agreement(laboratory("north"), laboratory("south", changes={"template": other}))
    assert found.inputs["template_scale_percent"] == pytest.approx(100 * (scale - 1))
    assert (
        f"is 2.00 % {'larger' if scale > 1 else 'smaller'} than that of north"
        in found.details["template_scale_percent"]
    )


def test_a_landmark_put_elsewhere_or_a_mirrored_template_leaves_a_residual():
    moved = TEMPLATE | {"A": (0.18, 0.01, -0.04)}
    assert template_fit(TEMPLATE, moved)[1] > 1e-3
    mirrored = {name: (x, -y, z) for name, (x, y, z) in TEMPLATE.items()}
    assert template_fit(TEMPLATE, mirrored)[1] > 0.01


def test_what_was_not_stated_has_no_power_and_says_why():
    bare = {"template": {}, "helmet_to_com_m": None, "cutoffs_hz": {}, "video_sha256": "", "noise_along_m_per_s2": None}
    found = agreement(laboratory("north"), laboratory("south", changes=bare))
    reasons = {name: value for name, value in found.inputs.items() if isinstance(value, str)}
    assert set(reasons) == {
        "same_video",
        "template_scale_percent",
        "template_residual_mm",
        "helmet_to_com_difference_mm",
        "same_filters",
    }
    assert isinstance(found.along_ray_over_noise, str)
    assert "2 landmarks have one name" in template_fit(TEMPLATE, {"A": (0, 0, 0), "B": (1, 0, 0)})


def test_other_inputs_are_told():
    changes = {"rate_hz": RATE * 1.001, "cutoffs_hz": {"linear": 60.0}, "video_sha256": "b" * 64}
    found = agreement(laboratory("north"), laboratory("south", changes=changes | {"helmet_to_com_m": (0.01, 0, 0.04)}))
    assert found.inputs["frame_rate_difference_percent"] == pytest.approx(0.1)
    assert found.inputs["helmet_to_com_difference_mm"] == pytest.approx(10.0)
    assert (found.inputs["same_filters"], found.inputs["same_video"]) == (False, False)
