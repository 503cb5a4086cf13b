"""Measures: numbers that describe a motion, a deformation, a run; none of them a verdict on a person."""

from replay.measures.action import ACTION_TABLE, crossover_time, kinetic_energy_of, mechanical_action, write_action
from replay.measures.agreement import Agreement, Digitisation, agreement
from replay.measures.brain import BrainRecorder, read_snapshots, regional_summary
from replay.measures.contact_forces import (
    FORCE_TABLE,
    contact_summary,
    force_history,
    impulse_on,
    mount_impulse,
)
from replay.measures.damage import DAMAGE_VOLUME_TABLE, DamageRecorder, damage_summary
from replay.measures.fidelity import Motion, compare, fidelity
from replay.measures.head import bric, damage_deflection, hic, peak, resultant, severity_index
from replay.measures.kinematics import head_measures
from replay.measures.pads import PadRecorder, pad_summary
from replay.measures.rating import Rating, iso_18571, rate
from replay.measures.shake import ShakeRecorder, shake_measures
from replay.measures.strain import (
    green_lagrange,
    logarithmic,
    maximum_shear_strain,
    principal_stretches,
    tensile_pressure,
    volume_fraction_at_least,
    von_mises,
    weighted_percentile,
)

__all__ = [
    "ACTION_TABLE",
    "DAMAGE_VOLUME_TABLE",
    "FORCE_TABLE",
    "Agreement",
    "BrainRecorder",
    "DamageRecorder",
    "Digitisation",
    "Motion",
    "PadRecorder",
    "Rating",
    "ShakeRecorder",
    "agreement",
    "bric",
    "compare",
    "contact_summary",
    "crossover_time",
    "damage_deflection",
    "damage_summary",
    "fidelity",
    "force_history",
    "green_lagrange",
    "head_measures",
    "hic",
    "impulse_on",
    "iso_18571",
    "kinetic_energy_of",
    "logarithmic",
    "maximum_shear_strain",
    "mechanical_action",
    "mount_impulse",
    "pad_summary",
    "peak",
    "principal_stretches",
    "rate",
    "read_snapshots",
    "regional_summary",
    "resultant",
    "severity_index",
    "shake_measures",
    "tensile_pressure",
    "volume_fraction_at_least",
    "von_mises",
    "weighted_percentile",
    "write_action",
]
