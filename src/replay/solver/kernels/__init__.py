"""The compiled physics of the solver; see `device` for how, `lanes` for the element loop."""

from replay.solver.kernels.cache import source_hash

__all__ = ["source_hash"]
