"""Stage ``settings``: the play's description, checked and resolved, as an artifact of the run.

A member of an ensemble takes its play's resolved settings and replaces those that its ensemble varies.
"""

from __future__ import annotations

from pathlib import Path

from replay.documents import check_settings
from replay.errors import InputError
from replay.files import read_json, write_json
from replay.gates import Limits
from replay.models import load_design
from replay.play import ADDRESS, ModelChoice, Play, load_play, members_of, overridden, read_ensemble
from replay.stages.frame import MEMBER, Stage, Workspace, check_stage
from replay.stages.resolved import FILE, ensemble_file


def run(workspace: Workspace, *, resolution: str | None = None, ensemble: Path | None = None) -> str | None:
    """Check ``play.yaml`` and write it with every default and override spelled out.

    Parameters
    ----------
    workspace
        Where the play's files are.
    resolution
        Replaces the play's own ``model.resolution``.
    ensemble
        Description of the ensemble, for a member; the one beside its play by default.
    """
    if ADDRESS.fullmatch(workspace.play):
        return _run_member(workspace, ensemble or ensemble_file(workspace))
    play = load_play(workspace.description)
    Limits.load(play.gates, file=workspace.description)
    if resolution:
        choice = ModelChoice.model_validate({**play.model.model_dump(), "resolution": resolution})
        play = play.model_copy(update={"model": choice})
    load_design(*play.model.helmet_pieces, folder=play.folder)
    stage = Stage(workspace, "settings")
    stage.read_file("play.yaml", workspace.description)
    source = {
        key: Path(value).name if value in play.source.files else value
        for key, value in play.source.model_dump(mode="json").items()
    }
    model = {
        key: Path(value).name if value in play.model.files else value
        for key, value in play.model.model_dump(mode="json").items()
    }
    resolved = {**play.model_dump(mode="json"), "source": source, "model": model}
    write_json(stage.write(FILE, "the play with every default spelled out"), resolved)
    print(f"{play.name}: {play.title or 'no title'} ({play.source.kind}, {play.model.resolution})")
    return stage.finish()


def _run_member(workspace: Workspace, file: Path) -> str | None:
    match = ADDRESS.fullmatch(workspace.play)
    assert match
    members = members_of(match["play"], match["ensemble"], read_ensemble(file))
    if match["member"] not in members:
        raise InputError(file, f"has no member {match['member']}", expected=f"{', '.join(members)}")
    member = members[match["member"]]
    original = Workspace(match["play"], results=workspace.results)
    check_stage(original, "settings")
    settings = original.folder("settings") / FILE
    play = check_settings(file, Play, overridden(read_json(settings), member.overrides))
    Limits.load(play.gates, file=file)
    stage = Stage(workspace, "settings")
    stage.read_file("settings/play.json", settings)
    write_json(stage.write(FILE, "the member's settings with every default spelled out"), play.model_dump(mode="json"))
    write_json(
        stage.write(MEMBER, "what the member overrides, and whose stages it shares"),
        {"varied": member.varied, "overrides": member.overrides, "shared": member.owners},
    )
    print(f"{member.address}: " + ", ".join(f"{path} = {value}" for path, value in member.varied.items()))
    return stage.finish()
