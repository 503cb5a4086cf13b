"""What a report is made of: plain tables and arrays, each of which may be absent.

The report belongs to no other room: whoever collects the results of a play's stages
(a stage does) fills a `ReportInput`; what a rejected play never reached stays None, and
the page says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Row = Mapping[str, Any]


@dataclass(frozen=True)
class MeshView:
    """The model as the pictures need it.

    Parameters
    ----------
    nodes : (n, 3) float64
        Coordinates [m], head frame: x anterior, y left, z superior.
    hexes : (m, 8) int
        Node rows of each element.
    element_role : (m,) str
        Role of each element's part: brain, csf, skull, scalp, comfort_pad, energy_pad,
        shell, facemask, chin_cup (another role is drawn grey).
    """

    nodes: NDArray[np.float64]
    hexes: NDArray[np.integer]
    element_role: NDArray[np.str_]


@dataclass(frozen=True)
class Snapshots:
    """A value of some elements at several times.

    Parameters
    ----------
    time_s : (s,)
        Rising times [s].
    rows : (k,) int
        Elements, as rows of the model's elements.
    values : (s, k)
        The value of each at each time.
    name
        What it is, for the colour bar.
    """

    time_s: NDArray[np.float64]
    rows: NDArray[np.integer]
    values: NDArray[np.floating]
    name: str = "maximum principal strain (Green-Lagrange)"


@dataclass(frozen=True)
class ReportInput:
    """Everything the page shows.

    Parameters
    ----------
    play
        ``name``, ``title``; any further entries are printed as facts of the play, in order
        (keys are labels).
    verdict
        Content of verdict.json: ``status``, ``line``, ``stopped_by``, ``not_evaluated``,
        ``causes``, ``loosened``.
    gates
        Contents of the gate.json files, in the order of the protocol.
    gate_facts
        Gate name -> ``title``, ``source``, ``stops_run``, in the order of the protocol.
    stages
        One entry a stage: ``title``, ``state`` (``pass``, ``warn``, ``fail``, ``done`` or
        ``not run``) and ``detail``.
    recorded
        Whether the head's motion was recorded; without a record `kinematics` is the motion in the model.
    t0_s, window_s
        The impact reference and the analysis window (start, end), on the clock of `kinematics`.
    kinematics
        kinematics.csv.
    peaks
        peaks.csv: both modes, where the motion comes from clicks.
    driver, applied
        driver_6dof.csv, and the skull's motion in the model with the same headings.
    fidelity
        Content of fidelity.json.
    quality
        Rows of the article's Table 2: ``metric``, ``unit``, ``median``, ``q1``, ``q3``, ``p95``, ``limit``.
    initial_conditions
        Rows of its Table 3: ``item``, ``unit``, ``reconstruction`` and ``applied`` (three
        components each, or None).
    energy
        energy.csv.
    timestep
        ``time_s``, ``time_step_s``.
    time_step_floor_s, mass_scaling_time_step_s
        Lines in the picture of the time step; None leaves them out.
    part_energy
        ``time_s``, ``part``, ``internal_J``, ``hourglass_J``: one row a part and time; with a
        column ``fluid`` (truth value) such parts are shown by their share of the whole.
    contact
        Rows of the pairs of parts that touched: ``first``, ``second``, ``peak_force_N``, ``impulse_N_s``,
        ``normal_J``, ``friction_J``.
    head_measures
        Rows with ``name``, ``value``, ``unit``, ``definition``, ``source``.
    brain_histories
        brain_histories.csv.
    convergence_class
        ``A``, ``B``, ``C`` or ``unknown``: shown beside every strain.
    damage, damage_sensitivity
        damage_volume.csv, damage_sensitivity.csv; None where the brain's law has no damage variable.
    action
        action.csv.
    crossover_s
        When the mechanical action of head and impactor cross; None without an impactor.
    parts
        Rows of the article's Table 1: ``part``, ``material``, ``density_kg_per_m3``,
        ``youngs_modulus_pa``, ``poisson_ratio``, ``elements``, ``nodes``, ``volume_m3``, ``mass_kg``.
    parameters
        ``material``, ``parameter``, ``value``, ``unit``, ``certainty`` (measured, calibrated,
        assumed, article), ``source``.
    mesh, snapshots, damage_snapshots
        For the pictures of the model, of the strain and of the damage variable.
    published
        Values of a collision by the keys of ``published.yaml``; None of a driven head and of a laboratory's test.
    blow
        blow_force.csv: the impactor's force on the struck player; None of a driven head.
    pads
        Rows of the pads: ``part``, ``compression_mean``, ``compression_max``, ``time_s``.
    scene
        Picture of two players at first contact, PNG; None of a driven head.
    cannot_show
        Sentences on what this run cannot show, beside those that hold for every run.
    inputs
        ``file``, ``bytes``, ``sha256``.
    provenance
        Label -> value: versions, hashes. No clock and no host name.
    """

    play: Row
    verdict: Row
    gates: Sequence[Row]
    gate_facts: Mapping[str, Row]
    stages: Sequence[Row] = ()
    recorded: bool = True
    t0_s: float | None = None
    window_s: tuple[float, float] | None = None
    kinematics: pd.DataFrame | None = None
    peaks: pd.DataFrame | None = None
    driver: pd.DataFrame | None = None
    applied: pd.DataFrame | None = None
    fidelity: Row | None = None
    quality: Sequence[Row] = ()
    initial_conditions: Sequence[Row] = ()
    energy: pd.DataFrame | None = None
    timestep: pd.DataFrame | None = None
    time_step_floor_s: float | None = 1e-7
    mass_scaling_time_step_s: float | None = None
    part_energy: pd.DataFrame | None = None
    contact: Sequence[Row] = ()
    head_measures: Sequence[Row] = ()
    brain_histories: pd.DataFrame | None = None
    convergence_class: str = "unknown"
    damage: pd.DataFrame | None = None
    damage_sensitivity: pd.DataFrame | None = None
    action: pd.DataFrame | None = None
    crossover_s: float | None = None
    parts: Sequence[Row] = ()
    parameters: Sequence[Row] = ()
    mesh: MeshView | None = None
    snapshots: Snapshots | None = None
    damage_snapshots: Snapshots | None = None
    published: Mapping[str, float | None] | None = None
    blow: pd.DataFrame | None = None
    pads: Sequence[Row] = ()
    scene: bytes | None = None
    cannot_show: Sequence[str] = ()
    inputs: Sequence[Row] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
