"""When each stage ran and by which command: Snakemake's own records, where there are any."""

from __future__ import annotations

import base64
import binascii
import json
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path


@dataclass(frozen=True)
class Job:
    """One finished job.

    Parameters
    ----------
    rule
        Name of the rule.
    command
        What it ran.
    started, ended
        ISO 8601, UTC.
    """

    rule: str
    command: str
    started: str
    ended: str


def read_jobs(records: str | Path | None, play: str) -> dict[str, Job]:
    """Read the jobs that made a play's stages.

    Parameters
    ----------
    records
        ``.snakemake/metadata`` (one JSON record per output, its base64 path as name), or None.
    play
        Name of the play.

    Returns
    -------
    dict
        Stage to job; empty where there are no records. A record that cannot be read is
        passed over: the manifests say what was made, this only adds when.
    """
    jobs: dict[str, Job] = {}
    if records is None or not Path(records).is_dir():
        return jobs
    for path in sorted(p for p in Path(records).rglob("*") if p.is_file()):
        try:
            # Long names are cut into folders, each but the last with a leading @.
            encoded = "".join(part.removeprefix("@") for part in path.relative_to(records).parts)
            target = base64.urlsafe_b64decode(encoded).decode()
            parts = Path(target).parts
            at = parts.index(play)
            stage = parts[at + 1]
            if at == 0 or len(parts) < at + 3 or stage == "bundle":
                continue
            # only now: in a season most records are of other plays
            record = json.loads(path.read_text(encoding="utf-8"))
            if record.get("incomplete"):
                continue
            job = Job(
                record["rule"], _plain(record["shellcmd"] or ""), _iso(record["starttime"]), _iso(record["endtime"])
            )
        except (ValueError, KeyError, IndexError, TypeError, AttributeError, binascii.Error):
            continue
        if stage not in jobs or parts[-1] == "manifest.json":
            jobs[stage] = job
    return jobs


def _plain(command: str) -> str:
    """Command without the folders of the machine it ran on."""
    return re.sub(r"(?<![\w.~-])/(?:[^\s/'\"]+/)+", "", " ".join(command.split()))


def _iso(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")
