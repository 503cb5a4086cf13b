"""Stage ``inputs``: the raw tracks as they came, checked, kept with their hashes."""

from __future__ import annotations

import shutil

from replay.errors import InputError
from replay.files import atomic_path, sha256, write_json
from replay.motion import check_tracks
from replay.play import load_play
from replay.stages.frame import Stage, Workspace


def run(workspace: Workspace) -> str | None:
    """Read every track once, so that a bad one is refused before anything runs, and keep copies."""
    play = load_play(workspace.description)
    facts = check_tracks(play)
    stage = Stage(workspace, "inputs", after=["settings"])
    stage.read("settings", "play.json")
    names = [path.name for path in play.files]
    for path in play.files:
        if names.count(path.name) > 1:
            raise InputError(
                workspace.description, f"two tracks are called {path.name}", mend="rename one of the two files"
            )
    record = []
    for path in play.files:
        with atomic_path(stage.write(path.name, "raw track, as it came")) as temporary:
            shutil.copyfile(path, temporary)
        record.append({"file": path.name, "bytes": path.stat().st_size, "sha256": sha256(path)})
    write_json(
        stage.write("inputs.json", "what came in: files, hashes, facts of the tracks"),
        {"play": play.name, "kind": play.source.kind, "files": record, "facts": facts},
    )
    return stage.finish()
