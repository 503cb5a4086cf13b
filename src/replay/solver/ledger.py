"""The energy ledger: every joule that enters, moves or is lost, by the work of the discrete forces.

Central differences change the kinetic energy of a step by exactly the forces' work with the mean
of the velocities before and after, so

    kinetic + (work absorbed by elements) + joints + straps + ties - (work from outside) = kinetic at time 0

holds to rounding at every half step: that is `closure`, an identity of the arithmetic, which a lost
force, a wrong mass or a damaged restart would break. What the elements absorb is also summed
independently from their stresses, hourglass forces and bulk viscosity with mid-step rates. The
difference of the two, ``integration_J``, is the error of the time integration; the energy ratio is
formed without it and shows it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

STRESS, HOURGLASS, VISCOSITY = 0, 1, 2


@dataclass(frozen=True)
class Energies:
    """The ledger at one time; field names are the columns of energy.csv without unit.

    Parameters
    ----------
    kinetic
        Mean of the half steps before and after [J].
    internal
        Work of the stresses at mid-step rates [J].
    hourglass, bulk_viscosity
        Work of the hourglass forces, of the bulk viscosity [J].
    contact_normal, friction
        Work lost in contact and friction [J].
    joint_spring, joint_damper
        Work taken by the springs of joints (what they store) and by their dampers (what they lose) [J].
    strap
        Work taken by straps: stored, lost in their damping, less what paying in brings [J].
    tie
        Work taken by rigid and tied nodes, whose constraints should take none: rounding [J].
    external_work
        Work of drivers, supports, loads and weight [J].
    added_mass_kinetic
        Share of `kinetic` that belongs to added mass [J].
    plastic
        Share of `internal` that plastic flow has turned into heat [J].
    integration
        Work of nodal forces on elements beyond that of stress, hourglass and viscosity [J].
    initial
        Kinetic energy at time 0 [J].
    """

    kinetic: float
    internal: float
    hourglass: float
    bulk_viscosity: float
    contact_normal: float
    friction: float
    joint_spring: float
    joint_damper: float
    strap: float
    tie: float
    external_work: float
    added_mass_kinetic: float
    plastic: float
    integration: float
    initial: float

    @property
    def total(self) -> float:
        """Sum of what is stored and what is lost [J]."""
        lost = self.bulk_viscosity + self.contact_normal + self.friction
        linked = self.joint_spring + self.joint_damper + self.strap + self.tie
        return self.kinetic + self.internal + self.hourglass + lost + linked

    @property
    def ratio(self) -> float:
        """Total over initial energy plus external work; 1 where nothing has moved yet."""
        reference = self.initial + self.external_work
        return self.total / reference if reference != 0 else 1.0

    @property
    def closure(self) -> float:
        """Residual of the discrete identity over the largest term of it; rounding only."""
        residual = self.total + self.integration - self.external_work - self.initial
        scale = max(abs(self.kinetic), abs(self.internal), abs(self.external_work), self.initial)
        return residual / scale if scale > 0 else 0.0


class Ledger:
    """Running sums over a run.

    Parameters
    ----------
    n_parts
        Parts of the problem.
    kinetic
        At time 0 [J].
    """

    def __init__(self, n_parts: int, kinetic: float) -> None:
        self.initial = kinetic
        self.part_work = np.zeros((n_parts, 3))
        # half steps before and after the present time: kinetic, absorbed, outside, tie, links (3), contact (2)
        self._before = np.array([kinetic, *[0.0] * 8])
        self._after = self._before.copy()

    def advance(
        self,
        chunks: NDArray[np.float64],
        bodies: NDArray[np.float64],
        linked: tuple[NDArray[np.float64], float] | None = None,
        contact: NDArray[np.float64] | None = None,
    ) -> None:
        """Enter the kick at the present time.

        Parameters
        ----------
        chunks : (n, 4) float64
            Sums of `kernels.assembly.advance_nodes`: kinetic energy, absorbed, outside, (runaways).
        bodies : (n, BODY_SUMS) float64
            Sums of `kernels.bodies.advance_bodies`: kinetic energy, absorbed, outside, tie, (runaways).
        linked
            Work taken by joint springs, joint dampers and straps (3,), and what of it was done on free nodes, where
            `chunks` has entered it as work from outside.
        contact : (SUMS,) float64, optional
            Sums of `kernels.contact_work`: changes of kinetic, absorbed, outside; lost in normal contact, in friction.
        """
        self._before, after = self._after, self._after.copy()
        nodes, carried = chunks.sum(axis=0), bodies.sum(axis=0)
        after[0] = nodes[0] + carried[0]
        after[1] += nodes[1] + carried[1]
        after[2] += nodes[2] + carried[2]
        after[3] += carried[3]
        if linked is not None:
            taken, on_nodes = linked
            after[2] -= on_nodes
            after[4:7] += taken
        if contact is not None:
            after[:3] += contact[:3]
            after[7:] += contact[3:]
        self._after = after

    def energies(self, added_mass_kinetic: float = 0.0, plastic: float = 0.0) -> Energies:
        """Ledger at the present time: the mean of the half steps around it, and the two shares that others know."""
        mean = (0.5 * (self._before + self._after)).tolist()
        kinetic, absorbed, outside, tie, spring, damper, strap, normal, friction = mean
        stress, hourglass, viscosity = self.part_work.sum(axis=0).tolist()
        return Energies(
            kinetic=kinetic,
            internal=stress,
            hourglass=hourglass,
            bulk_viscosity=viscosity,
            contact_normal=normal,
            friction=friction,
            joint_spring=spring,
            joint_damper=damper,
            strap=strap,
            # `tie` is work that the constraint gives
            tie=0.0 - tie,
            external_work=outside,
            added_mass_kinetic=added_mass_kinetic,
            plastic=plastic,
            integration=absorbed - stress - hourglass - viscosity,
            initial=self.initial,
        )

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Everything that a step changes, by name, for a checkpoint."""
        return {"part_work": self.part_work, "before": self._before, "after": self._after}

    def restore(self, arrays: dict[str, NDArray[np.float64]]) -> None:
        """Go back to what `arrays` returned."""
        self.part_work[:] = arrays["part_work"]
        self._before, self._after = arrays["before"].copy(), arrays["after"].copy()
