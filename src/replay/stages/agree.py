"""Agreement of laboratories: do those that digitised one play by themselves recover one driver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from replay.bundle import SealedRun, foreign_content, open_run, shown
from replay.errors import InputError
from replay.files import write_json
from replay.gates import Gate, Limits, agreement_gate, read_gate
from replay.measures import Agreement, Digitisation, Motion, agreement
from replay.motion import DRIVER, KINEMATICS
from replay.motion.settings import load_camera
from replay.motion.tracks import read_template

_OWN_GATES = {
    "reconstruction": "results/reconstruction/gate.json",
    "helmet": "results/assembly/gate_helmet.json",
    "shake": "results/shake/gate.json",
    "fidelity": "results/fidelity/gate.json",
}
_DRIVER = "results/driver/driver_6dof.csv"


@dataclass(frozen=True)
class Laboratory:
    """One bundle's part in the comparison.

    Parameters
    ----------
    name
        Of the laboratory: its file's name where that tells it apart, else its path.
    digitisation
        Its motion and inputs.
    gates
        Verdicts of its own gates, None for one that was not reached.
    limits_as_shipped
        Whether it loosened no limit of those gates.
    facts
        Rows of the table side by side: label to text.
    """

    name: str
    digitisation: Digitisation
    gates: dict[str, str | None]
    limits_as_shipped: bool
    facts: dict[str, str]

    def for_gate(self) -> dict[str, Any]:
        """Return what the agreement gate judges of the laboratory itself."""
        failed = [gate for gate, verdict in self.gates.items() if verdict == "fail"]
        missing = [gate for gate, verdict in self.gates.items() if verdict is None]
        passed: bool | str = not failed
        if missing and not failed:
            passed = f"the play was not carried as far as {', '.join(missing)}"
        detail = f"failed: {', '.join(failed)}" if failed else ""
        return {
            "own_gates_passed": passed,
            "own_gates_passed_detail": detail,
            "limits_as_shipped": self.limits_as_shipped,
        }


def agree(bundles: Sequence[Path], out: Path | None = None) -> int:
    """Compare every pair of digitisations of one play, print them side by side and say whether they agree.

    Parameters
    ----------
    bundles
        Bundles, unpacked bundles or results folders; results up to stage ``drive`` suffice.
    out
        JSON file for all of it.

    Returns
    -------
    int
        0 when every pair is accepted, 3 when one is refused.
    """
    if len(bundles) < 2:
        raise InputError(bundles[0], "is one bundle alone", expected="two or more", mend="name the other laboratory's")
    laboratories = [_read(path, name) for path, name in zip(bundles, _names(bundles))]
    print(_side_by_side(laboratories))
    pairs = [(one, other, *_judge(one, other)) for one, other in combinations(laboratories, 2)]
    for _, _, found, gate in pairs:
        print(_pair_text(found, gate))
    refused = [(one.name, other.name) for one, other, _, gate in pairs if gate.verdict == "fail"]
    print(f"\n{_conclusion(laboratories, refused)}")
    if out is not None:
        write_json(out, _to_json(laboratories, pairs, accepted=not refused))
        print(f"{out}: written")
    return 3 if refused else 0


def _names(paths: Sequence[Path]) -> list[str]:
    stems = [path.stem if path.is_file() else path.resolve().name for path in paths]
    return stems if len(set(stems)) == len(stems) else [path.as_posix() for path in paths]


def _read(path: Path, name: str) -> Laboratory:
    with foreign_content(path), open_run(path) as run:
        play = run.json("results/settings/play.json")
        if _DRIVER not in run or play is None:
            reason = (run.json("results/driver/manifest.json") or {}).get("stopped_by") or "the run ended before it"
            raise InputError(
                path, f"has no driver to compare: {reason}", mend="a play needs an accepted reconstruction"
            )
        limits = Limits.load(play["gates"], file=path)
        gates: dict[str, str | None] = {
            gate: read_gate(run.file(file), limits).verdict if file in run else None
            for gate, file in _OWN_GATES.items()
        }
        loosened = [limit.name for limit in limits.loosened if limit.name.partition(".")[0] in _OWN_GATES]
        quality = run.json("results/reconstruction/quality.json")
        digitisation = _digitisation(run, name, play["source"], quality)
        verdict = (run.json("results/verdict/verdict.json") or {}).get("status", "not judged")
    facts = _facts(digitisation, quality, gates, verdict)
    return Laboratory(name, digitisation, gates, not loosened, facts)


def _digitisation(run: SealedRun, name: str, source: Mapping[str, Any], quality: Mapping[str, Any]) -> Digitisation:
    start = run.json("results/driver/initial_velocity.json")["time_s"]
    driver = _columns(DRIVER.read(run.file(_DRIVER)))
    driver["time_s"] = driver["time_s"] + start
    record = _columns(KINEMATICS.read(run.file("results/reconstruction/kinematics.csv")))
    inputs = {entry["file"]: entry["sha256"] for entry in run.json("results/inputs/inputs.json")["files"]}

    def track(key: str) -> Path | None:
        file = f"results/inputs/{source.get(key)}"
        return run.file(file) if file in run else None

    template, camera = track("landmarks"), track("camera")
    points = read_template(template) if template else None
    settings = load_camera(camera) if camera else None
    return Digitisation(
        name=name,
        record=Motion.from_columns(record),
        driver=Motion.from_columns(driver),
        t0_s=quality["t0_s"],
        rate_hz=quality["rate_hz"],
        from_camera=quality["kind"] == "clicks",
        noise_along_m_per_s2=quality["null_peaks"].get("a_along_m_per_s2"),
        template={n: tuple(p) for n, p in zip(points.names, points.points_m.tolist())} if points else {},
        helmet_to_com_m=settings.helmet_to_com if settings else None,
        cutoffs_hz=settings.cutoffs.model_dump() if settings else {},
        video_sha256=inputs.get(str(source.get("video")), ""),
    )


def _columns(table: pd.DataFrame) -> dict[str, np.ndarray]:
    return {name: table[name].to_numpy() for name in table}


def _facts(
    lab: Digitisation, quality: Mapping[str, Any], gates: Mapping[str, str | None], verdict: str
) -> dict[str, str]:
    start = lab.driver
    peaks = quality["peaks"]

    def vector(values: np.ndarray) -> str:
        return " ".join(f"{v:.2f}" for v in values)

    facts = {"verdict": verdict}
    facts |= {f"gate {gate}": found or "not reached" for gate, found in gates.items()}
    facts |= {
        "video": f"sha256 {lab.video_sha256[:12]}" if lab.video_sha256 else "not logged",
        "rate [Hz]": f"{lab.rate_hz:g}",
        "landmarks": str(len(lab.template)) if lab.template else "-",
        "t0 [ms], own clock": f"{1e3 * lab.t0_s:.2f}",
        "driver from [ms]": f"{1e3 * start.time_s[0]:.2f}",
        "v at its start [m/s]": vector(start.velocity_m_per_s[0]),
        "omega at its start [rad/s]": vector(start.angular_velocity_rad_per_s[0]),
    }
    labels = {
        "omega_rad_per_s": "peak omega [rad/s]",
        "alpha_rad_per_s2": "peak alpha [rad/s^2]",
        "a_across_m_per_s2": "peak a across ray [m/s^2]",
        "a_along_m_per_s2": "peak a along ray [m/s^2]",
        "a_m_per_s2": "peak a [m/s^2]",
    }
    for name, label in labels.items():
        if name in peaks:
            noise = quality["null_peaks"].get(name)
            facts[label] = f"{peaks[name]:.4g}" + (f" (noise {noise:.3g})" if noise else "")
    return facts


def _judge(one: Laboratory, other: Laboratory) -> tuple[Agreement, Gate]:
    try:
        found = agreement(one.digitisation, other.digitisation)
    except ValueError as error:
        raise InputError(other.name, f"shares no time with {one.name}: {error}", mend="compare the same play") from None
    values: dict[str, Any] = {
        **found.inputs,
        **{f"{name}_detail": text for name, text in found.details.items()},
        "t0_difference_samples": found.t0_difference_samples,
        "along_ray_over_noise": found.along_ray_over_noise,
        "velocity_difference_m_per_s": found.velocity_difference_m_per_s,
        "spin_difference_rad_per_s": found.spin_difference_rad_per_s,
    }
    nothing = "the first laboratory's peak is zero"
    quantities: dict[str, dict[str, Any]] = {}
    for name, (comparison, rating) in found.quantities.items():
        judged = {
            "rmse_percent_of_peak": comparison.rmse_percent_of_peak,
            "delta_peak_percent": comparison.delta_peak_percent,
            "time_to_peak_difference_samples": found.samples_to_peak(name, one.digitisation.rate_hz),
            "iso_18571_rating": None if rating is None else rating.overall,
        }
        quantities[name] = {key: nothing if value is None else value for key, value in judged.items()}
    own = {laboratory.name: laboratory.for_gate() for laboratory in (one, other)}
    return found, agreement_gate(values, quantities, own, Limits.load())


def _side_by_side(laboratories: Sequence[Laboratory]) -> str:
    labels = list(dict.fromkeys(label for lab in laboratories for label in lab.facts))
    rows = [["", *(lab.name for lab in laboratories)]]
    rows += [[label, *(shown(lab.facts.get(label, "-")) for lab in laboratories)] for label in labels]
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows)


def _pair_text(found: Agreement, gate: Gate) -> str:
    word = "REFUSED" if gate.verdict == "fail" else "accepted"
    lines = [f"\n{found.second} against {found.first}: {word}"]
    if found.clock_shift_samples:
        lines.append(f"  the clocks differ by {found.clock_shift_samples} frames; compared on that of {found.first}")
    for name, (comparison, rating) in found.quantities.items():
        if comparison.rmse_percent_of_peak is None or rating is None:
            lines.append(f"  {name}: zero or constant")
            continue
        lines.append(
            f"  {name}: RMSE {comparison.rmse_percent_of_peak:.1f} % of peak, peak "
            f"{comparison.delta_peak_percent:+.1f} % and {comparison.delta_time_to_peak_ms:+.2f} ms, "
            f"ISO/TS 18571 {rating.overall:.2f} ({rating.grade})"
        )
    return "\n".join([*lines, *(f"  {line}" for line in gate.cause_lines())])


def _conclusion(laboratories: Sequence[Laboratory], refused: Sequence[tuple[str, str]]) -> str:
    if not refused:
        return f"accepted: {len(laboratories)} laboratories recover one driver within the shipped limits"
    every = {lab.name for lab in laboratories}
    odd = [name for name in sorted(every) if all(name in pair for pair in refused)]
    pairs = ", ".join(f"{other} against {one}" for one, other in refused)
    told = f"; all of them with {odd[0]}" if len(odd) == 1 and len(every) > 2 else ""
    return f"refused: {pairs}{told}"


def _to_json(
    laboratories: Sequence[Laboratory],
    pairs: Sequence[tuple[Laboratory, Laboratory, Agreement, Gate]],
    *,
    accepted: bool,
) -> dict[str, Any]:
    return {
        "accepted": accepted,
        "laboratories": [{"name": lab.name, **lab.facts} for lab in laboratories],
        "pairs": [
            {
                "first": found.first,
                "second": found.second,
                "clock_shift_samples": found.clock_shift_samples,
                "quantities": {
                    name: {**comparison.to_json(), "iso_18571": vars(rating) if rating else None}
                    for name, (comparison, rating) in found.quantities.items()
                },
                **gate.to_json(),
            }
            for _, _, found, gate in pairs
        ],
    }
