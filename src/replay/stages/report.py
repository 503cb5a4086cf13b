"""Stage ``report``: everything the stages found, on one page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from replay import __version__
from replay.files import read_json
from replay.gates import Limits
from replay.measures import Motion, read_snapshots
from replay.models import Model, read_model
from replay.play import Play
from replay.report import MeshView, ReportInput, Snapshots, write_report
from replay.solver.vtkhdf import read_states
from replay.stages.channels import NAMES
from replay.stages.fidelity import skull_motion
from replay.stages.frame import Stage, Workspace, stages_of
from replay.stages.limits import limits_of
from replay.stages.players import ROLES
from replay.stages.replayed import replayed_model
from replay.stages.resolved import read_settings
from replay.stages.verdict import ALL_GATE_FILES, GATE_FILES

_TITLES = {
    "inputs": "Raw tracks",
    "reconstruction": "Reconstruction",
    "driver": "Driver",
    "assembly": "Head and helmet",
    "placement": "Two players placed",
    "shake": "Helmet shake",
    "decks": "Run decks",
    "replay": "Replay",
    "sensitivity": "Half the hourglass coefficient",
    "fidelity": "Driver fidelity",
    "measures": "Measures",
}
_SOURCES = {"clicks": "clicked video", "wearable": "wearable", "none": "nothing recorded, starts given"}
_DRIVEN = (
    "The blow itself. The skull is rigid and driven along the reconstructed motion; nothing strikes the helmet,"
    " and facemask forces, contact work and the action of an impactor are not computed."
)
_NO_BODY = (
    "The rest of the players. Two helmeted heads collide without necks and bodies, so that what follows the first"
    " milliseconds lacks the mass and the restraint that a neck would bring."
)
_FREE_HEAD = (
    "The neck and the carriage of the laboratory. The helmeted head is free, so that what follows the first"
    " milliseconds lacks the mass and the restraint that they would bring; no gravity acts."
)
_BODY = (
    "Muscles. Necks and bodies are passive: joints with springs of an assumed stiffness, and no muscle that is braced"
    " or becomes active in thirty milliseconds."
)
_SEAT = {
    "shared_nodes": (
        "Sliding, lift-off and bottoming out of the helmet. There is no contact in this model: pads share nodes with"
        " scalp and shell, so the helmet stays joined to the head."
    ),
    "contact": (
        "How tightly the helmet sat. Pads and chin cup touch the head without pressure at the start, and straps are"
        " taut without tension: hair, sweat and pre-load are not modelled."
    ),
}
_BRAIN = {
    "brain_isv": (
        "The size of the damage variable. Its growth depends on the cap of the Cocks-Ashby term, which is ours, and on"
        " m_CA and K_pore, which are assumed: the table of the damage section shows by how much. Read where and when it"
        " grows, not how far."
    ),
    "viscohyperelastic": "Damage. The play asks for a visco-elastic brain, which keeps no damage variable.",
}
_MEMBRANES = {
    "none": (
        "What falx and tentorium do: they are left out. In the demo they lower the strain of the occipital lobes by 20"
        " to 24 % and raise that of the corpus callosum by 21 %; `model.membranes: cables` puts them in."
    ),
    "cables": "Bending of falx and tentorium: they are nets of cables, which pull alone.",
}
_STRUCTURE = {
    "rigid": (
        "Deformation of shell and facemask. They move as one rigid body: at this resolution one element across a"
        " wall or a bar could bend by hourglass modes alone."
    ),
    "deformable": "Bending of shell and facemask: one element across is carried by hourglass stiffness.",
}


def run(workspace: Workspace) -> str | None:
    """Write the page of a play, however far it came."""
    stage = Stage(workspace, "report", after=["settings", *_TITLES, "verdict"])
    page = write_report(stage.folder_for_many(), collect(stage))
    stage.write("report.html", "the page: verdict, evidence, and what the run cannot show")
    for picture in sorted((stage.folder / "figures").glob("*")):
        stage.write(f"figures/{picture.name}", "a figure of the page")
    print(f"{page}: {page.stat().st_size / 1e6:.1f} MB, opens without a network")
    return stage.finish()


def collect(stage: Stage) -> ReportInput:
    """Gather what the page shows; what a rejected play never reached stays absent."""
    play = read_settings(stage)
    limits = limits_of(stage)
    inputs = read_json(stage.read("inputs", "inputs.json"))
    quality = read_json(stage.read("reconstruction", "quality.json")) if play.recorded else {}
    clicked = quality.get("kind") == "clicks"
    model = read_model(stage.read("assembly", "model.h5"))
    known: dict[str, Any] = {
        "play": _play_facts(play, quality, model.info["helmet"]["chosen"]),
        "verdict": read_json(stage.read("verdict", "verdict.json")),
        "gates": _gates(stage, limits),
        "gate_facts": {
            name: {"title": facts.title, "source": facts.source, "stops_run": facts.stops_run}
            for name, facts in limits.protocol.items()
        },
        "stages": _stages(stage),
        "recorded": play.recorded,
        "t0_s": quality.get("driving_t0_s"),
        "kinematics": _table(stage, "reconstruction", "kinematics.csv") if play.recorded else None,
        "peaks": _table(stage, "reconstruction", "peaks.csv") if clicked else None,
        "quality": _table_two(stage, limits) if clicked else (),
        "parts": _parts(stage, model),
        "parameters": _parameters(model),
        "mesh": _mesh(model),
        "cannot_show": [
            _SEAT[play.model.helmet_seat],
            *_blow(play),
            _BRAIN[play.model.brain_material],
            _MEMBRANES[play.model.membranes],
            _STRUCTURE[play.model.helmet_structure],
            *quality.get("warnings", ()),
        ],
        "inputs": inputs["files"],
        "provenance": _provenance(stage, model),
        "mass_scaling_time_step_s": play.solver.mass_scaling_time_step_s,
    }
    if stage.made("driver", "driver_6dof.csv"):
        start = read_json(stage.read("driver", "initial_velocity.json"))["time_s"]
        known["driver"] = _table(stage, "driver", "driver_6dof.csv")
        known["window_s"] = (start, start + play.window.duration_s)
    if stage.made("measures", "measures.json"):
        known |= _replayed(stage, play, model)
    if not play.recorded and stage.made("measures", "head_motion.csv"):
        known["kinematics"] = _table(stage, "measures", "head_motion.csv")
    return ReportInput(**known)


def _replayed(stage: Stage, play: Play, model: Model) -> dict[str, Any]:
    """What only a replay that ran to its end has."""
    measures = read_json(stage.read("measures", "measures.json"))
    tracked = 1 if play.collision is None else ROLES[play.collision.tracked]
    applied = skull_motion(stage, tracked)
    scene = replayed_model(stage)
    fluid = {p.pid for p in scene.parts if scene.materials[p.material]["law"] == "fluid"}
    energy = _table(stage, "replay", "part_energy.csv")
    damaged = stage.made("measures", "damage_volume.csv")
    return {
        "applied": _columns(applied),
        "fidelity": read_json(stage.read("fidelity", "fidelity.json")) if play.recorded else None,
        "initial_conditions": _initial_conditions(stage, applied),
        "energy": _table(stage, "replay", "energy.csv"),
        "timestep": _table(stage, "replay", "timestep.csv").query("step > 0"),
        "part_energy": energy.assign(fluid=energy["pid"].isin(fluid)),
        "contact": measures["contact"]["pairs"],
        "head_measures": measures["head"],
        "brain_histories": _table(stage, "replay", "brain_histories.csv"),
        "convergence_class": measures["brain_convergence_class"],
        "damage": _table(stage, "measures", "damage_volume.csv") if damaged else None,
        "damage_sensitivity": _table(stage, "replay", "damage_sensitivity.csv") if damaged else None,
        "action": _table(stage, "measures", "action.csv"),
        "crossover_s": measures["action"]["crossover_time_s"],
        "snapshots": _snapshots(stage, model),
        "damage_snapshots": _damage_snapshots(stage, model) if damaged else None,
        "pads": measures["pads"],
        **_collided(stage, play, measures),
    }


def _collided(stage: Stage, play: Play, measures: dict[str, Any]) -> dict[str, Any]:
    """What only two players have: how they met, the force between them, and published numbers beside theirs."""
    if play.collision is None:
        return {}
    met = {
        "scene": stage.read("placement", "preview.png").read_bytes(),
        "blow": _table(stage, "measures", "blow_force.csv") if stage.made("measures", "blow_force.csv") else None,
    }
    if play.collision.apparatus is not None:
        return met
    head = {entry["name"]: entry["value"] for entry in measures["head"]}
    masses = read_json(stage.read("assembly", "mass_properties.json"))["assemblies"]
    damage = measures["damage"]
    return met | {
        "published": {
            "closing_speed_m_per_s": read_json(stage.read("placement", "placement.json"))["closing_speed_m_per_s"],
            **dict.fromkeys(NAMES),
            **{name: head[name] for name in head if name.startswith("peak_")},
            "crossover_time_s": measures["action"]["crossover_time_s"],
            "head_action_J_s": measures["action"]["head"],
            "damage_onset_s": damage["brain"]["onset_phi_0.001_s"] if damage else None,
            "head_mass_kg": masses["head"]["mass_kg"],
            "helmet_mass_kg": masses["helmet"]["mass_kg"],
        },
    }


def _table(stage: Stage, name: str, file: str) -> pd.DataFrame:
    return pd.read_csv(stage.read(name, file))


def _blow(play: Play) -> list[str]:
    """What the way in which the head is struck cannot show."""
    if play.collision is None:
        return [_DRIVEN]
    players = [player for role in ROLES if (player := play.collision.player(role)) is not None]
    bodies = [player.body for player in players]
    if len(players) < len(ROLES):
        return [_BODY if all(bodies) else _FREE_HEAD]
    return [_BODY] * any(bodies) + [_NO_BODY] * (not all(bodies))


def _play_facts(play: Play, quality: dict[str, Any], worn: Mapping[str, str]) -> dict[str, Any]:
    recorded = {}
    if play.recorded:
        recorded = {
            "sampling": f"{quality['rate_hz']:g} Hz, {quality['samples']} samples",
            "t0": f"{1e3 * quality['driving_t0_s']:.1f} ms (peak {play.t0} acceleration)",
        }
    length = f"{1e3 * play.window.duration_s:g} ms"
    start = f"{1e3 * play.window.before_t0_s:g} ms before t0" if recorded else "first contact"
    weight = "not weighed" if play.helmet.mass_kg is None else f"{play.helmet.mass_kg:g} kg"
    return {
        "name": play.name,
        "title": play.title,
        "struck player": play.struck_player,
        "source": _SOURCES[play.source.kind],
        **recorded,
        "window": f"{length} from {start}",
        "helmet": f"{play.helmet.model}, {weight}",
        "finite-element helmet": ", ".join(f"{name} {value}" for name, value in worn.items()),
        "model": f"{play.model.preset}, {play.model.resolution}",
    }


def _gates(stage: Stage, limits: Limits) -> list[Any]:
    found = {}
    for name, files in ALL_GATE_FILES.items():
        for file in files:
            if stage.made(name, file):
                gate = read_json(stage.read(name, file))
                found[gate["gate"]] = gate
    return [found[name] for name in limits.gates if name in found]


def _stages(stage: Stage) -> list[dict[str, str]]:
    rows = []
    here = stages_of(stage.workspace)
    for name, title in ((name, title) for name, title in _TITLES.items() if name in here):
        manifest = stage.manifest_of(name)
        verdicts = [
            read_json(stage.read(name, file))["verdict"] for file in GATE_FILES.get(name, ()) if stage.made(name, file)
        ]
        state = next((v for v in ("fail", "warn", "pass") if v in verdicts), "done")
        if not manifest.artifacts:
            state = "not run"
        rows.append({"title": title, "state": state, "detail": ""})
    return rows


def _table_two(stage: Stage, limits: Limits) -> list[dict[str, Any]]:
    """The article's Table 2 from the frames of this run."""
    frames = _table(stage, "reconstruction", "qc_per_frame.csv")
    rows = []
    for metric, unit, column, limit in (
        ("Reprojection error", "px", "reprojection_rmse_px", "reconstruction.reprojection_rmse_median_px"),
        ("Focal-length drift", "%", "focal_drift_percent", "reconstruction.focal_drift_median_percent"),
        ("Landmark baseline drift", "%", "baseline_drift_percent", "reconstruction.baseline_drift_median_percent"),
    ):
        values = frames[column].dropna().to_numpy()
        q1, median, q3, p95 = np.percentile(values, [25, 50, 75, 95])
        rows.append(
            {
                "metric": metric,
                "unit": unit,
                "median": float(median),
                "q1": float(q1),
                "q3": float(q3),
                "p95": float(p95),
                "limit": limits[limit].text(),
            }
        )
    return rows


