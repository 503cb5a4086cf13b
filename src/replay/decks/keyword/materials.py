"""From ``*MAT`` cards to our laws: what is mapped, what is lost on the way, and what is refused by name.

===========================================  ===================  ==================================================
keyword                                      law                  what is lost
===========================================  ===================  ==================================================
*MAT_ELASTIC (001)                           elastic              damping factors
*MAT_PLASTIC_KINEMATIC (003)                 elastic_plastic      kinematic hardening, rate effect, failure
*MAT_VISCOELASTIC (006)                      viscohyperelastic    rate form: large strain is neo-Hookean here
*MAT_RIGID (020)                             rigid                constraints of its centre
*MAT_PIECEWISE_LINEAR_PLASTICITY (024)       elastic_plastic      rate effect, failure
*MAT_LOW_DENSITY_FOAM (057)                  crushable_foam       decay of the hysteresis, viscous term
*MAT_CRUSHABLE_FOAM (063)                    crushable_foam       permanent set: the foam recovers here
*MAT_HYPERELASTIC_RUBBER (077_H)             viscohyperelastic    C01 joins C10
*MAT_OGDEN_RUBBER (077_O), exponents 2       viscohyperelastic    nothing at small strain
===========================================  ===================  ==================================================

*MAT_VISCOUS_FOAM (062) is refused: none of our laws has its rate term. So is every other law.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from replay.decks.keyword.deck import KeywordDeck
from replay.decks.keyword.entries import Entry
from replay.decks.keyword.units import Units
from replay.errors import InputError
from replay.solver import Material, law_parameters
from replay.solver.kernels.materials import crushable_foam
from replay.solver.materials import LAWS

_PLASTIC_KNOTS = 8
_MOST_PRONY = 2


@dataclass(frozen=True)
class Mapped:
    """A material of a deck as one of ours, or why it cannot be.

    Parameters
    ----------
    keyword, mid
        Card and number.
    law
        Our law; empty where it is refused.
    density_kg_per_m3
        Density; NaN where the card gives none.
    parameters
        Constants of the law.
    lost
        What the card says and the law does not, one clause each.
    refused
        Why it cannot be used; empty where it can.
    """

    keyword: str
    mid: int
    law: str
    density_kg_per_m3: float
    parameters: dict[str, Any] = field(default_factory=dict)
    lost: tuple[str, ...] = ()
    refused: str = ""


class _Refused(Exception):
    """A card that no law of ours can stand for."""


@dataclass
class _Card:
    """A card in SI, and what is lost of it."""

    entry: Entry
    deck: KeywordDeck
    units: Units
    lost: list[str] = field(default_factory=list)

    def number(self, name: str, default: float = 0.0) -> float:
        """Value of a field in SI; fields of a card are converted by their own kind."""
        return self.entry.number(name, default)

    def lose(self, name: str, what: str) -> None:
        """Note what is lost where a field is not zero."""
        if self.number(name):
            self.lost.append(f"{name} = {self.number(name):g}: {what}")

    def curve(self, name: str) -> np.ndarray:
        """Points of the curve that a field names: strain, and stress [Pa]."""
        number = self.entry.whole(name)
        points = self.deck.curve(number) if number else None
        if points is None:
            message = f"{name} = {number}: there is no such *DEFINE_CURVE"
            raise _Refused(message)
        return points * [1.0, self.units.factor("pressure")]


def map_material(entry: Entry, deck: KeywordDeck, units: Units) -> Mapped:
    """Map one ``*MAT`` card.

    Parameters
    ----------
    entry
        The card, in the deck's unit.
    deck
        For the curves it names.
    units
        The deck's.
    """
    density = entry.number("ro", math.nan) * units.factor("density")
    label = f"*{entry.keyword}"
    law = _LAWS.get(entry.keyword)
    if law is None:
        why = "none of our laws has its rate term" if entry.keyword == "MAT_VISCOUS_FOAM" else "no law of ours"
        return Mapped(label, entry.id, "", density, refused=f"{label} {entry.id}: {why} stands for it")
    card = _Card(units.to_si().entry(entry), deck, units)
    try:
        name, parameters = law(card)
        if name not in LAWS:
            message = f"the law {name} is not in this version"
            raise _Refused(message)
        law_parameters(Material(f"{label} {entry.id}", name, density, parameters))
    except _Refused as reason:
        return Mapped(label, entry.id, "", density, refused=f"{label} {entry.id}: {reason}")
    except InputError as error:
        return Mapped(label, entry.id, "", density, refused=f"{label} {entry.id}: {error.found}")
    return Mapped(label, entry.id, name, density, parameters, tuple(card.lost))


def _elastic(card: _Card) -> tuple[str, dict[str, Any]]:
    card.lose("da", "axial damping is not applied")
    card.lose("db", "bending damping is not applied")
    return "elastic", {"youngs_modulus_pa": card.number("e"), "poisson_ratio": card.number("pr")}


def _rigid(card: _Card) -> tuple[str, dict[str, Any]]:
    card.lose("cmo", "constraints of the rigid body's centre are not applied")
    return "rigid", {"youngs_modulus_pa": card.number("e"), "poisson_ratio": card.number("pr")}


def _plastic_kinematic(card: _Card) -> tuple[str, dict[str, Any]]:
    young, tangent = card.number("e"), card.number("etan")
    if not 0 <= tangent < young:
        message = f"etan = {tangent:g} Pa does not lie between 0 and e"
        raise _Refused(message)
    if card.number("beta") < 1:
        card.lost.append("hardening is isotropic here: the same until the load turns round")
    card.lose("src", "the yield stress does not grow with the rate")
    card.lose("fs", "elements do not fail")
    return "elastic_plastic", {
        "youngs_modulus_pa": young,
        "poisson_ratio": card.number("pr"),
        "yield_stress_pa": card.number("sigy"),
        "hardening_modulus_pa": young * tangent / (young - tangent),
    }


def _piecewise_plastic(card: _Card) -> tuple[str, dict[str, Any]]:
    card.lose("c", "the yield stress does not grow with the rate")
    card.lose("lcsr", "the yield stress does not grow with the rate")
    if 0 < card.number("fail") < 1e10:
        card.lose("fail", "elements do not fail")
    young, tangent = card.number("e"), card.number("etan")
    parameters: dict[str, Any] = {
        "youngs_modulus_pa": young,
        "poisson_ratio": card.number("pr"),
        "yield_stress_pa": card.number("sigy"),
        "hardening_modulus_pa": young * tangent / (young - tangent) if 0 <= tangent < young else 0.0,
    }
    points = None
    if card.entry.whole("lcss"):
        points = card.curve("lcss")
    elif card.number("eps2"):
        pairs = [(card.number(f"eps{k}"), card.number(f"es{k}")) for k in range(1, 9)]
        points = np.array([p for k, p in enumerate(pairs) if k == 0 or p[0] > pairs[k - 1][0]])
    if points is not None:
        if len(points) < 2 or points[0, 0] != 0 or (np.diff(points, axis=0) < 0).any():
            message = "its hardening curve does not start at strain 0, or falls"
            raise _Refused(message)
        points = _fewer_points(points, _PLASTIC_KNOTS, card)
        parameters |= {
            "yield_stress_pa": float(points[0, 1]),
            "hardening_modulus_pa": 0.0,
            "curve_strains": tuple(points[1:, 0].tolist()),
            "curve_stresses_pa": tuple(points[1:, 1].tolist()),
        }
    return "elastic_plastic", parameters


def _viscoelastic(card: _Card) -> tuple[str, dict[str, Any]]:
    short, long, rate = card.number("g0"), card.number("gi"), card.number("beta")
    parameters: dict[str, Any] = {"bulk_modulus_pa": card.number("bulk"), "shear_modulus_pa": short}
    if not 0 < long <= short:
        message = f"g0 = {short:g}, gi = {long:g} Pa: the long-term modulus must lie between 0 and the short-term one"
        raise _Refused(message)
    if long < short:
        if not rate > 0:
            message = "beta is not positive, but gi is below g0"
            raise _Refused(message)
        parameters |= {"prony_ratios": ((short - long) / short,), "prony_times_s": (1 / rate,)}
    return "viscohyperelastic", parameters


def _foam(card: _Card, unloading: float) -> tuple[str, dict[str, Any]]:
    points = card.curve("lcid")
    if not len(points) or points[0].any():
        points = np.vstack([[0.0, 0.0], points])
    points = points[points[:, 0] < 0.99]
    if len(points) < 2 or (np.diff(points[:, 0]) <= 0).any() or (np.diff(points[:, 1]) < 0).any():
        message = "its curve must rise from (0, 0), compression positive"
        raise _Refused(message)
    points = _fewer_points(points, crushable_foam.KNOTS, card)
    plateau = float(np.interp(0.2, points[:, 0], points[:, 1]))
    beyond = points[points[:, 1] >= 2 * plateau, 0]
    young = card.number("e") or float(points[1, 1] / points[1, 0])
    tension = card.number("tc") or card.number("tsc")
    parameters = {
        "youngs_modulus_pa": young,
        "plateau_stress_pa": plateau,
        "densification_strain": float(np.clip(beyond[0] if len(beyond) else 0.9, 0.06, 0.94)),
        "curve_strains": tuple(points[:, 0].tolist()),
        "curve_stresses_pa": tuple(points[:, 1].tolist()),
        "unloading_factor": unloading,
    }
    if 0 < tension < 1e15:
        parameters["tension_cutoff_pa"] = tension
    return "crushable_foam", parameters


def _low_density_foam(card: _Card) -> tuple[str, dict[str, Any]]:
    card.lose("beta", "the hysteresis does not decay with time")
    card.lose("ed", "the viscous term is not there")
    return _foam(card, min(max(card.number("hu", 1.0) or 1.0, 0.0), 1.0))


def _crushable_foam(card: _Card) -> tuple[str, dict[str, Any]]:
    card.lost.append("the foam recovers its shape: no permanent set")
    card.lose("damp", "its damping is not applied")
    if card.number("pr"):
        card.lose("pr", "lateral strain is 0 here")
    return _foam(card, 0.0)


def _rubber(card: _Card, shear: float) -> tuple[str, dict[str, Any]]:
    if card.entry.whole("n"):
        message = "n > 0: its constants are to be fitted to a test curve; give the constants"
        raise _Refused(message)
    nu = card.number("pr")
    if not 0 < nu < 0.5:
        message = f"pr = {nu:g} must lie between 0 and 0.5"
        raise _Refused(message)
    terms = [
        (float(row.values[0] or 0.0), float(row.values[1] or 0.0))
        for row in card.entry.rows
        if row.fields[0].name == "gi"
    ]
    terms = [(g, rate) for g, rate in terms if g]
    if len(terms) > _MOST_PRONY or any(not rate > 0 for _, rate in terms):
        message = f"{len(terms)} relaxation terms; at most {_MOST_PRONY} with positive rates can be used"
        raise _Refused(message)
    total = shear + sum(g for g, _ in terms)
    parameters: dict[str, Any] = {
        "bulk_modulus_pa": 2 * shear * (1 + nu) / (3 * (1 - 2 * nu)),
        "shear_modulus_pa": total,
    }
    if terms:
        parameters |= {
            "prony_ratios": tuple(g / total for g, _ in terms),
            "prony_times_s": tuple(1 / rate for _, rate in terms),
        }
    return "viscohyperelastic", parameters


def _mooney(card: _Card) -> tuple[str, dict[str, Any]]:
    for name in ("c11", "c20", "c02", "c30"):
        if card.number(name):
            message = f"{name} = {card.number(name):g}: only C10 and C01 can be used"
            raise _Refused(message)
    card.lose("c01", "it joins C10: the same at small strain")
    return _rubber(card, 2 * (card.number("c10") + card.number("c01")))


def _ogden(card: _Card) -> tuple[str, dict[str, Any]]:
    pairs = [(card.number(f"mu{k}"), card.number(f"alpha{k}")) for k in range(1, 9)]
    if any(mu and alpha != 2 for mu, alpha in pairs):
        message = "exponents other than 2 have no law here"
        raise _Refused(message)
    return _rubber(card, sum(mu for mu, _ in pairs))


_LAWS: dict[str, Callable[[_Card], tuple[str, dict[str, Any]]]] = {
    "MAT_ELASTIC": _elastic,
    "MAT_PLASTIC_KINEMATIC": _plastic_kinematic,
    "MAT_VISCOELASTIC": _viscoelastic,
    "MAT_RIGID": _rigid,
    "MAT_PIECEWISE_LINEAR_PLASTICITY": _piecewise_plastic,
    "MAT_LOW_DENSITY_FOAM": _low_density_foam,
    "MAT_CRUSHABLE_FOAM": _crushable_foam,
    "MAT_HYPERELASTIC_RUBBER": _mooney,
    "MAT_OGDEN_RUBBER": _ogden,
}


def _fewer_points(points: np.ndarray, most: int, card: _Card) -> np.ndarray:
    """The points that leave the smallest gap: from the ends on, the one that is furthest from the line so far."""
    chosen = [0, len(points) - 1]
    while len(chosen) < min(most, len(points)):
        chosen.sort()
        line = np.interp(points[:, 0], points[chosen, 0], points[chosen, 1])
        gap = np.abs(points[:, 1] - line)
        gap[chosen] = -1.0
        chosen.append(int(np.argmax(gap)))
    chosen.sort()
    if len(points) > most:
        line = np.interp(points[:, 0], points[chosen, 0], points[chosen, 1])
        worst = float(np.abs(points[:, 1] - line).max() / np.abs(points[:, 1]).max())
        card.lost.append(f"a curve of {len(points)} points keeps {most}: {worst:.1%} of its largest stress at most")
    return points[chosen]
