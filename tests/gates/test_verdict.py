"""The verdict on a play: worst gate wins, what was not looked at is not accepted, loosened limits are printed."""

from __future__ import annotations

import flawless_play as flawless

from replay.gates import Limits, hourglass_sensitivity_gate, play_verdict, video_reconstruction_gate


def test_flawless_play_is_accepted(limits):
    verdict = play_verdict("demo", flawless.all_gates(limits), limits)
    assert verdict.status == "accepted"
    assert verdict.line() == "demo: accepted"
    assert verdict.causes == ()


def test_warning_is_carried_to_the_verdict_and_named(limits):
    gates = flawless.all_gates(limits) | {"hourglass_sensitivity": hourglass_sensitivity_gate(None, limits)}
    verdict = play_verdict("demo", gates, limits)
    assert verdict.status == "accepted with warnings"
    assert verdict.line().startswith("demo: accepted with warnings; hourglass_sensitivity.strain_difference no value")


def test_failed_gate_that_stops_rejects_and_excuses_the_rest(limits):
    bad = flawless.GOOD["video"] | {"reprojection_rmse_median_px": 9.0, "pixels_per_metre": 100.0}
    gates = {"helmet": flawless.all_gates(limits)["helmet"], "reconstruction": video_reconstruction_gate(bad, limits)}
    verdict = play_verdict("demo", gates, limits)
    assert verdict.status == "rejected"
    assert verdict.stopped_by == "reconstruction"
    assert verdict.not_evaluated == ("assembly", "shake", "numerics", "hourglass_sensitivity", "fidelity")
    assert verdict.line() == (
        "demo: rejected; stopped by the gate reconstruction; "
        "reconstruction.reprojection_rmse_median_px 9 px (limit <= 8 px)"
    )
    assert [check.verdict for _, check in verdict.causes] == ["fail", "warn"]


def test_gate_that_sets_the_verdict_rejects_without_stopping(limits):
    from replay.gates import fidelity_gate

    bad = flawless.GOOD_FIDELITY | {"position_residual_mm": 0.2}
    gates = flawless.all_gates(limits) | {"fidelity": fidelity_gate(bad, limits)}
    verdict = play_verdict("demo", gates, limits)
    assert (verdict.status, verdict.stopped_by) == ("rejected", "")


def test_gate_that_was_forgotten_rejects(limits):
    gates = flawless.all_gates(limits)
    del gates["shake"]
    verdict = play_verdict("demo", gates, limits)
    assert verdict.status == "rejected"
    assert "not evaluated: shake" in verdict.line()


def test_package_may_come_after_the_verdict_but_only_when_awaited(limits):
    gates = flawless.all_gates(limits)
    del gates["package"]
    assert play_verdict("demo", gates, limits).status == "accepted"
    assert play_verdict("demo", gates, limits, awaited=()).status == "rejected"


def test_loosened_limit_stands_in_the_verdict_line_even_of_an_accepted_play():
    limits = Limits.load({"reconstruction.reprojection_rmse_median_px": 12})
    verdict = play_verdict("demo", flawless.all_gates(limits), limits)
    assert verdict.status == "accepted"
    assert verdict.line() == (
        "demo: accepted; LOOSENED reconstruction.reprojection_rmse_median_px: <= 12 instead of <= 8"
    )
    assert verdict.to_json()["loosened"][0]["instead_of"] == "<= 8"


def test_many_causes_are_counted_not_all_printed(limits):
    bad = dict.fromkeys(flawless.GOOD["video"], 1e3) | {"frames_above_8_px": 5}
    gates = flawless.all_gates(limits) | {"reconstruction": video_reconstruction_gate(bad, limits)}
    verdict = play_verdict("demo", gates, limits)
    assert "more" in verdict.line()
    assert len(verdict.to_json()["causes"]) > 3