def _initial_conditions(stage: Stage, applied: Motion) -> list[dict[str, Any]]:
    """The article's Table 3: what was reconstructed at the start of the window, and what the model started with."""
    told = {}
    if stage.made("driver", "initial_velocity.json"):
        told = read_json(stage.read("driver", "initial_velocity.json"))
    if stage.made("placement", "placement.json"):
        return _two_starts(stage, told)
    return [
        {
            "item": item,
            "unit": unit,
            "reconstruction": told[key],
            "applied": [float(v) for v in vectors[0]],
        }
        for item, unit, key, vectors in (
            ("velocity of the skull CG", "m/s", "velocity_m_per_s", applied.velocity_m_per_s),
            ("angular velocity", "rad/s", "omega_rad_per_s", applied.angular_velocity_rad_per_s),
        )
    ]


def _two_starts(stage: Stage, told: dict[str, Any]) -> list[dict[str, Any]]:
    """Table 3 of two players; the reconstruction shows one of them."""
    collision = read_settings(stage).collision
    players = read_json(stage.read("placement", "placement.json"))["players"]
    rows = []
    for role, start in players.items():
        seen = bool(told) and collision is not None and role == collision.tracked
        axis = np.array(start["Q_global_m"]) - np.array(start["P_global_m"])
        omega = start["omega_rad_per_s"] * axis / np.sqrt(axis @ axis)
        for item, unit, key, applied in (
            (f"velocity of the {role}", "m/s", "velocity_m_per_s", start["velocity_m_per_s"]),
            (f"angular velocity of the {role}", "rad/s", "omega_rad_per_s", omega.tolist()),
        ):
            rows.append({"item": item, "unit": unit, "reconstruction": told[key] if seen else None, "applied": applied})
    return rows


