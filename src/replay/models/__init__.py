"""Head and helmet: the hexahedral model, its materials, its numbers and its picture."""

from replay.models.build import build_model
from replay.models.model import Model, Part, read_model, write_model

__all__ = ["Model", "Part", "build_model", "read_model", "write_model"]
