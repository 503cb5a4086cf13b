"""What a bundle or a results folder says of its play, on one screen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from replay.bundle import SealedRun, foreign_content, open_run, shown

_MEASURES = (("peak_linear_acceleration", "m/s^2"), ("peak_angular_velocity", "rad/s"), ("HIC15", ""), ("BrIC", ""))
_WIDTH = 15
_MOST = 100
INTERRUPTED = "INTERRUPTED"


def show(bundle: Path) -> int:
    """Print play, verdict, gates and versions; every file that is read is checked against the manifest first."""
    with foreign_content(bundle), open_run(bundle) as run:
        print("\n".join(shown(line) for line in _lines(run)))
    return 0


def _lines(run: SealedRun) -> Iterator[str]:
    play = run.json("results/settings/play.json") or {}
    bundle = run.json("bundle.json") or {}
    verdict = run.json("results/verdict/verdict.json") or {}
    status = bundle.get("verdict") or str(verdict.get("status", "not judged")).upper()
    yield f"{play.get('name') or bundle.get('play', run.path.name)}: {status}"
    if play.get("title"):
        yield f"  {play['title']}"
    if status == INTERRUPTED:
        verdict = {}  # an older one, from before stages were run again
    if not verdict:
        yield f"  {bundle.get('line') or 'the run ended before its verdict'}"
    yield from _facts(run, play)
    yield ""
    yield from _gates(run, verdict)
    yield ""
    yield from _versions(run, bundle)
    if run.sealed:
        yield ""
        yield f"  what is shown was checked against the manifest; for every byte: replay verify {run.path}"
    yield "  These are process diagnostics: no statement on injury or on a player."


def _row(label: str, text: str) -> str:
    return f"  {label:<{_WIDTH}} {text}"


def _facts(run: SealedRun, play: Mapping[str, Any]) -> Iterator[str]:
    quality = run.json("results/reconstruction/quality.json")
    if quality:
        kind = "clicked video" if quality["kind"] == "clicks" else quality["kind"]
        t0 = f"t0 {1e3 * quality['t0_s']:.2f} ms"
        yield _row("source", f"{kind}, {quality['samples']} samples at {quality['rate_hz']:g} Hz; {t0}")
    if "model" in play:
        helmet, model = play["helmet"], play["model"]
        yield _row(
            "model", f"{model['preset']}, {model['resolution']}; helmet {helmet['model']}, {helmet['mass_kg']} kg"
        )
    measures = run.json("results/measures/measures.json")
    if measures:
        found = {entry["name"]: entry["value"] for entry in measures["head"]}
        words = [
            f"{name.replace('_', ' ')} {found[name]:.4g} {unit}".strip() for name, unit in _MEASURES if name in found
        ]
        yield _row("head", "; ".join(words))


def _gates(run: SealedRun, verdict: Mapping[str, Any]) -> Iterator[str]:
    """One line a gate: its verdict, its failed and warning checks, and how many had no power."""
    gates = dict(verdict.get("gates") or recorded_gates(run))
    causes: dict[str, list[str]] = {}
    powerless: dict[str, int] = {}
    for cause in verdict.get("causes", []):
        if cause["verdict"] == "vacuous":
            powerless[cause["gate"]] = powerless.get(cause["gate"], 0) + 1
        else:
            causes.setdefault(cause["gate"], []).append(f"{cause['verdict']}: {cause['sentence']}")
    width = max((len(name) for name in gates), default=0)
    for name, word in gates.items():
        extra = f"{powerless[name]} not checked, for want of power" if name in powerless else ""
        yield f"  {word:<5} {name:<{width}}  {extra}".rstrip()
        yield from (f"        {_short(text)}" for text in causes.get(name, ()))
    if verdict.get("not_evaluated"):
        yield f"  not reached: {', '.join(verdict['not_evaluated'])}"
    for entry in verdict.get("loosened", []):
        yield f"  LOOSENED {entry['gate']}.{entry['check']}: {entry['limit']} instead of {entry['instead_of']}"


def _short(text: str) -> str:
    return text if len(text) <= _MOST else f"{text[:_MOST]} ..."


def recorded_gates(run: SealedRun) -> dict[str, str]:
    """Gate to verdict as the gate files record them, for a run that ended before its verdict."""
    files = [name for name in run.files if name.rpartition("/")[2].startswith("gate") and name.endswith(".json")]
    order = run.stages()
    files.sort(key=lambda name: (order.index(name.split("/")[1]), name))
    found = [run.json(name) for name in files]
    return {gate["gate"]: gate["verdict"] for gate in found if isinstance(gate, dict) and "gate" in gate}


def _versions(run: SealedRun, bundle: Mapping[str, Any]) -> Iterator[str]:
    stages = run.stages()
    last = run.json(f"results/{stages[-1]}/manifest.json") if stages else {}
    made = ", ".join(f"{name} {version}" for name, version in sorted(last.get("versions", {}).items(), reverse=True))
    source = bundle.get("source", {})
    commit = source.get("commit")
    if commit:
        made += f"; commit {commit[:12]}" + (", with changes" if source.get("dirty") else "")
    yield _row("made by", made)
    machine = run.json("machine.json")
    if machine:
        programs = ", ".join(f"{name} {machine['programs'][name]}" for name in ("numba", "numpy", "snakemake"))
        yield _row("on", f"{machine['system']} {machine['machine']}, {programs}")
    withheld = [entry for entry in bundle.get("left_out", []) if entry.get("sha256")]
    for entry in withheld:
        yield _row("withheld", f"{entry['path']} ({entry['reason']}), sha256 {entry['sha256'][:12]}")
    missing = [n for n, item in bundle.get("minimum_package", {}).items() if not (item["present"] and item["hashed"])]
    if bundle:
        yield _row("package", f"lacks {', '.join(missing)}" if missing else "whole: every item of the minimum package")