def _columns(motion: Motion) -> pd.DataFrame:
    out = {"time_s": motion.time_s}
    for axis, k in zip("xyz", range(3)):
        out[f"{axis}_m"] = motion.position_m[:, k]
        out[f"v{axis}_m_per_s"] = motion.velocity_m_per_s[:, k]
        out[f"a{axis}_m_per_s2"] = motion.acceleration_m_per_s2[:, k]
        out[f"omega_{axis}_rad_per_s"] = motion.angular_velocity_rad_per_s[:, k]
        out[f"alpha_{axis}_rad_per_s2"] = motion.angular_acceleration_rad_per_s2[:, k]
    for k, axis in enumerate("xyzw"):
        out[f"q{axis}"] = motion.quaternion[:, k]
    return pd.DataFrame(out)


def _parts(stage: Stage, model: Model) -> list[dict[str, Any]]:
    """The article's Table 1 for this model."""
    table = _table(stage, "assembly", "parts.csv")
    rows = []
    for row in table.to_dict("records"):
        parameters = model.materials[row["material"]]["parameters"]
        rows.append(
            {
                "part": row["name"],
                "material": row["material"],
                "density_kg_per_m3": row["density_kg_per_m3"],
                "youngs_modulus_pa": parameters.get("youngs_modulus_pa"),
                "poisson_ratio": parameters.get("poisson_ratio"),
                "elements": row["elements"],
                "nodes": row["nodes"],
                "volume_m3": row["volume_m3"],
                "mass_kg": row["mass_kg"],
            }
        )
    return rows


