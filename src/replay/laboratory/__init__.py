"""The laboratory: materials put through tests, parameters fitted to what tissue did in them."""

from replay.laboratory.calibration import Fit, Free, calibrate, curve_answer, left_out, rms
from replay.laboratory.hopkinson import Specimen, Squeeze, squeeze
from replay.laboratory.material_point import ANSWER_TABLE, Answer, answer
from replay.laboratory.programme import MODES, Programme, programme
from replay.laboratory.records import Curve, read_tests

__all__ = [
    "ANSWER_TABLE",
    "MODES",
    "Answer",
    "Curve",
    "Fit",
    "Free",
    "Programme",
    "Specimen",
    "Squeeze",
    "answer",
    "calibrate",
    "curve_answer",
    "left_out",
    "programme",
    "read_tests",
    "rms",
    "squeeze",
]
