"""Stage ``bundle``: one archive that another laboratory can verify; a rejected play is sealed too."""

from __future__ import annotations

from pathlib import Path

from replay.bundle import seal, verify
from replay.stages.frame import STAGES, Workspace, check_stage


def run(workspace: Workspace) -> str | None:
    """Seal everything the stages made, and verify the archive once as its receiver will.

    Raises
    ------
    InputError
        When a stage is missing: a play that was stopped has the manifests of its skipped stages, so a bundle
        without one would hide something.
    """
    for stage in STAGES:
        check_stage(workspace, stage)
    destination = workspace.folder("bundle") / f"{workspace.play}.zip"
    records = Path(".snakemake/metadata")
    digest = seal(
        workspace.results / workspace.play,
        destination,
        play_folder=workspace.plays / workspace.play,
        job_records=records if records.is_dir() else None,
    )
    verify(destination)
    print(f"{destination}: sealed and verified, sha256 {digest}")
    return None
