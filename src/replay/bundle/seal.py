"""Seal a run: one archive with everything another laboratory needs, protected to the byte."""

from __future__ import annotations

import csv
import io
import platform
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from replay import __version__
from replay.bundle import bag
from replay.bundle.archive import Member, write_archive
from replay.bundle.contents import ARTIFACTS, Item, LeftOut, Run, gather, results_hash
from replay.bundle.crate import NAME as CRATE
from replay.bundle.crate import About, crate_text
from replay.bundle.package import facts_of, read_tracks
from replay.bundle.papers import bundle_facts, machine_facts, readme_text, version_of
from replay.bundle.provenance import Job, read_jobs
from replay.bundle.source import Source, read_source, write_snapshot
from replay.errors import InputError, ReplayError
from replay.files import atomic_path, json_text, read_json, sha256, write_text

_WORKFLOW = "Snakefile"


def seal(
    results: str | Path,
    destination: str | Path,
    *,
    source_root: str | Path | None = None,
    play_folder: str | Path | None = None,
    job_records: str | Path | None = None,
    extra_files: Mapping[str, str | Path] | None = None,
    withhold: Mapping[str, str] | None = None,
    unfinished: Sequence[str] = (),
    metadata: Mapping[str, str] | None = None,
) -> str:
    """Seal the results of one play, accepted or not, and write ``<destination>.sha256`` beside the archive.

    The same files give the same bytes: no clock is read, and nothing of a machine enters but
    ``machine.json`` and Snakemake's times, which are class ``volatile``.

    Parameters
    ----------
    results
        ``results/<play>``.
    destination
        The archive, ``<play>.zip``; written atomically.
    source_root
        Root of the project's source; by default where this package lies.
    play_folder
        ``config/plays/<play>``: the play as it was described.
    job_records
        ``.snakemake/metadata``, for when each stage ran; without it actions carry no times.
    extra_files
        Further files by payload path.
    withhold
        Payload path to the reason why its bytes may not be shared: hash and reason are sealed instead.
    unfinished
        Stages that the run did not come to; the bundle says ``INTERRUPTED`` then.
    metadata
        Any of ``author``, ``publisher``, ``license`` (URL), ``date`` (ISO 8601).

    Returns
    -------
    str
        Hex SHA-256 of the archive.

    Raises
    ------
    InputError
        When nothing has finished, or a file changed since its stage wrote it.
    ReplayError
        When the disk is full, or a file changes meanwhile.
    """
    destination = Path(destination)
    metadata = dict(metadata or {})
    withhold = dict(withhold or {})
    if unknown := set(metadata) - {"author", "publisher", "license", "date"}:
        message = f"metadata {sorted(unknown)} unknown"
        raise ValueError(message)
    plays, left_plays = _play_items(play_folder, withhold)
    of_results = {name: reason for name, reason in withhold.items() if not name.startswith("plays/")}
    run = gather(results, withhold=of_results, unfinished=unfinished)
    run = replace(run, left_out=(*run.left_out, *left_plays))
    root = source_root if source_root is not None else Path(__file__).resolve().parents[3]
    source = read_source(root, without=frozenset(left.sha256 for left in run.left_out if left.sha256))
    jobs = read_jobs(job_records, run.play)
    destination.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=destination.parent, prefix=".sealing.") as folder:
        snapshot = Path(folder) / "source.tar"
        with snapshot.open("wb") as stream:
            write_snapshot(source, stream)
        items = [*run.items, *plays, *_source_items(source, snapshot)]
        items += [Item(path, Path(file), meaning="added by the caller") for path, file in (extra_files or {}).items()]
        items += _papers(run, source, Path(results), with_play=bool(plays))
        _refuse_twice(items)
        digests = {item.path: _measure(item) for item in items}
        rows = _artifacts_csv(items, digests)
        listing = Item("artifacts.csv", rows, meaning="every file with its class")
        items.append(listing)
        digests[listing.path] = _measure(listing)
        about = _about(run, source, jobs, metadata, {item.path for item in items})
        crate = Item(CRATE, crate_text(run, items, digests, jobs, about).encode(), "volatile")
        items.append(crate)
        digests[crate.path] = _measure(crate)
        digest_file = destination.with_name(destination.name + ".sha256")
        digest_file.unlink(missing_ok=True)
        with atomic_path(destination) as temporary:
            write_archive(temporary, _members(run, items, digests, about, results_hash(rows)))
            digest = sha256(temporary)
        write_text(digest_file, f"{digest}  {destination.name}\n")
    return digest


def _play_items(folder: str | Path | None, withhold: Mapping[str, str]) -> tuple[list[Item], list[LeftOut]]:
    """Every plain file of the play's folder, under ``plays/<play>``."""
    items: list[Item] = []
    left: list[LeftOut] = []
    if folder is None:
        return items, left
    folder = Path(folder)
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        inner = path.relative_to(folder)
        name = f"plays/{folder.name}/{inner.as_posix()}"
        if any(part[0] == "." for part in inner.parts):
            continue
        if name in withhold:
            left.append(LeftOut(name, withhold[name], sha256(path)))
        else:
            items.append(Item(name, path, meaning="the play as it was described"))
    missing = {n for n in withhold if n.startswith("plays/")} - {entry.path for entry in left}
    if missing:
        raise InputError(folder, f"has no {sorted(missing)[0]} to withhold", mend="correct the path")
    return items, left


