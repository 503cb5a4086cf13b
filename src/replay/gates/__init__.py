"""Gates: every accept or reject decision of the protocol, and nothing else."""

from replay.gates.agreement import agreement_gate
from replay.gates.assembly import assembly_gate
from replay.gates.fidelity import fidelity_gate
from replay.gates.helmet import helmet_gate
from replay.gates.hourglass_sensitivity import convergence_class, hourglass_sensitivity_gate
from replay.gates.limits import Limit, Limits
from replay.gates.model import Check, Gate, read_gate
from replay.gates.numerics import PartEnergy, numerics_gate, part_energies
from replay.gates.package import package_gate
from replay.gates.placement import placement_gate
from replay.gates.reconstruction import video_reconstruction_gate, wearable_reconstruction_gate
from replay.gates.shake import contact_blow_up, ledger_values, shake_gate
from replay.gates.verdict import PlayVerdict, play_verdict

__all__ = [
    "Check",
    "Gate",
    "Limit",
    "Limits",
    "PartEnergy",
    "PlayVerdict",
    "agreement_gate",
    "assembly_gate",
    "contact_blow_up",
    "convergence_class",
    "fidelity_gate",
    "helmet_gate",
    "hourglass_sensitivity_gate",
    "ledger_values",
    "numerics_gate",
    "package_gate",
    "part_energies",
    "placement_gate",
    "play_verdict",
    "read_gate",
    "shake_gate",
    "video_reconstruction_gate",
    "wearable_reconstruction_gate",
]
