"""A part that does not deform: its elements are not computed, its nodes move as one body."""

from __future__ import annotations

from dataclasses import dataclass

NAME = "rigid"
INITIAL_STRESS = False


@dataclass(frozen=True)
class Parameters:
    """Stiffness of what is modelled as rigid: kept for exported decks and contact, not used in a step.

    Parameters
    ----------
    youngs_modulus_pa
        Young's modulus [Pa].
    poisson_ratio
        Poisson's ratio.
    """

    youngs_modulus_pa: float = 0.0
    poisson_ratio: float = 0.0

    def __post_init__(self) -> None:
        if not self.youngs_modulus_pa >= 0:
            message = f"youngs_modulus_pa is {self.youngs_modulus_pa!r}; it must not be negative"
            raise ValueError(message)
        if not -1 < self.poisson_ratio < 0.5:
            message = f"poisson_ratio is {self.poisson_ratio!r}; it must lie between -1 and 0.5, both excluded"
            raise ValueError(message)

    def elastic_moduli(self) -> tuple[float, float]:
        """Bulk and shear modulus [Pa]."""
        e, nu = self.youngs_modulus_pa, self.poisson_ratio
        return e / (3 * (1 - 2 * nu)), e / (2 * (1 + nu))
