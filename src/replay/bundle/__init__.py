"""Bundles: what a run made, sealed so that another laboratory can check it and run it again."""

from replay.bundle.compare import Comparison, Difference, compare
from replay.bundle.names import shown
from replay.bundle.package import package_facts
from replay.bundle.seal import seal
from replay.bundle.sealed import SealedRun, foreign_content, open_run
from replay.bundle.signature import sign, signature_path, signer_of
from replay.bundle.verify import VerifyReport, verify

__all__ = [
    "Comparison",
    "Difference",
    "SealedRun",
    "VerifyReport",
    "compare",
    "foreign_content",
    "open_run",
    "package_facts",
    "seal",
    "shown",
    "sign",
    "signature_path",
    "signer_of",
    "verify",
]
