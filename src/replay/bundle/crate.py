"""The description of a run as a Workflow Run RO-Crate (process, workflow and provenance profiles, 0.5).

One ``CreateAction`` a stage, with what it read and made, when it ran and how it ended; a
stage whose gate failed is a failed action with the reason as its error.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Any

from rocrate.model import ContextEntity
from rocrate.model.computationalworkflow import ComputationalWorkflow
from rocrate.rocrate import ROCrate

from replay.bundle.bag import Digest
from replay.bundle.contents import Item, Run
from replay.bundle.provenance import Job

NAME = "ro-crate-metadata.json"
_RUN_CONTEXT = "https://w3id.org/ro/terms/workflow-run/context"
_PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": ("Process Run Crate", "0.5"),
    "https://w3id.org/ro/wfrun/workflow/0.5": ("Workflow Run Crate", "0.5"),
    "https://w3id.org/ro/wfrun/provenance/0.5": ("Provenance Run Crate", "0.5"),
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": ("Workflow RO-Crate", "1.0"),
}
_LICENSE = "https://spdx.org/licenses/Apache-2.0"
_MEDIA = {
    ".csv": "text/csv",
    ".json": "application/json",
    ".yaml": "application/yaml",
    ".html": "text/html",
    ".md": "text/markdown",
    ".txt": "text/plain",
    ".xdmf": "application/xml",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".h5": "application/x-hdf5",
    ".vtkhdf": "application/x-hdf5",
    ".tar": "application/x-tar",
    ".vtu": "application/xml",
}


@dataclass(frozen=True)
class About:
    """What the crate says of itself.

    Parameters
    ----------
    date
        ISO 8601 date of publication; from the run, never from the clock.
    replay_version, engine_version
        Versions of this program and of the workflow engine.
    workflow, config
        Payload paths of the main workflow file and of its settings.
    programs
        Version of each program that the stages stand on.
    author, publisher, license
        As the user gives them; ``license`` is a URL.
    """

    date: str
    replay_version: str
    engine_version: str
    workflow: str
    config: str
    programs: Mapping[str, str] = field(default_factory=dict)
    author: str = ""
    publisher: str = ""
    license: str = _LICENSE


def crate_text(
    run: Run, items: Sequence[Item], digests: Mapping[str, Digest], jobs: Mapping[str, Job], about: About
) -> str:
    """Write ``ro-crate-metadata.json``.

    Parameters
    ----------
    run
        The gathered run.
    items, digests
        Every other file of the payload, and its size and hashes by path.
    jobs
        Stage to when and by which command it ran.
    about
        See `About`.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        crate = ROCrate(version="1.1")
        _describe(crate, run, about)
        files = {item.path: _add_file(crate, item, digests[item.path], about) for item in items}
        workflow = files[about.workflow]
        crate.mainEntity = workflow
        crate.root_dataset["mentions"] = _add_run(crate, run, files, workflow, jobs, about)
        value = crate.metadata.generate()
    return json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False) + "\n"


def _describe(crate: ROCrate, run: Run, about: About) -> None:
    crate.metadata.extra_contexts.append(_RUN_CONTEXT)
    root = crate.root_dataset
    root["conformsTo"] = [
        crate.add(ContextEntity(crate, url, {"@type": "CreativeWork", "name": name, "version": version}))
        for url, (name, version) in _PROFILES.items()
    ]
    crate.name = f"Replay of the play {run.play}: {run.verdict}"
    crate.description = (
        f"One football play from its raw tracks to a finite-element replay, with every gate. {run.line}. "
        "Process outputs and diagnostics; no statement on injury."
    )
    root["datePublished"] = about.date
    root["identifier"] = run.play
    root["license"] = crate.add(
        ContextEntity(crate, about.license, {"@type": "CreativeWork", "name": about.license.rpartition("/")[2]})
    )
    for key, kind, name in (("author", "Person", about.author), ("publisher", "Organization", about.publisher)):
        if name:
            root[key] = crate.add(ContextEntity(crate, f"#{key}", {"@type": kind, "name": name}))


