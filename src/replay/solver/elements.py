"""The deformable elements of a run, law by law: their state, their masses, their forces."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.solver.kernels.element import Control
from replay.solver.kernels.lanes import LANES, compile_law, reference_size, state_size
from replay.solver.layout import BlockGroup, Layout
from replay.solver.materials import LAWS, law_parameters
from replay.solver.problem import Controls, Problem, gradients


@cache
def law_kernel(law: str) -> Any:
    """Compiled element loop of a law."""
    return compile_law(LAWS[law])


#: Multiples of the coefficient in stiffness and viscosity, and the share of the stiffness against twist. The selective
#: form is calibrated on square bars, bent and twisted, of 4 and of 6 elements across.
_HOURGLASS = {"stiffness": (1.0, 0.0, 1.0), "viscous": (0.0, 1.0, 1.0), "selective": (1.9, 0.0, 0.6 / 1.9)}


def numerical_control(controls: Controls) -> Control:
    """Coefficients of hourglass control and bulk viscosity for the kernels."""
    stiffness, viscosity, twist = _HOURGLASS[controls.hourglass_method]
    kappa = controls.hourglass_coefficient
    return Control(
        stiffness * kappa,
        viscosity * kappa,
        twist,
        float(controls.bulk_viscosity_quadratic),
        float(controls.bulk_viscosity_linear),
    )


class ElementGroup:
    """Elements of one law.

    Parameters
    ----------
    problem, layout
        What to build.
    number : int
        Of the group in the layout.
    force : (n_rows, 3) float64
        Sums of the batches of all groups; this one writes its own rows [N].

    Attributes
    ----------
    stress, hourglass, state : (n_blocks, k, LANES) float64
        Cauchy stress [Pa], hourglass forces [N], variables of the law.
    mass : (n_blocks, LANES) float64
        Element masses with added mass [kg].
    step : (n_blocks, LANES) float64
        Stable steps [s].
    work : (n_blocks, 3) float64
        Work of the last step [J].
    """

    def __init__(self, problem: Problem, layout: Layout, number: int, force: NDArray[np.float64]) -> None:
        group: BlockGroup = layout.groups[number]
        law = LAWS[group.law]
        self.group = group
        self._batches = layout.batches[number]
        self.law = law
        blocks = len(group.fill)
        corners = layout.node_row[problem.hexes[group.rows]]
        self._connectivity = np.ascontiguousarray(corners.transpose(0, 2, 1)).astype(np.uint32)
        gradient, volume = gradients(problem.nodes, problem.hexes[group.rows.ravel()])
        reference = np.empty((blocks, reference_size(law), LANES))
        reference[:, 0] = volume.reshape(blocks, LANES)
        if law.TOTAL_FORM:
            scaled = (gradient / volume[:, None]).reshape(blocks, LANES, 18)
            reference[:, 1:] = scaled.transpose(0, 2, 1)
        self._reference = reference
        density = np.array([part.material.density_kg_per_m3 for part in problem.parts])[group.part]
        self.mass = density[:, None] * reference[:, 0]
        self.physical_mass = self.mass.copy()
        used, self._row = np.unique(group.part, return_inverse=True)
        parameters = [law_parameters(problem.parts[k].material) for k in used]
        self._parameters = np.array([q.constants() for q in parameters], dtype=float).reshape(-1, law.N_CONSTANTS)
        self.stress = np.ascontiguousarray(problem.initial_stress[group.rows].transpose(0, 2, 1))
        self.hourglass = np.zeros((blocks, 12, LANES))
        self.state = np.zeros((blocks, state_size(law), LANES))
        if hasattr(law.Parameters, "initial_state"):
            self.state[:] = np.array([q.initial_state() for q in parameters])[self._row, :, None]
        self._force = force
        self.step = np.zeros((blocks, LANES))
        self.work = np.zeros((blocks, 3))
        self._control = numerical_control(problem.controls)
        self._kernel = law_kernel(group.law)

    def kernel_arguments(self, nodal: NDArray[np.float64], dt: float) -> tuple[Any, ...]:
        """Arguments of `kernels.lanes.law_forces` for these elements."""
        return (
            nodal, self._connectivity, self._batches.place, self._batches.first_row, self.group.fill, self._row,
            self.mass, self._reference, self.stress, self.hourglass, self.state, self._parameters, self._control, dt,
            self._force, self.step, self.work,
        )  # fmt: skip

    def forces(self, nodal: NDArray[np.float64], dt: float) -> None:
        """Bring the elements to the end of a step of length `dt` [s] and write their nodal forces."""
        self._kernel(*self.kernel_arguments(nodal, dt))

    def variable(self, name: str) -> NDArray[np.float64] | None:
        """State variable of the law by name (n_blocks, LANES), if it keeps one."""
        return self.state[:, self.law.STATE.index(name)] if name in self.law.STATE else None

    @property
    def reference_volume(self) -> NDArray[np.float64]:
        """V0 (n_blocks, LANES) [m^3]."""
        return self._reference[:, 0]

    def scatter(self, values: NDArray[np.float64], into: NDArray[np.float64]) -> None:
        """Write values of this group, (n_blocks, k, LANES) or (n_blocks, LANES), to the user's element rows."""
        filled = self.group.filled
        lanes = values if values.ndim == 2 else values.transpose(0, 2, 1)
        into[self.group.rows[filled]] = lanes[filled]

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Everything that a step changes, by name, for a checkpoint."""
        return {"stress": self.stress, "hourglass": self.hourglass, "state": self.state, "mass": self.mass}