# Suffix of a parameter's name, and its unit as printed.
_UNITS = {"_pa": "Pa", "_kg_per_m3": "kg/m^3", "_times_s": "s", "_per_s": "1/s", "_s": "s"}


def _parameters(model: Model) -> list[dict[str, Any]]:
    rows = []
    for name, facts in model.materials.items():
        certainty = facts["certainty"]
        for parameter, value in {"density_kg_per_m3": facts["density_kg_per_m3"], **facts["parameters"]}.items():
            suffix = next((ending for ending in _UNITS if parameter.endswith(ending)), "")
            rows.append(
                {
                    "material": name,
                    "parameter": parameter.removesuffix(suffix),
                    "value": ", ".join(f"{v:g}" for v in value) if isinstance(value, list | tuple) else value,
                    "unit": _UNITS.get(suffix, ""),
                    "certainty": certainty.get(parameter, "assumed") if isinstance(certainty, dict) else certainty,
                    "source": facts["source"],
                }
            )
    return rows


def _mesh(model: Model) -> MeshView:
    """Head and helmet, without the body that they may hang on."""
    roles = np.array([part.role for part in model.parts])
    shown = ~model.elements_of(assembly="body")
    return MeshView(model.nodes, model.hexes[shown], roles[model.element_part[shown]])


