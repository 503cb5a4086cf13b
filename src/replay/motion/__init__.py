"""Footage or a wearable to the six-degree-of-freedom motion of the skull CG; knows nothing of meshes."""

from replay.motion.driver import Driver, DriverQuality, build_driver
from replay.motion.kinematics import DRIVER, KINEMATICS, Kinematics
from replay.motion.onset import steady_before
from replay.motion.quality import ReconstructionQuality
from replay.motion.reconstruct import Reconstruction, check_tracks, reconstruct
from replay.motion.synthetic import Impact, SyntheticPlay, synthesise

__all__ = [
    "DRIVER",
    "KINEMATICS",
    "Driver",
    "DriverQuality",
    "Impact",
    "Kinematics",
    "Reconstruction",
    "ReconstructionQuality",
    "SyntheticPlay",
    "build_driver",
    "check_tracks",
    "reconstruct",
    "steady_before",
    "synthesise",
]