def _source_items(source: Source, snapshot: Path) -> list[Item]:
    items = [
        Item("source/source.tar", snapshot, meaning="the source the run was made with"),
        Item("source/source.json", json_text(source.to_json()).encode(), meaning="its commit"),
        Item("source/dirty.diff", source.diff, meaning="what differed from the commit; empty when nothing did"),
        Item(_WORKFLOW, source.root / "Snakefile", meaning="the workflow"),
        Item("environment.lock", source.root / "environment.lock", meaning="every dependency, pinned and hashed"),
    ]
    for name in source.files:
        if name.startswith("workflow/"):
            items.append(Item(name, source.root / name, meaning="part of the workflow"))
        elif name in ("CITATION.cff", "LICENSE", "config/config.yaml"):
            items.append(Item(name, source.root / name))
    return items


def _papers(run: Run, source: Source, results: Path, *, with_play: bool) -> list[Item]:
    facts = facts_of(run, tracks=read_tracks(results))
    facts["source code"] = (bool(source.files), True)
    settings = results / "settings" / "play.json"
    model = read_json(settings).get("model", {}) if settings.is_file() else {}
    readme = readme_text(run, resolution=str(model.get("resolution", "")), with_play=with_play)
    about = bundle_facts(run, source, facts, run.left_out)
    return [
        Item("README.md", readme.encode(), meaning="what this is, and three commands"),
        Item("bundle.json", json_text(about).encode(), meaning="play, verdict, minimum package, what was left out"),
        Item("machine.json", json_text(machine_facts()).encode(), "volatile", meaning="the machine and its versions"),
    ]


def _refuse_twice(items: list[Item]) -> None:
    names = Counter([CRATE, "artifacts.csv", *(item.path for item in items)])
    twice = sorted(name for name, times in names.items() if times > 1)
    if twice:
        message = f"{twice[0]}: two files would take this place in the bundle\n    mend: name the extra file otherwise"
        raise ReplayError(message)


def _measure(item: Item) -> bag.Digest:
    with item.open() as stream:
        digest = bag.digest(stream)
    if item.promised not in (None, digest.sha256):
        raise InputError(item.path, "changed since its stage wrote it", mend=f"run stage {item.stage} again")
    return digest


def _artifacts_csv(items: list[Item], digests: Mapping[str, bag.Digest]) -> bytes:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(ARTIFACTS.names)
    for item in sorted(items, key=lambda i: i.path.encode()):
        known: tuple[Any, Any] = (digests[item.path].size, digests[item.path].sha256)
        if item.class_ == "volatile":
            known = ("", "")
        tolerances = ("" if item.rtol is None else repr(item.rtol), "" if item.atol is None else repr(item.atol))
        writer.writerow([item.path, *known, item.class_, *tolerances, item.stage, item.unit, item.meaning])
    return out.getvalue().encode()


def _about(run: Run, source: Source, jobs: Mapping[str, Job], metadata: Mapping[str, str], paths: set[str]) -> About:
    ended = max((job.ended for stage, job in jobs.items() if stage in run.manifests), default="")
    configs = ("results/settings/play.json", f"plays/{run.play}/play.yaml", "config/config.yaml", "environment.lock")
    return About(
        date=metadata.get("date") or ended or source.committed or "1980-01-01",
        replay_version=__version__,
        engine_version=version_of("snakemake"),
        workflow=_WORKFLOW,
        config=next(path for path in configs if path in paths),
        programs={"python": platform.python_version(), **machine_facts()["programs"]},
        **{key: metadata[key] for key in ("author", "publisher", "license") if key in metadata},
    )


def _members(
    run: Run, items: list[Item], digests: Mapping[str, bag.Digest], about: About, of_results: str
) -> list[Member]:
    """Put the tag files of the bag around the payload; everything lies in one folder named after the play."""
    payload = {bag.PAYLOAD + path: digest for path, digest in digests.items()}
    info = {
        "Source-Organization": about.publisher,
        "Contact-Name": about.author,
        "Bagging-Date": about.date[:10],
        "External-Identifier": run.play,
        "External-Description": f"Replay of the play {run.play}: {run.verdict}",
        "Replay-Verdict": run.verdict,
        bag.RESULTS: of_results,
        "Bag-Software-Agent": f"replay {about.replay_version}",
        "Payload-Oxum": bag.oxum(payload),
    }
    tags = {
        "bagit.txt": bag.DECLARATION,
        "bag-info.txt": bag.info_text({key: value for key, value in info.items() if value}).encode(),
        **{f"manifest-{name}.txt": bag.manifest_text(payload, name).encode() for name in bag.ALGORITHMS},
    }
    measured = {name: bag.digest(io.BytesIO(text)) for name, text in tags.items()}
    tags |= {f"tagmanifest-{name}.txt": bag.manifest_text(measured, name).encode() for name in bag.ALGORITHMS}
    members = [Item(name, text) for name, text in tags.items()]
    known = payload | {name: bag.digest(io.BytesIO(text)) for name, text in tags.items()}
    members += [replace(item, path=bag.PAYLOAD + item.path) for item in items]
    return [
        Member(f"{run.play}/{item.path}", known[item.path].size, known[item.path].crc32, item.open) for item in members
    ]