def _snapshots(stage: Stage, model: Model) -> Snapshots:
    time, ids, values = read_snapshots(stage.read("replay", "brain_snapshots.h5"))
    return Snapshots(time, _shown_rows(model, ids), values)


def _damage_snapshots(stage: Stage, model: Model) -> Snapshots:
    """The damage variable of the struck brain at the stored states (article, Figure 6)."""
    brain = model.element_ids[model.elements_of(role="brain", player=1)]
    with read_states(stage.read("replay", "states.vtkhdf")) as states:
        at = np.flatnonzero(np.isin(states.element_ids, brain))
        values = np.array([states.field("HV57", k)[at] for k in range(len(states))])
        return Snapshots(states.times_s, _shown_rows(model, states.element_ids[at]), values, "damage variable φ")


def _shown_rows(model: Model, ids: np.ndarray) -> np.ndarray:
    """Rows of elements, by their numbers, in the `MeshView` of `_mesh`."""
    shown = model.element_ids[~model.elements_of(assembly="body")]
    row = {int(number): k for k, number in enumerate(shown)}
    return np.array([row[int(i)] for i in ids])


def _provenance(stage: Stage, model: Model) -> dict[str, Any]:
    out: dict[str, Any] = {"replay": __version__, **stage.manifest_of("assembly").versions}
    out["model preset and resolution"] = f"{model.info['preset']}, {model.info['resolution']}"
    if stage.made("replay", "run.json"):
        run = read_json(stage.read("replay", "run.json"))
        out |= {
            "solver state": run["state_hash"],
            "solver model": run["model_hash"],
            "solver code": run["code_hash"],
            "steps": run["steps"],
        }
    return out
