"""Bundles: what a run made, sealed so that another laboratory can check it and run it again."""

from replay.bundle.compare import Comparison, Difference, compare
from replay.bundle.package import package_facts
from replay.bundle.seal import seal
from replay.bundle.verify import VerifyReport, verify

__all__ = ["Comparison", "Difference", "VerifyReport", "compare", "package_facts", "seal", "verify"]