def _add_file(crate: ROCrate, item: Item, digest: Digest, about: About) -> Any:
    suffix = PurePosixPath(item.path).suffix
    properties: dict[str, Any] = {
        "name": item.path,
        "contentSize": str(digest.size),
        "sha256": digest.sha256,
        "encodingFormat": _MEDIA.get(
            suffix, "text/plain" if suffix in (".py", ".smk", ".lock", ".rst", "") else "application/octet-stream"
        ),
    }
    if item.meaning:
        properties["description"] = item.meaning
    if item.path != about.workflow:
        return crate.add_file(dest_path=item.path, properties=properties)
    workflow = crate.add_workflow(
        dest_path=item.path, properties=properties, lang="snakemake", lang_version=about.engine_version,
        cls=_SteppedWorkflow,
    )  # fmt: skip
    workflow["license"] = {"@id": about.license}
    return workflow


class _SteppedWorkflow(ComputationalWorkflow):
    """A workflow that names its steps is also a ``HowTo``."""

    TYPES = ["File", "SoftwareSourceCode", "ComputationalWorkflow", "HowTo"]  # noqa: RUF012


def _add_run(
    crate: ROCrate, run: Run, files: Mapping[str, Any], workflow: Any, jobs: Mapping[str, Job], about: About
) -> list[Any]:
    def add(identifier: str, kind: str, name: str, **properties: Any) -> Any:
        return crate.add(ContextEntity(crate, identifier, {"@type": kind, "name": name, **properties}))

    engine = add("#snakemake", "SoftwareApplication", "Snakemake", softwareVersion=about.engine_version)
    programs = [
        add(f"#{name}", "SoftwareApplication", name, softwareVersion=version)
        for name, version in about.programs.items()
        if name != "snakemake"
    ]
    tools, steps, actions, controls = [], [], [], []
    for position, (stage, manifest) in enumerate(run.manifests.items()):
        version = manifest.versions.get("replay", about.replay_version)
        tool = add(f"#stage-{stage}", "SoftwareApplication", f"replay stage {stage}", softwareVersion=version)
        tool["softwareRequirements"] = programs
        step = add(f"{about.workflow}#step-{stage}", "HowToStep", stage, position=str(position))
        step["workExample"] = tool
        action = add(f"#run-{stage}", "CreateAction", f"{stage} of {run.play}", **_outcome(run.failures.get(stage)))
        _stamp(action, jobs.get(stage))
        action["instrument"] = tool
        read = {f"results/{i.path}" for i in manifest.inputs} | {f"plays/{run.play}/{i.path}" for i in manifest.inputs}
        action["object"] = _compact([files[path] for path in sorted(read) if path in files] or [files[about.config]])
        action["result"] = _compact([file for path, file in files.items() if path.startswith(f"results/{stage}/")])
        control = add(f"#control-{stage}", "ControlAction", f"orchestrate {stage}")
        control["instrument"], control["object"] = step, action
        tools.append(tool)
        steps.append(step)
        actions.append(action)
        controls.append(control)
    workflow["hasPart"], workflow["step"] = tools, steps
    whole = add("#run", "CreateAction", f"replay of {run.play}", **_outcome(_whole_failure(run)))
    whole["instrument"], whole["object"] = workflow, files[about.config]
    whole["result"] = [file for path, file in files.items() if path.startswith("results/")]
    organize = add("#organize", "OrganizeAction", "orchestration by Snakemake")
    organize["instrument"], organize["object"], organize["result"] = engine, controls, whole
    times = [job for stage, job in jobs.items() if stage in run.manifests]
    if times:
        span = Job("", "", min(job.started for job in times), max(job.ended for job in times))
        _stamp(whole, span)
        _stamp(organize, span)
    return [whole, organize, *actions]


def _compact(entities: list[Any]) -> Any:
    """Write a single value as itself, as RO-Crate recommends."""
    return entities[0] if len(entities) == 1 else entities


def _outcome(failure: str | None) -> dict[str, str]:
    if failure is None:
        return {"actionStatus": "http://schema.org/CompletedActionStatus"}
    return {"actionStatus": "http://schema.org/FailedActionStatus", "error": failure}


def _whole_failure(run: Run) -> str | None:
    return f"{run.verdict}: {run.line}" if run.verdict in ("REJECTED", "INTERRUPTED", "NOT JUDGED") else None


def _stamp(action: Any, job: Job | None) -> None:
    if job is None:
        return
    action["startTime"], action["endTime"] = job.started, job.ended
    if job.command:
        action["description"] = job.command
