"""Explicit dynamics of one-point hexahedra.

The solver takes arrays and returns arrays: a `Problem` of nodes, hexahedra, parts and `Controls` goes into
`solve`, which writes tables and states to a folder and returns a `RunSummary`. It knows nothing
of plays, heads or helmets. The physics is in `kernels`; docs/physics.md gives the equations.
"""

from replay.solver.contact import ContactControls, ContactPair
from replay.solver.contact.projection import PENETRATION_TABLE, Seating, penetration_table, seat, seated
from replay.solver.contact.recorder import CONTACT_TABLE
from replay.solver.joints import Joint
from replay.solver.kernels import source_hash
from replay.solver.ledger import Energies
from replay.solver.materials import LAWS, Material, law_parameters
from replay.solver.mortar import outer_faces, tie_surfaces
from replay.solver.outputs import ENERGY_TABLE, HISTORY_TABLE, PART_ENERGY_TABLE, TIME_STEP_TABLE
from replay.solver.prescribed import PrescribedMotion, RigidSet, read_motion
from replay.solver.problem import Controls, Problem, SolverPart, initial_velocity_about_axis
from replay.solver.recorders import element_recorder, node_recorder
from replay.solver.rigid import Pose, pose_at
from replay.solver.run import RunSummary, solve
from replay.solver.straps import Strap
from replay.solver.ties import Tie
from replay.solver.view import Recorder, StateView

__all__ = [
    "CONTACT_TABLE",
    "ENERGY_TABLE",
    "HISTORY_TABLE",
    "LAWS",
    "PART_ENERGY_TABLE",
    "PENETRATION_TABLE",
    "TIME_STEP_TABLE",
    "ContactControls",
    "ContactPair",
    "Controls",
    "Energies",
    "Joint",
    "Material",
    "Pose",
    "PrescribedMotion",
    "Problem",
    "Recorder",
    "RigidSet",
    "RunSummary",
    "Seating",
    "SolverPart",
    "StateView",
    "Strap",
    "Tie",
    "element_recorder",
    "initial_velocity_about_axis",
    "law_parameters",
    "node_recorder",
    "outer_faces",
    "penetration_table",
    "pose_at",
    "read_motion",
    "seat",
    "seated",
    "solve",
    "source_hash",
    "tie_surfaces",
]
