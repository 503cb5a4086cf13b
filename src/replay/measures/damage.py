"""The brain's damage variable phi (HV57): damaged volume by region, onset, and how much of it is choice.

phi is the pore volume fraction of the law ``brain_isv``: a diagnostic that nothing in the run feels. For the same
reason it can be integrated a second time with other constants beside the run, from stress, plastic strain and
deformation at the history times: `DamageRecorder` does so for the cap of Cocks and Ashby, m_CA and K_pore, and for the
run's own constants, so that the error of the coarser sampling can be read.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from replay.measures.brain import WHOLE_BRAIN, BrainView
from replay.solver.kernels.pore_growth import advance_pores
from replay.tables import Column, TableFormat

#: Minimal and critical damage (article, Figure 8).
THRESHOLDS = (0.001, 0.34)
#: Constants of pore growth by their names in the law, and the factors by which each is changed on its own.
VARIED = {
    "triaxiality_cap": (0.5, 2.0),
    "pore_growth_exponent": (0.8, 1.25),
    "pore_shear_sensitivity": (0.1, 10.0, 100.0),
}
_VOLUMES = tuple((f"volume_phi_{level:g}_m3", f"undeformed volume with phi >= {level:g}") for level in THRESHOLDS)
_DAMAGE = (
    Column("region", "region of the brain, or `brain` for all of it", "text"),
    Column("volume_m3", "undeformed volume of the region"),
    *(Column(name, meaning) for name, meaning in _VOLUMES),
    Column("phi_mean", "mean over volume"),
    Column("phi_max", "maximum over elements"),
)
DAMAGE_TABLE = TableFormat("damaged volume by region", (Column("time_s", "time since the start of the run"), *_DAMAGE))
DAMAGE_VOLUME_TABLE = TableFormat(
    "damaged volume against time and mechanical action",
    (
        Column("time_s", "time since the start of the run"),
        Column("head_J_s", "mechanical action of the head so far"),
        *_DAMAGE,
    ),
)
ONSET_TABLE = TableFormat(
    "damage of the brain's elements",
    (
        Column("element_id", "number of the element in the model", "int"),
        Column("volume_m3", "undeformed volume"),
        Column("phi", "at the end of the run"),
        Column("equivalent_plastic_strain", "at the end of the run"),
        *(
            Column(
                f"onset_phi_{level:g}_s", f"when phi first reached {level:g}; empty where it did not", may_be_empty=True
            )
            for level in THRESHOLDS
        ),
    ),
)
SENSITIVITY_TABLE = TableFormat(
    "sensitivity of damage to the constants of pore growth, whole brain at the end of the run",
    (
        Column(
            "constant",
            "what is changed; `run`: the run itself, `none`: its set at history times",
            "text",
        ),
        Column("factor", "by which it is multiplied"),
        Column("value", "its value", may_be_empty=True),
        *(Column(name, meaning) for name, meaning in _VOLUMES),
        Column("phi_mean", "mean over volume"),
        Column("phi_max", "maximum over elements"),
    ),
)


class DamageView(BrainView, Protocol):
    """What the recorder needs to see of a state of the solver."""

    def variable(self, name: str) -> NDArray[np.float64]:
        """State variable of the laws by name (m,)."""


class DamageRecorder:
    """Gathers phi of the brain while the solver runs.

    Parameters
    ----------
    rows : (k,) int
        Elements of the brain, as rows of the model's elements.
    element_ids : (k,) int
        Their numbers in the model.
    groups
        Region name -> positions within `rows`. The whole brain is added as ``brain``.
    constants
        ``pore_growth_exponent``, ``pore_shear_sensitivity``, ``initial_porosity`` and ``triaxiality_cap`` of the law.
    """

    def __init__(
        self, rows: ArrayLike, element_ids: ArrayLike, groups: Mapping[str, ArrayLike], constants: Mapping[str, float]
    ) -> None:
        self._rows = np.asarray(rows, dtype=np.int64)
        self._element_ids = np.asarray(element_ids, dtype=np.int64)
        chosen = {name: np.asarray(at, dtype=np.int64) for name, at in groups.items()}
        self._groups = {WHOLE_BRAIN: np.arange(self._rows.size)} | {n: g for n, g in chosen.items() if g.size}
        own = {name: float(constants[name]) for name in VARIED}
        self._variants = [("none", 1.0, own)] + [
            (name, factor, {**own, name: own[name] * factor}) for name, factors in VARIED.items() for factor in factors
        ]
        k, porosity = self._rows.size, float(constants["initial_porosity"])
        powers = [values["pore_growth_exponent"] + 1.0 for _, _, values in self._variants]
        self._w = np.array([np.full(k, -math.expm1(power * math.log1p(-porosity))) for power in powers])
        self._phi = np.full((len(self._variants), k), porosity)
        self._onsets = np.full((len(THRESHOLDS), k), np.nan)
        self._last = {
            "f": np.broadcast_to(np.eye(3), (k, 3, 3)).copy(),
            "plastic": np.zeros(k),
            "now": np.full(k, porosity),
        }
        self._volumes = np.zeros(0)
        self._times: list[float] = []
        self._histories: list[NDArray[np.float64]] = []

    def sample(self, view: DamageView) -> None:
        """Take the state of one history time."""
        if self._volumes.size == 0:
            self._volumes = np.array(view.volumes[self._rows], dtype=float)
        phi, plastic = view.variable("phi")[self._rows], view.variable("equivalent_plastic_strain")[self._rows]
        f = view.deformation_gradient()[self._rows]
        strain = _strain_between(self._last["f"], f)
        stress = np.ascontiguousarray(view.stress[self._rows])
        for j, (_, _, c) in enumerate(self._variants):
            advance_pores(
                self._w[j], self._phi[j], stress, strain, plastic - self._last["plastic"], c["pore_growth_exponent"],
                c["pore_shear_sensitivity"], c["triaxiality_cap"],
            )  # fmt: skip
        for j, level in enumerate(THRESHOLDS):
            begun = np.isnan(self._onsets[j]) & (phi >= level)
            self._onsets[j][begun] = view.time_s
        self._last = {"f": f.copy(), "plastic": plastic, "now": phi}
        self._times.append(float(view.time_s))
        self._histories.append(np.stack([self._summary(phi[at], self._volumes[at]) for at in self._groups.values()]))

    @staticmethod
    def _summary(phi: NDArray, weight: NDArray) -> NDArray[np.float64]:
        above = [float(weight[phi >= level].sum()) for level in THRESHOLDS]
        return np.array([float(weight.sum()), *above, float(phi @ weight / weight.sum()), float(phi.max())])

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything gathered so far, for a checkpoint."""
        return {
            "volumes": self._volumes.copy(),
            "w": self._w.copy(),
            "phi": self._phi.copy(),
            "onsets": self._onsets.copy(),
            "times": np.array(self._times),
            "histories": np.array(self._histories).reshape(len(self._times), len(self._groups), -1),
            **{f"last_{name}": value.copy() for name, value in self._last.items()},
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go back to a state that `state` returned."""
        self._volumes = np.array(state["volumes"], dtype=float)
        self._w, self._phi, self._onsets = (np.array(state[name], dtype=float) for name in ("w", "phi", "onsets"))
        self._times = [float(t) for t in state["times"]]
        self._histories = [np.array(row) for row in state["histories"]]
        self._last = {name: np.array(state[f"last_{name}"], dtype=float) for name in self._last}

    def write(self, folder: Path) -> None:
        """Write brain_damage.csv, element_damage.csv and damage_sensitivity.csv."""
        folder = Path(folder)
        names, count = list(self._groups), len(self._times)
        columns = np.array(self._histories).reshape(count * len(names), -1).T
        DAMAGE_TABLE.write(
            folder / "brain_damage.csv",
            {
                "time_s": np.repeat(self._times, len(names)),
                "region": names * count,
                **dict(zip(DAMAGE_TABLE.names[2:], columns)),
            },
        )
        ONSET_TABLE.write(
            folder / "element_damage.csv",
            dict(
                zip(
                    ONSET_TABLE.names,
                    [self._element_ids, self._volumes, self._last["now"], self._last["plastic"], *self._onsets],
                )
            ),
        )
        rows: list[list[Any]] = [["run", 1.0, math.nan, *self._summary(self._last["now"], self._volumes)[1:]]]
        for j, (name, factor, values) in enumerate(self._variants):
            rows.append([name, factor, values.get(name, math.nan), *self._summary(self._phi[j], self._volumes)[1:]])
        SENSITIVITY_TABLE.write(folder / "damage_sensitivity.csv", dict(zip(SENSITIVITY_TABLE.names, zip(*rows))))


def _strain_between(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """Increment of strain D dt (k, 6) from mid-step deformation."""
    gradient = np.linalg.solve(np.swapaxes(0.5 * (before + after), 1, 2), np.swapaxes(after - before, 1, 2))
    strain = 0.5 * (gradient + np.swapaxes(gradient, 1, 2))
    rows, columns = [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]
    return np.ascontiguousarray(strain[:, rows, columns])


def damage_summary(damage: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Damage by region at the end of the run, and its two onsets.

    Parameters
    ----------
    damage
        Rows of brain_damage.csv or of damage_volume.csv.

    Returns
    -------
    dict
        Region -> ``volume_m3``, for each threshold the damaged volume at the end [m^3] and the time of onset [s] (None
        where it was never reached), ``phi_mean`` and ``phi_max``.
    """
    out: dict[str, dict[str, Any]] = {}
    for region, rows in damage.groupby("region", sort=False):
        last = rows.iloc[-1]
        entry: dict[str, Any] = {name: float(last[name]) for name in ("volume_m3", "phi_mean", "phi_max")}
        for (column, _), level in zip(_VOLUMES, THRESHOLDS):
            entry[column] = float(last[column])
            reached = rows.loc[rows[column] > 0, "time_s"]
            entry[f"onset_phi_{level:g}_s"] = float(reached.iloc[0]) if len(reached) else None
        out[str(region)] = entry
    return out
