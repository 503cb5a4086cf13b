# What the rules share: which sources a stage stands on, and the lock on the results folder.
import fcntl
from pathlib import Path

import yaml

SOURCE = Path(workflow.basedir) / "src" / "replay"
LEAVES = (
    "documents.py",
    "errors.py",
    "files.py",
    "tables.py",
    "manifest.py",
    "play",
)
PLAYS = config["plays_folder"]
TRACKS = ("clicks", "landmarks", "camera", "video", "kinematics")
PIECES = ("helmet", "facemask", "pads", "chinstrap")
_held = []


def code(*rooms):
    """Source files of the named rooms (folders or files of the package) and of the leaves all rooms use.

    Snakemake does not see imports; as inputs, an edit of any of them reruns the stage.
    """
    files = []
    for room in (*LEAVES, *rooms):
        path = SOURCE / room
        files += (
            sorted(p for p in path.rglob("*") if p.suffix in (".py", ".yaml"))
            if path.is_dir()
            else [path]
        )
    return [p.relative_to(workflow.basedir).as_posix() for p in files]


def play_files(wildcards):
    """The tracks, and the pieces of a helmet, that the play's description names; what is wrong with it is the settings stage's to say."""
    folder = Path(PLAYS) / wildcards.play
    try:
        play = yaml.safe_load((folder / "play.yaml").read_text(encoding="utf-8"))
        source, model = play["source"], play.get("model", {})
        names = [source[key] for key in TRACKS if isinstance(source.get(key), str)]
        names += [model[key] for key in PIECES if isinstance(model.get(key), str)]
    except (OSError, ValueError, TypeError, KeyError, AttributeError, yaml.YAMLError):
        return []
    return [(folder / name).as_posix() for name in names if (folder / name).is_file()]


def folder_of_plays(wildcards, input):
    """Folder that holds the folder of the play's description."""
    return Path(input.play).parents[1].as_posix()


def stage(name):
    """The manifest that a stage writes last, when all its files are on the disk with their hashes."""
    return f"results/{{play}}/{name}/manifest.json"


def collides(wildcards):
    """Whether the play is a collision; what is wrong with its description is the settings stage's to say."""
    try:
        path = Path(PLAYS) / wildcards.play / "play.yaml"
        return bool(yaml.safe_load(path.read_text(encoding="utf-8")).get("collision"))
    except (OSError, ValueError, AttributeError, yaml.YAMLError):
        return False


def placement(wildcards):
    """Where two players stand; one driven head has no such stage."""
    return [stage("placement")] if collides(wildcards) else []


def evidence(*more):
    """Manifests of every stage before the verdict that a play of its mode has, and more."""

    def manifests(wildcards):
        return [*map(stage, (*EVIDENCE, *more)), *placement(wildcards)]

    return manifests


# Every stage before the verdict. What reads them all names them all: a stage whose files were removed is run again.
EVIDENCE = (
    "settings",
    "inputs",
    "reconstruction",
    "driver",
    "assembly",
    "decks",
    "shake",
    "replay",
    "sensitivity",
    "fidelity",
    "measures",
)


def log(name):
    return f"results/{{play}}/logs/{name}.log"


def hold_results_lock():
    """Refuse a second run in this folder.

    The kernel drops this lock with the process, however it dies: unlike Snakemake's own lock file, a
    killed run leaves nothing to unlock, so the next `snakemake` just goes on (profile: nolock).
    """
    Path("results").mkdir(exist_ok=True)
    handle = open("results/.lock", "w")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise SystemExit(
            "another run works in this folder's results/: wait for it, or run in another checkout"
        ) from None
    _held.append(handle)
