"""Commands that stand beside the chain of stages: looking at a result, making a play or a model."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from replay import models
from replay.errors import InputError
from replay.files import read_json, write_text
from replay.gates import Gate, Limits, read_gate
from replay.motion import Kinematics, synthesise
from replay.motion.digitise import digitise, digitising_report, write_digitised
from replay.motion.synthetic import (
    TEN,
    Flaws,
    Impact,
    Motion,
    Preset,
    RecordedMotion,
    SyntheticCamera,
    draw_impact,
    film,
    footage_play,
)
from replay.motion.synthetic.headform import headform_record
from replay.motion.tracking import Following
from replay.play import load_play, play_schema_text
from replay.stages.player import add_body
from replay.stages.verdict import ALL_GATE_FILES

_COLOURS = {"pass": "32", "warn": "33", "fail": "31", "not reached": "90"}


_HEADFORM_SEED = 20240911


def show_verdict(results: Path) -> int:
    """Print the verdict of a run, every gate, and where its page and bundle are.

    Returns
    -------
    int
        0 when accepted, 3 when rejected.
    """
    path = results / "verdict" / "verdict.json"
    if not path.is_file():
        raise InputError(path, "there is no verdict here", mend=f"run `make run PLAY={results.name}` first")
    verdict = read_json(path)
    play = read_json(results / "settings" / "play.json")
    recorded = play.get("source", {}).get("kind") != "none"
    limits = Limits.load(mode="collision" if play.get("collision") else "driver", recorded=recorded)
    found: dict[str, Gate] = {}
    for stage, files in ALL_GATE_FILES.items():
        for file in files:
            if (results / stage / file).is_file():
                judged = read_gate(results / stage / file, limits)
                found[judged.name] = judged
    print(f"\n{results.name}: {verdict['status'].upper()}\n")
    for name, facts in limits.protocol.items():
        gate = found.get(name)
        word = gate.verdict if gate else "not reached"
        print(f"  {_coloured(word):<20} {facts.title} [{name}]")
        for line in gate.cause_lines() if gate else ():
            print(f"      {line}")
    for entry in verdict["loosened"]:
        print(f"  LOOSENED {entry['gate']}.{entry['check']}: {entry['limit']} instead of {entry['instead_of']}")
    page, archive = results / "report" / "report.html", results / "bundle" / f"{results.name}.zip"
    print()
    for label, path in (("report", page), ("bundle", archive)):
        if path.is_file():
            print(f"  {label}: {path}")
    print("\n  These are process diagnostics: no statement on injury or on a player.")
    return 3 if verdict["status"] == "rejected" else 0


def _coloured(word: str) -> str:
    return f"\033[{_COLOURS[word]}m{word}\033[0m" + " " * (11 - len(word)) if sys.stdout.isatty() else word


def write_synthetic_play(kind: str, into: Path, seed: int | None) -> int:
    """Write one of the synthetic plays, with its truth and its description, into a new folder."""
    _refuse_full(into)
    shipped = Path(__file__).resolve().parents[3] / "config" / "plays" / kind / "play.yaml"
    if not shipped.is_file():
        raise InputError(shipped, "the shipped play is not here", mend="run from a checkout of the project")
    synthesise(cast(Preset, kind), seed).write(into)
    text = shipped.read_text(encoding="utf-8").replace(f"\nname: {kind}\n", f"\nname: {into.name}\n")
    write_text(into / "play.yaml", text)
    load_play(into)
    print(f"{into}: a play of kind {kind} with its truth\nrun it: make run PLAY={into.name} PLAYS={into.parent}")
    return 0


def _refuse_full(into: Path) -> None:
    if into.exists() and (not into.is_dir() or any(into.iterdir())):
        raise InputError(into, "the folder is not empty", mend="name a new folder")


def write_synthetic_footage(asked: dict[str, Any]) -> int:
    """Write a play of any footage, with its truth.

    Parameters
    ----------
    asked
        Arguments of ``replay synth footage`` by name.
    """
    into, seed = asked["into"], asked["seed"] or 0
    _refuse_full(into)
    at = (0.0, asked["distance"], 0.0)
    motion: Motion = replace(Impact(family=asked["family"]), position_m=at)
    if asked["motion"] is not None:
        motion = RecordedMotion.read(asked["motion"], position_m=at)
    elif asked["draw"]:
        motion = draw_impact(np.random.default_rng(seed), asked["family"], at)
    half = max(round(0.15 * asked["fps"]), 9)
    camera = SyntheticCamera(
        asked["fps"],
        -half,
        half,
        (1920, 1080),
        asked["focal"],
        asked["click_sigma"],
        landmarks=TEN[: asked["landmarks"]],
        zoom_per_s=asked["zoom"],
        pan_rad_per_s=asked["pan"],
        row_time_s=asked["row_time"],
        static_points_m={} if asked["pan"] == 0.0 else _background(asked["distance"], asked["focal"]),
    )
    flaws = Flaws(blur_share=asked["blur"], occluded_share=asked["occlusion"], outlier_share=asked["outliers"])
    footage = film(motion, camera, seed=seed, flaws=flaws)
    footage_play(motion, footage, footage.settings(), into.name).write(into)
    load_play(into)
    print(f"{into}: a play with its truth\nrun it: make run PLAY={into.name} PLAYS={into.parent}")
    return 0


def _background(distance_m: float, focal_px: float) -> dict[str, tuple[float, float, float]]:
    """Three static points behind the head, inside the picture."""
    reach = 2.0 * distance_m / focal_px
    return {
        "S1": (-400.0 * reach, 2.0 * distance_m, 200.0 * reach),
        "S2": (350.0 * reach, 2.0 * distance_m, 250.0 * reach),
        "S3": (100.0 * reach, 2.0 * distance_m, -300.0 * reach),
    }


def write_headform_record(motion: Path | None, into: Path, seed: int | None) -> int:
    """Write ``headform.csv`` of a recorded motion, such as the ``head_motion.csv`` of a replay."""
    if motion is None:
        raise InputError(into, "no motion is given", expected="--motion KINEMATICS.csv", mend="name a head_motion.csv")
    write_text(
        into / "headform.csv", headform_record(Kinematics.read(motion), _HEADFORM_SEED if seed is None else seed)
    )
    print(f"{into / 'headform.csv'}: the record of a headform that made the motion of {motion}")
    return 0


def digitise_video(
    video: Path, seeds: Path, out: Path, frames: tuple[int | None, int | None], click_sigma_px: float, patch_px: int
) -> int:
    """Follow clicked landmarks through a video, write the click table, say what was lost and where to click again."""
    how = Following(patch_px=patch_px | 1)
    found, facts = digitise(video, seeds, first=frames[0], last=frames[1], how=how)
    write_digitised(out, found, click_sigma_px)
    print(digitising_report(found, facts))
    print(f"{out}: a click table for `source.clicks` of a play")
    return 0


def write_model_file(
    preset: str,
    resolution: str,
    pieces: Sequence[str | None],
    out: Path,
    preview: Path | None,
    body: dict[str, Any] | None = None,
    apparatus: str | None = None,
) -> int:
    """Build a model by itself, print its tables and write it.

    Parameters
    ----------
    preset, resolution
        Of `replay.models.build_model`.
    pieces
        Helmet, facemask, pads and chin strap, by name or YAML file found from here; None for the helmet's own.
    out, preview
        Files to write.
    body
        ``posture``, and fields of `replay.models.BodyPlan`; none for a head and helmet alone.
    apparatus
        Name of a laboratory's apparatus, to be built in place of them.
    """
    if apparatus is not None:
        model = models.build_apparatus(apparatus, resolution)
        models.write_model(out, model)
        print(models.summary_text(model))
        if preview is not None:
            models.write_preview(preview, model)
        return 0
    helmet, *others = pieces
    model = models.build_model(preset, resolution, design=models.load_design(helmet or "classic", *others))
    if body is not None:
        facts = dict(body)
        model = add_body(model, facts.pop("posture"), models.BodyPlan(**facts))
    models.write_model(out, model)
    print(models.summary_text(model))
    print(models.comparison_text(model))
    if body is not None:
        print("\n" + models.segments_text(model))
    if preview is not None:
        models.write_preview(preview, model)
    return 0


def write_schema(out: Path | None) -> int:
    """Print or write the JSON schema of play.yaml."""
    if out is None:
        sys.stdout.write(play_schema_text())
    else:
        write_text(out, play_schema_text())
    return 0
