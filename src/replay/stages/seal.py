"""Stage ``bundle``: one archive that another laboratory can verify; a rejected play is sealed too."""

from __future__ import annotations

from pathlib import Path

from replay.bundle import seal, verify
from replay.stages.frame import Workspace


def run(workspace: Workspace) -> str | None:
    """Seal everything the stages made, and verify the archive once as its receiver will."""
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
