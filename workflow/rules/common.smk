# What the rules share: the plays, what each asks of a machine, the sources a stage stands on, the results' lock.
import fcntl
import os
from functools import cache
from pathlib import Path

import yaml
from snakemake.exceptions import WorkflowError

from replay.errors import ReplayError
from replay.play import (
    ADDRESS,
    estimate,
    members_of,
    overridden,
    read_ensemble,
    read_plays_table,
)
from replay.play.ensemble import ENDING
from replay.sources import sources_of

SOURCE = Path(workflow.basedir) / "src" / "replay"
PLAYS = config["plays_folder"]
TABLE = config.get("table") or ""
PLAY = "[a-z0-9_-]+"
# A resource and no parameter: it changes no result, and changing it runs nothing again.
CHECKPOINT_S = int(config.get("checkpoint_every_s") or 10)
WRITTEN_OUT = "results/plays.d"
TRACKS = ("clicks", "landmarks", "camera", "video", "kinematics")
PIECES = ("helmet", "facemask", "pads", "chinstrap")
_held = []


# ---------------------------------------------------------------- the plays
def read_table():
    """Rows of the table of plays by name; a table that cannot be read stops everything, with its line and column."""
    if not TABLE or not Path(TABLE).is_file():
        return {}
    try:
        return read_plays_table(Path(TABLE))
    except ReplayError as error:
        raise WorkflowError(str(error)) from None


ROWS = read_table()


def base_of(play):
    """Folder of the described play that a play is made of."""
    return Path(PLAYS) / (ROWS[play].base if play in ROWS else play)


def description(wildcards):
    """The play's description: written out from the table where a row of it changes anything."""
    play = wildcards.play
    if play in ROWS and not ROWS[play].is_a_folder:
        return f"{WRITTEN_OUT}/{play}/play.yaml"
    return (Path(PLAYS) / play / "play.yaml").as_posix()


@cache
def said(play):
    """What the play's description and its row say, unchecked; what is wrong is the settings stage's to say."""
    try:
        text = (base_of(play) / "play.yaml").read_text(encoding="utf-8")
        return overridden(
            yaml.safe_load(text), ROWS[play].overrides if play in ROWS else {}
        )
    except (OSError, ValueError, TypeError, AttributeError, yaml.YAMLError):
        return {}


def play_files(wildcards):
    """The tracks, and the pieces of a helmet, that the play's description names."""
    names = []
    for block, keys in (("source", TRACKS), ("model", PIECES)):
        given = said(wildcards.play).get(block)
        names += [given.get(key) for key in keys] if isinstance(given, dict) else []
    folder = base_of(wildcards.play)
    return [
        (folder / name).as_posix()
        for name in names
        if isinstance(name, str) and (folder / name).is_file()
    ]


def row_of(wildcards):
    """The play's row as text: what is written out depends on it, and on no other line of the table."""
    row = ROWS.get(wildcards.play)
    return f"{row.base}: {dict(row.overrides)}" if row else ""


def folder_of_plays(wildcards, input):
    """Folder that holds the folder of the play's description."""
    return Path(input.play).parents[1].as_posix()


# ---------------------------------------------------------------- ensembles
@cache
def members(ensemble):
    """Members of an ensemble (`demo.friction`) by their number."""
    play, _, name = ensemble.partition(".")
    try:
        file = base_of(play) / f"{name}{ENDING}"
        return members_of(play, name, read_ensemble(file))
    except ReplayError as error:
        raise WorkflowError(str(error)) from None


def member_of(address):
    """The member at an address (`demo.friction/003`), or None for a play."""
    if not ADDRESS.fullmatch(address):
        return None
    ensemble, _, number = address.partition("/")
    if number not in members(ensemble):
        raise WorkflowError(f"{ensemble} has no member {number}")
    return members(ensemble)[number]


def ensembles():
    """Every ensemble described beside a play that is to be run."""
    return [
        f"{play}.{path.name.removesuffix(ENDING)}"
        for play in SEASON
        for path in sorted(base_of(play).glob(f"*{ENDING}"))
    ]


