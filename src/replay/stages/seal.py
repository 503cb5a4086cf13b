"""Stage ``bundle``: one archive that another laboratory can verify; a rejected play is sealed too."""

from __future__ import annotations

from pathlib import Path

from replay.bundle import seal, verify
from replay.files import read_json
from replay.manifest import NAME
from replay.stages.frame import Workspace, check_stage, stages_of


def run(workspace: Workspace, *, interrupted: bool = False) -> str | None:
    """Seal everything the stages made, and verify the archive once as its receiver will.

    Parameters
    ----------
    workspace
        Where the play's files are.
    interrupted
        Seal what there is of a run that did not come to its end; the bundle says so and names what is missing.

    Raises
    ------
    InputError
        When a stage is missing: a play that was stopped has the manifests of its skipped stages, so a bundle
        without one would hide something.
    """
    stages = stages_of(workspace)
    unfinished = [stage for stage in stages if interrupted and not (workspace.folder(stage) / NAME).is_file()]
    for stage in stages:
        if stage not in unfinished:
            check_stage(workspace, stage)
    destination = workspace.folder("bundle") / f"{workspace.play}.zip"
    records = Path(".snakemake/metadata")
    digest = seal(
        workspace.results / workspace.play,
        destination,
        play_folder=workspace.plays / workspace.play,
        job_records=records if records.is_dir() else None,
        withhold=_withheld(workspace),
        unfinished=unfinished,
    )
    sealed = verify(destination)
    print(f"{destination}: {sealed.verdict}, sealed and verified, sha256 {digest}, results {sealed.results_sha256}")
    return None


def _withheld(workspace: Workspace) -> dict[str, str]:
    """Payload paths of the files that the play withholds, as they were described and as they were copied."""
    settings = workspace.folder("settings") / "play.json"
    withheld = read_json(settings).get("withhold", {}) if settings.is_file() else {}
    paths = {f"plays/{workspace.play}/{name}": reason for name, reason in withheld.items()}
    for name, reason in withheld.items():
        if (workspace.folder("inputs") / name).is_file():
            paths[f"results/inputs/{name}"] = reason
    return paths
