"""Materials by name: which laws there are, and what a user may write for each."""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from replay.errors import InputError
from replay.solver.kernels.materials import (
    brain_isv,
    crushable_foam,
    elastic,
    elastic_plastic,
    fluid,
    rigid,
    viscohyperelastic,
)

#: The registry: a new law is a file in `kernels.materials` and a name here.
LAWS: dict[str, ModuleType] = {
    law.NAME: law for law in (elastic, elastic_plastic, viscohyperelastic, brain_isv, fluid, crushable_foam, rigid)
}


@dataclass(frozen=True)
class Material:
    """A material of a model.

    Parameters
    ----------
    name
        For messages.
    law
        One of `LAWS`.
    density_kg_per_m3
        Mass density before deformation [kg/m^3].
    parameters
        Constants of the law by name, as its ``Parameters`` lists them.
    """

    name: str
    law: str
    density_kg_per_m3: float
    parameters: Mapping[str, float | Sequence[float]] = field(default_factory=dict)

    @property
    def is_rigid(self) -> bool:
        """Whether parts of this material move as bodies."""
        return self.law == rigid.NAME

    def wave_speed_m_per_s(self) -> float:
        """Speed of a plane pressure wave at small strain [m/s]: ``sqrt((K + 4 mu / 3) / rho)``."""
        bulk, shear = law_parameters(self).elastic_moduli()
        return math.sqrt((bulk + 4.0 * shear / 3.0) / self.density_kg_per_m3)


def law_parameters(material: Material) -> Any:
    """Check a material and return its law's parameters.

    Raises
    ------
    InputError
        For an unknown law, an unknown or missing parameter, or a value that makes no sense; the
        message says which names exist.
    """
    where = f"material {material.name!r}"
    if material.law not in LAWS:
        raise InputError(
            where, f"{material.law!r} is no material law", column="law",
            expected=", ".join(sorted(LAWS)), mend=_did_you_mean(material.law, LAWS),
        )  # fmt: skip
    if not (math.isfinite(material.density_kg_per_m3) and material.density_kg_per_m3 > 0):
        raise InputError(
            where, f"the density is {material.density_kg_per_m3!r}", column="density_kg_per_m3",
            expected="a positive number of kg/m^3",
        )  # fmt: skip
    kind = LAWS[material.law].Parameters
    fields = {f.name: f for f in dataclasses.fields(kind)}
    for name in material.parameters:
        if name not in fields:
            raise InputError(
                where, f"{name!r} is no parameter of the law {material.law!r}", column="parameters",
                expected=", ".join(fields), mend=_did_you_mean(name, fields),
            )  # fmt: skip
    missing = [
        name for name, f in fields.items()
        if name not in material.parameters and f.default is f.default_factory is dataclasses.MISSING
    ]  # fmt: skip
    if missing:
        raise InputError(
            where, f"{', '.join(missing)} is missing", column="parameters", expected=", ".join(fields),
            mend="give its value",
        )  # fmt: skip
    values = {name: _number(where, name, value) for name, value in material.parameters.items()}
    try:
        return kind(**values)
    except ValueError as error:
        raise InputError(where, str(error), column="parameters", mend="correct the value") from None


def law_fields(law: ModuleType) -> Mapping[str, str]:
    """Fields that a law shows beside the stress: name in outputs -> name in its ``STATE``."""
    return getattr(law, "FIELDS", {})


def _number(where: str, name: str, value: Any) -> float | tuple[float, ...]:
    try:
        if isinstance(value, str):
            raise TypeError
        number = float(value) if not hasattr(value, "__len__") else tuple(float(v) for v in value)
    except (TypeError, ValueError):
        number = math.nan
    if not all(math.isfinite(v) for v in (number if isinstance(number, tuple) else (number,))):
        raise InputError(where, f"{name} is {value!r}", column="parameters", expected="a finite number, or a list")
    return number


def _did_you_mean(word: str, known: Mapping[str, Any]) -> str:
    close = difflib.get_close_matches(word, known, 1, 0.5)
    return f"did you mean {close[0]!r}?" if close else "choose one of these"