def ensemble_file(wildcards):
    """Where an ensemble is described: beside the play, or beside the base of the play's row."""
    return (base_of(wildcards.play) / f"{wildcards.ensemble}{ENDING}").as_posix()


def stage(name):
    """The manifest that a stage writes last, when all its files are on the disk with their hashes."""
    return f"results/{{play}}/{name}/manifest.json"


def of(name):
    """Manifest of a stage that a member of an ensemble may share with its play or with another member."""

    def manifest(wildcards):
        member = member_of(wildcards.play)
        owner = member.owners.get(name, wildcards.play) if member else wildcards.play
        return f"results/{owner}/{name}/manifest.json"

    return manifest


def placement(wildcards):
    """Where two players stand; one driven head has no such stage."""
    play = wildcards.play.partition(".")[0]
    return [of("placement")(wildcards)] if said(play).get("collision") else []


def recorded(wildcards):
    """Whether the head's motion was recorded; without a record nothing is reconstructed and nothing compared."""
    source = said(wildcards.play.partition(".")[0]).get("source")
    return not isinstance(source, dict) or source.get("kind") != "none"


def reconstruction(wildcards):
    """The reconstruction, of a play that has a record."""
    return [of("reconstruction")(wildcards)] if recorded(wildcards) else []


def evidence(*more):
    """Manifests of every stage before the verdict that a play of its mode has, and more."""

    def manifests(wildcards):
        here = [s for s in EVIDENCE if recorded(wildcards) or s not in OF_RECORDS]
        return [*map(stage, (*here, *more)), *placement(wildcards)]

    return manifests


def settings_of(address):
    """What the description of a play says, with what a member of an ensemble replaces; unchecked."""
    member = member_of(address)
    return overridden(
        said(address.partition(".")[0]), member.overrides if member else {}
    )


def helmet_files(wildcards):
    """The stage that copied the files which describe a play's helmet, where there are any."""
    model = settings_of(wildcards.play).get("model")
    named = [model.get(piece) for piece in PIECES] if isinstance(model, dict) else []
    if any(
        isinstance(name, str) and name.endswith((".yaml", ".yml")) for name in named
    ):
        return of("inputs")(wildcards)
    return []


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
OF_RECORDS = ("reconstruction", "fidelity")
SEASON = tuple(ROWS) or tuple(config["plays"])


# ---------------------------------------------------------------- what a job asks for
@cache
def asks(address):
    """Estimate of one replay of a play or member."""
    settings = settings_of(address)
    model, window = settings.get("model") or {}, settings.get("window") or {}
    resolution = config.get("resolution")
    if not resolution and isinstance(model, dict):
        resolution = model.get("resolution", "coarse")
    duration = window.get("duration_s", 0.03) if isinstance(window, dict) else 0.03
    duration = duration if isinstance(duration, (int, float)) else 0.03
    return estimate(
        str(resolution), duration, most_threads=config.get("most_threads") or 16
    )


def solver_threads(wildcards):
    return asks(wildcards.play).threads


def memory(wildcards):
    return asks(wildcards.play).memory_mb


def minutes(wildcards):
    return asks(wildcards.play).minutes


# ---------------------------------------------------------------- sources, logs, lock
@cache
def code(*stages):
    """Source files that the named stages stand on, with those their imports lead to: an edit reruns the stage."""
    files = {
        file
        for name in stages
        for file in sources_of(SOURCE / "stages" / f"{name}.py", SOURCE)
    }
    return sorted(file.relative_to(SOURCE.parents[1]).as_posix() for file in files)


def log(name):
    return f"results/{{play}}/logs/{name}.log"


def cost(name):
    return f"results/{{play}}/logs/{name}.benchmark.tsv"


def share_compiled_kernels():
    """Keep compiled kernels beside the workflow where the home folder cannot be written, as on some compute nodes."""
    if not os.access(Path.home(), os.W_OK):
        os.environ.setdefault(
            "NUMBA_CACHE_DIR", str(Path(workflow.basedir) / ".numba_cache")
        )


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
