"""The command line: one sub-command a stage, and the only place that parses arguments.

Exit codes: 0 done, 1 a bundle that does not verify, runs that differ or a run that could not go on, 2 an input
that cannot be used, 3 a gate that refuses the play.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from replay import __version__
from replay.errors import ReplayError

_STAGES: dict[str, tuple[str, str]] = {
    "settings": ("settings", "check play.yaml and write the resolved settings"),
    "inputs": ("inputs", "check the raw tracks and keep copies with their hashes"),
    "reconstruct": ("reconstruct", "tracks or wearable -> 6-DOF motion of the skull CG"),
    "assemble": ("assemble", "build the head and helmet; helmet and assembly gates"),
    "drive": ("drive", "resample the motion for the solver; how two players start"),
    "place": ("placement", "two players at first contact; placement gate"),
    "decks": ("decks", "write Velodyne-style and LS-DYNA run decks"),
    "shake": ("shake", "1 ms of free flight of the helmet alone"),
    "impact": ("impact", "the explicit replay"),
    "sensitivity": ("sensitivity", "the replay at half the hourglass coefficient"),
    "fidelity": ("fidelity", "applied motion against the target"),
    "measure": ("measure", "head, brain and action measures"),
    "judge": ("verdict", "collect the gates into one verdict"),
    "report": ("report", "figures and the self-contained page"),
    "seal": ("seal", "the sealed bundle"),
    "bands": ("bands", "bands of every measure over the members of an ensemble"),
}
_ALWAYS_RUN = ("settings", "inputs", "judge", "report", "seal", "bands")
_PULSES = ("sine_squared", "half_sine", "triangle", "skewed", "double")
_UNITS = ("m-kg-s", "mm-tonne-s", "mm-kg-ms", "mm-g-ms", "cm-g-us", "cm-g-s", "in-lbf-s")
_SOLVING = ("shake", "impact", "sensitivity")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="replay",
        description="One football play -> 6-DOF motion -> finite-element replay -> gates -> report -> sealed bundle.",
        epilog="The whole chain is `make run` or `snakemake`; every stage can be run by itself as well.",
    )
    parser.add_argument("--version", action="version", version=f"replay {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    for name, (_, text) in _STAGES.items():
        command = commands.add_parser(name, help=text, description=text)
        _add_workspace(command)
        if name == "settings":
            command.add_argument(
                "--resolution",
                default="as-the-play-says",
                choices=["as-the-play-says", "tiny", "coarse", "medium", "fine"],
                help="override model.resolution of the play",
            )
        if name in ("settings", "bands"):
            command.add_argument(
                "--ensemble",
                type=Path,
                metavar="FILE.ensemble.yaml",
                help="description of the ensemble (default: the one beside its play)",
            )
        if name not in _ALWAYS_RUN:
            command.add_argument(
                "--carry-on",
                action="store_true",
                help="record a failed gate, let later stages skip themselves, exit 0: rejected plays are sealed too",
            )
        if name == "seal":
            command.add_argument(
                "--interrupted",
                action="store_true",
                help="seal what there is of a run that did not come to its end; the bundle says so",
            )
        if name in _SOLVING:
            command.add_argument("--threads", type=_positive, default=None, help="solver threads (default: all cores)")
            command.add_argument(
                "--checkpoint-every", type=float, default=10.0, metavar="SECONDS", help="wall-clock checkpoint period"
            )

    verdict = commands.add_parser("verdict", help="print the verdict of a finished run; exit 3 when it is rejected")
    verdict.add_argument("results", type=Path, help="results/<play>")

    _add_bundle_tools(commands)
    _add_season(commands)

    synth = commands.add_parser("synth", help="write a synthetic play with known truth")
    synth.add_argument(
        "kind",
        choices=["demo", "broadcast", "wearable", "footage", "headform"],
        help="a shipped play, any footage, or a headform's record of --motion",
    )
    synth.add_argument("--into", type=Path, required=True, metavar="FOLDER", help="new folder for the play")
    synth.add_argument(
        "--seed", type=int, default=None, help="seed of the click or sensor noise (default: the shipped play's)"
    )

    footage = synth.add_argument_group("footage", "what the camera sees and what spoils the clicks (kind footage only)")
    footage.add_argument("--family", default="sine_squared", choices=_PULSES, help="shape of the impact's pulses")
    footage.add_argument(
        "--draw", action="store_true", help="draw the impact from the seed instead of the standard one"
    )
    footage.add_argument("--motion", type=Path, metavar="KINEMATICS.csv", help="film this record instead of an impact")
    footage.add_argument("--fps", type=_above_0, default=59.94, help="frame rate [Hz] (default 59.94)")
    footage.add_argument("--distance", type=_above_0, default=20.0, metavar="M", help="camera to head (default 20)")
    footage.add_argument("--focal", type=_above_0, default=6000.0, metavar="PX", help="focal length (default 6000)")
    footage.add_argument("--landmarks", type=int, default=8, choices=range(3, 11), help="how many (default 8)")
    footage.add_argument("--click-sigma", type=_not_negative, default=1.0, metavar="PX", help="noise (default 1)")
    footage.add_argument("--blur", type=_not_negative, default=0.0, metavar="SHARE", help="of the streak, added to it")
    footage.add_argument("--occlusion", type=_not_negative, default=0.0, metavar="SHARE", help="of the clicks hidden")
    footage.add_argument("--outliers", type=_not_negative, default=0.0, metavar="SHARE", help="of the clicks wild")
    footage.add_argument("--zoom", type=float, default=0.0, metavar="PER_S", help="rate of log focal length")
    footage.add_argument("--pan", type=float, default=0.0, metavar="RAD_PER_S", help="with three static points")
    footage.add_argument("--row-time", type=_not_negative, default=0.0, metavar="S", help="rolling shutter")

    digitize = commands.add_parser("digitize", help="follow clicked landmarks through a video -> click table")
    digitize.add_argument("video", type=Path, help="the video")
    digitize.add_argument(
        "--seeds", type=Path, required=True, metavar="SEEDS.csv", help="click table with a few clicks"
    )
    digitize.add_argument("--out", type=Path, required=True, metavar="CLICKS.csv", help="click table of every frame")
    digitize.add_argument("--first", type=int, default=None, help="first frame (default: that of the first click)")
    digitize.add_argument(
        "--last", type=int, default=None, help="last frame (default: that of the last click, or the video's)"
    )
    digitize.add_argument(
        "--click-sigma", type=_not_negative, default=1.0, metavar="PX", help="noise of your own clicks (default 1)"
    )
    digitize.add_argument("--patch", type=_positive, default=21, metavar="PX", help="side of the patch (default 21)")

    model = commands.add_parser("model", help="build a head and helmet model by itself, with --body a whole player")
    model.add_argument("--preset", default="nfl", choices=["anat", "nfl", "article"])
    model.add_argument("--resolution", default="coarse", choices=["tiny", "coarse", "medium", "fine"])
    for piece, text in (
        ("helmet", "classic, modern"),
        ("facemask", "classic, modern, open, none"),
        ("pads", "classic, modern"),
        ("chinstrap", "low, high, two_point"),
    ):
        model.add_argument(
            f"--{piece}",
            metavar="NAME",
            help=f"{text}, or a YAML file (default: the helmet's)",
        )
    model.add_argument(
        "--apparatus", metavar="NAME", help="a laboratory's apparatus in place of a head: linear_impactor, drop_anvil"
    )
    model.add_argument("--out", type=Path, required=True, metavar="MODEL.h5")
    model.add_argument("--preview", type=Path, metavar="PICTURE.png", help="also draw it")
    model.add_argument("--body", metavar="POSTURE", help="a body in this posture, by name or YAML file of joint angles")
    model.add_argument("--stature", type=_above_0, default=1.85, metavar="M", help="of the body (default 1.85)")
    model.add_argument("--mass", type=_above_0, default=110.0, metavar="KG", help="without helmet (default 110)")
    model.add_argument("--muscle", type=_above_0, default=0.9, help="0.5 average, 1 most (default 0.9)")
    model.add_argument(
        "--tissue", choices=["rigid", "deformable"], default="rigid", help="flesh of the body's segments"
    )
    model.add_argument("--voxel", type=_above_0, metavar="M", help="edge of the body's hexes")

    solve = commands.add_parser(
        "solve",
        help="run any model of hexahedra under its own controls",
        description="The solver as a tool of its own (docs/solver.md). After Ctrl-C the same command goes on.",
    )
    solve.add_argument("model", type=Path, metavar="MODEL", help="model.h5, or an LS-DYNA keyword file in SI units")
    solve.add_argument("--controls", type=Path, required=True, metavar="controls.yaml")
    solve.add_argument(
        "--out", type=Path, metavar="FOLDER", help="folder of the results (default: <name of the model>-run)"
    )
    solve.add_argument("--threads", type=_positive, default=None, help="solver threads (default: all cores)")
    solve.add_argument("--anew", action="store_true", help="start from time 0 even where a checkpoint lies")

    helmet = commands.add_parser("helmet", help="a helmet from LS-DYNA keyword files: look at it, make it ready")
    actions = helmet.add_subparsers(dest="action", required=True, metavar="inspect | prepare")
    for action, text in (
        ("inspect", "census, quality, mass, datum and interfaces of a deck; the helmet gate"),
        ("prepare", "remove wedges, renumber, convert to SI; write model, include file and manifest"),
    ):
        command = actions.add_parser(action, help=text, description=text)
        command.add_argument("files", type=Path, nargs="+", metavar="FILE.k", help="read as one deck")
        command.add_argument(
            "--units", choices=_UNITS, help="length-mass-time of the deck (default: found, or refused)"
        )
        command.add_argument("--settings", type=Path, metavar="HELMET.yaml", help="datum, mounts, roles, materials")
        if action == "inspect":
            command.add_argument("--json", type=Path, metavar="FILE.json", help="also write the report")
        else:
            command.add_argument("--as", dest="helmet", type=int, choices=[1, 2], required=True, help="helmet 1 or 2")
            command.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    material = commands.add_parser("material", help="put one material through one test; table and picture")
    material.add_argument("name", help="a material of the model, or brain:<set>")
    material.add_argument(
        "--mode", default="compression", help="compression, tension, simple_shear, confined, cyclic, relaxation"
    )
    material.add_argument("--rate", type=float, default=30.0, metavar="PER_S", help="nominal strain rate")
    material.add_argument("--strain", type=float, default=0.3, help="largest nominal strain, positive")
    material.add_argument("--out", type=Path, required=True, metavar="FOLDER")

    calibrate = commands.add_parser("calibrate", help="fit the brain's law to tests; report with identifiability")
    calibrate.add_argument("data", type=Path, metavar="DATA.csv", help="docs/file-formats.md says what it holds")
    calibrate.add_argument("--modes", default="compression", choices=["compression", "simple_shear", "all"])
    calibrate.add_argument("--hold", nargs="*", default=[], metavar="PARAMETER", help="parameters that are not fitted")
    calibrate.add_argument("--starts", type=_positive, default=8, help="first guesses")
    calibrate.add_argument("--seed", type=int, default=1, help="of the random first guesses")
    calibrate.add_argument("--out", type=Path, required=True, metavar="FOLDER")

    figures = commands.add_parser("tissue-figures", help="the article's Figures 1 to 4 from the shipped parameters")
    figures.add_argument("--data", type=Path, metavar="DATA.csv", help="tests to show (default: the shipped ones)")
    figures.add_argument("--threads", type=_positive, default=None, help="solver threads (default: all cores)")
    figures.add_argument("--out", type=Path, required=True, metavar="FOLDER")

    doctor = commands.add_parser("doctor", help="check this machine and environment, and the Slurm account")
    doctor.add_argument("--node", action="store_true", help="also run a short Slurm job that checks a compute node")
    schema = commands.add_parser("schema", help="print the JSON schema of play.yaml")
    schema.add_argument("--out", type=Path, help="write it to a file instead")
    return parser


_BUNDLE_TOOLS = ("verify", "compare", "show", "table", "agree", "rerun", "sign")


def _add_bundle_tools(commands: Any) -> None:
    """Commands for whoever received a bundle."""
    verify = commands.add_parser("verify", help="check a sealed bundle: bytes, completeness, crate")
    verify.add_argument("bundle", type=Path, help="<play>.zip or an unpacked bundle folder")
    verify.add_argument("--signers", type=Path, metavar="FILE", help="also check its signature (allowed signers)")

    compare = commands.add_parser("compare", help="compare two bundles or results folders artifact by artifact")
    compare.add_argument("old", type=Path)
    compare.add_argument("new", type=Path)
    show = commands.add_parser("show", help="a bundle on one screen: play, verdict, gates, versions")
    show.add_argument("bundle", type=Path, help="bundle, unpacked bundle or results/<play>")
    table = commands.add_parser("table", help="many bundles in one table: CSV and HTML")
    table.add_argument("bundles", type=Path, nargs="+", metavar="BUNDLE", help="results/*/bundle/*.zip")
    table.add_argument("--out", type=Path, default=Path("plays"), metavar="NAME", help="writes NAME.csv, NAME.html")
    agree = commands.add_parser("agree", help="do laboratories recover one driver from one play? exit 3 when not")
    agree.add_argument(
        "bundles", type=Path, nargs="+", metavar="BUNDLE", help="bundles or results folders, two or more"
    )
    agree.add_argument("--out", type=Path, metavar="FILE.json", help="also write all of it as JSON")
    rerun = commands.add_parser("rerun", help="make a bundle again from itself alone, and compare")
    rerun.add_argument("bundle", type=Path)
    rerun.add_argument("--into", type=Path, required=True, metavar="FOLDER", help="new folder for all of it")
    rerun.add_argument("--yes", action="store_true", help="do not ask before running what came with the bundle")
    rerun.add_argument("--environment", type=Path, metavar="VENV", help="use this environment, not the bundle's lock")
    rerun.add_argument("--withheld", type=Path, metavar="FOLDER", help="has the files the bundle names by hash alone")
    rerun.add_argument("--cores", type=_positive, help="for the workflow (default: all)")
    sign = commands.add_parser("sign", help="sign a bundle with an SSH key; the signature lies beside it")
    sign.add_argument("bundle", type=Path)
    sign.add_argument("--key", type=Path, required=True, help="private SSH key")


def _run_bundle_tool(arguments: argparse.Namespace) -> int:
    import importlib

    # One module a command, so that verifying loads no solver.
    module = "bundles" if arguments.command in ("verify", "compare", "sign") else arguments.command
    tool = getattr(importlib.import_module(f"replay.stages.{module}"), arguments.command)
    given = {name: value for name, value in vars(arguments).items() if name != "command"}
    return tool(**given)


def _add_season(commands: Any) -> None:
    """Commands of the workflow over many plays."""
    season = commands.add_parser("season", help="every play in one table and on one page")
    season.add_argument("plays", nargs="+", metavar="PLAY")
    season.add_argument("--results", type=Path, default=Path("results"), help="where results/<play> lies")
    row = commands.add_parser("write-out", help="write a row of the table of plays as a play folder")
    row.add_argument("play", help="name of the row")
    row.add_argument("--table", type=Path, default=Path("config/plays.tsv"))
    row.add_argument("--plays", type=Path, default=Path("config/plays"), help="folder of the described plays")
    row.add_argument("--into", type=Path, required=True, metavar="FOLDER", help="folder of the plays written out")


def _add_workspace(command: argparse.ArgumentParser) -> None:
    command.add_argument("play", help="name of the play: a folder of --plays; or a member, demo.friction/003")
    command.add_argument("--plays", type=Path, default=Path("config/plays"), help="folder of the plays")
    command.add_argument("--results", type=Path, default=Path("results"), help="where results/<play> lies")


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        message = "must be at least 1"
        raise argparse.ArgumentTypeError(message)
    return number


def _above_0(text: str) -> float:
    number = _not_negative(text)
    if number == 0.0:
        message = "must be above 0"
        raise argparse.ArgumentTypeError(message)
    return number


def _not_negative(text: str) -> float:
    number = float(text)
    if not 0.0 <= number < float("inf"):
        message = "must be a number, at least 0"
        raise argparse.ArgumentTypeError(message)
    return number


def _run_stage(arguments: argparse.Namespace) -> int:
    import importlib

    from replay.stages.frame import Workspace

    module = importlib.import_module(f"replay.stages.{_STAGES[arguments.command][0]}")
    workspace = Workspace(arguments.play, plays=arguments.plays, results=arguments.results)
    options: dict[str, object] = {}
    if arguments.command == "settings":
        options["resolution"] = None if arguments.resolution == "as-the-play-says" else arguments.resolution
    if arguments.command in ("settings", "bands"):
        options["ensemble"] = arguments.ensemble
    if arguments.command == "seal":
        options["interrupted"] = arguments.interrupted
    if arguments.command in _SOLVING:
        options |= {"threads": arguments.threads, "checkpoint_every_s": arguments.checkpoint_every}
    refusal = module.run(workspace, **options)
    if refusal:
        print(refusal, file=sys.stderr)
        return 0 if getattr(arguments, "carry_on", True) else 3
    return 0


def _run_helmet(arguments: argparse.Namespace) -> int:
    from replay.stages import helmet

    given = {"units": arguments.units, "settings_file": arguments.settings}
    if arguments.action == "inspect":
        return helmet.inspect(arguments.files, out=arguments.json, **given)
    return helmet.prepare(arguments.files, helmet=arguments.helmet, out=arguments.out, **given)


def _body(arguments: argparse.Namespace) -> dict[str, Any] | None:
    """What `replay model` is told of a body; none without ``--body``."""
    if arguments.body is None:
        return None
    return {
        "posture": arguments.body, "stature_m": arguments.stature, "mass_kg": arguments.mass,
        "muscle": arguments.muscle, "tissue": arguments.tissue, "step_m": arguments.voxel,
    }  # fmt: skip


def _run_tool(arguments: argparse.Namespace) -> int:
    from replay.stages import explicit, laboratory, tools

    call: dict[str, Callable[[], int]] = {
        "verdict": lambda: tools.show_verdict(arguments.results),
        "synth": lambda: (
            tools.write_synthetic_footage(vars(arguments))
            if arguments.kind == "footage"
            else tools.write_headform_record(arguments.motion, arguments.into, arguments.seed)
            if arguments.kind == "headform"
            else tools.write_synthetic_play(arguments.kind, arguments.into, arguments.seed)
        ),
        "digitize": lambda: tools.digitise_video(
            arguments.video,
            arguments.seeds,
            arguments.out,
            (arguments.first, arguments.last),
            arguments.click_sigma,
            arguments.patch,
        ),
        "model": lambda: tools.write_model_file(
            arguments.preset,
            arguments.resolution,
            (arguments.helmet, arguments.facemask, arguments.pads, arguments.chinstrap),
            arguments.out,
            arguments.preview,
            _body(arguments),
            arguments.apparatus,
        ),
        "solve": lambda: explicit.solve_model(
            arguments.model,
            arguments.controls,
            arguments.out or Path(f"{arguments.model.stem}-run"),
            threads=arguments.threads,
            anew=arguments.anew,
        ),
        "helmet": lambda: _run_helmet(arguments),
        "material": lambda: laboratory.run_material(
            arguments.name, arguments.mode, arguments.rate, arguments.strain, arguments.out
        ),
        "calibrate": lambda: laboratory.run_calibration(
            arguments.data,
            arguments.out,
            modes=arguments.modes,
            hold=arguments.hold,
            starts=arguments.starts,
            seed=arguments.seed,
        ),
        "tissue-figures": lambda: laboratory.run_article_figures(
            arguments.out, arguments.data, threads=arguments.threads
        ),
        "schema": lambda: tools.write_schema(arguments.out),
    }
    return call[arguments.command]()


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; print a user's mistake as one message and return its exit code.

    Parameters
    ----------
    argv
        Arguments after the program's name; the process's own by default.

    Returns
    -------
    int
        Exit code.
    """
    arguments = _parser().parse_args(argv)
    try:
        if arguments.command == "doctor":
            from replay.doctor import examine

            return examine(on_a_node=arguments.node)
        if arguments.command == "season":
            from replay.stages.season import season

            return season(arguments.plays, arguments.results)
        if arguments.command == "write-out":
            from replay.stages.write_out import write_row

            return write_row(arguments.play, arguments.table, arguments.plays, arguments.into)
        if arguments.command in _BUNDLE_TOOLS:
            return _run_bundle_tool(arguments)
        return _run_stage(arguments) if arguments.command in _STAGES else _run_tool(arguments)
    except ReplayError as error:
        print(f"replay {arguments.command}: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print(f"replay {arguments.command}: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


if __name__ == "__main__":
    sys.exit(main())
