"""What stands where on the cards that we understand: one line of text a keyword.

A form lists cards between bars, fields between blanks. ``name:kind`` says what a number is: what it refers to
(``part``, ``material``, ``curve``...), or its dimension (``pressure``, ``density``...); renumbering and conversion of
units follow from that alone. ``name@16`` sets the columns (10 otherwise). ``$name`` is a card of text. A card or a
group in parentheses with ``*`` repeats to the end of the block.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

DIMENSIONS = ("length", "time", "mass", "density", "pressure", "rate", "velocity", "viscosity")
"""Kinds that are dimensions; any other kind is that of the thing that a number defines (``=``) or refers to."""


@dataclass(frozen=True)
class Field:
    """A field: its name, its kind (empty: a plain number), whether it defines a number, its columns."""

    name: str
    kind: str = ""
    defines: bool = False
    width: int = 10


@dataclass(frozen=True)
class Form:
    """Cards of a keyword; from `repeat` on they come again and again (-1: never)."""

    cards: tuple[tuple[Field, ...], ...]
    repeat: int = -1

    def card(self, index: int) -> tuple[Field, ...] | None:
        """Fields of the card at a place of the block, None beyond the form."""
        if index < len(self.cards):
            return self.cards[index]
        if self.repeat < 0:
            return None
        return self.cards[self.repeat + (index - self.repeat) % (len(self.cards) - self.repeat)]


_SET = "da1 da2 da3 da4 $solver its"
_PART = "$title | pid:=part secid:section mid:material eosid:eos hgid:hourglass grav adpopt tmid"
_BODY = "mid:=material ro:density"
_FORMS = {
    "PART": f"({_PART})*",
    "PART_CONTACT": f"({_PART} | fs fd dc vc:pressure optt sft ssf cparm8)*",
    "PART_INERTIA": f"({_PART} | xc:length yc:length zc:length tm:mass ircs nodeid | ixx ixy ixz iyy iyz izz "
    "| vtx:velocity vty:velocity vtz:velocity vrx:rate vry:rate vrz:rate)*",
    "SECTION_SOLID": "(secid:=section elform aet)*",
    "SECTION_SHELL": "secid:=section elform shrf nip printout qr icomp shellset "
    "| t1:length t2:length t3:length t4:length nloc marea idof edgset",
    "HOURGLASS": "(hgid:=hourglass ihq qm ibq q1 q2 qb qw)*",
    "MAT_ELASTIC": f"{_BODY} e:pressure pr da db k",
    "MAT_PLASTIC_KINEMATIC": f"{_BODY} e:pressure pr sigy:pressure etan:pressure beta | src:rate srp fs vp",
    "MAT_VISCOELASTIC": f"{_BODY} bulk:pressure g0:pressure gi:pressure beta:rate",
    "MAT_RIGID": f"{_BODY} e:pressure pr n couple m alias | cmo con1 con2 | a1 a2 a3 v1 v2 v3",
    "MAT_PIECEWISE_LINEAR_PLASTICITY": f"{_BODY} e:pressure pr sigy:pressure etan:pressure fail tdel:time "
    "| c:rate p lcss:curve lcsr:curve vp | eps1 eps2 eps3 eps4 eps5 eps6 eps7 eps8 "
    "| es1:pressure es2:pressure es3:pressure es4:pressure es5:pressure es6:pressure es7:pressure es8:pressure",
    "MAT_LOW_DENSITY_FOAM": f"{_BODY} e:pressure lcid:curve tc:pressure hu beta:rate damp "
    "| shape fail bvflag ed:pressure beta1:rate kcon:pressure ref",
    "MAT_VISCOUS_FOAM": f"{_BODY} e1:pressure n1 v2:viscosity e2:pressure n2 pr",
    "MAT_CRUSHABLE_FOAM": f"{_BODY} e:pressure pr lcid:curve tsc:pressure damp model",
    "MAT_HYPERELASTIC_RUBBER": f"{_BODY} pr n nv g:pressure sigf:pressure ref "
    "| c10:pressure c01:pressure c11:pressure c20:pressure c02:pressure c30:pressure therml "
    "| (gi:pressure betai:rate)*",
    "MAT_OGDEN_RUBBER": f"{_BODY} pr n nv g:pressure sigf:pressure ref "
    "| mu1:pressure mu2:pressure mu3:pressure mu4:pressure mu5:pressure mu6:pressure mu7:pressure mu8:pressure "
    "| alpha1 alpha2 alpha3 alpha4 alpha5 alpha6 alpha7 alpha8 | (gi:pressure betai:rate)*",
    "SET_NODE_LIST": f"sid:=node_set {_SET} | (n1:node n2:node n3:node n4:node n5:node n6:node n7:node n8:node)*",
    "SET_PART_LIST": f"sid:=part_set {_SET} | (p1:part p2:part p3:part p4:part p5:part p6:part p7:part p8:part)*",
    "SET_SOLID": "sid:=solid_set $solver | (k1:element k2:element k3:element k4:element k5:element k6:element "
    "k7:element k8:element)*",
    "SET_SHELL_LIST": f"sid:=shell_set {_SET} | (e1:element e2:element e3:element e4:element e5:element e6:element "
    "e7:element e8:element)*",
    "SET_SEGMENT": f"sid:=segment_set {_SET} | (n1:node n2:node n3:node n4:node a1 a2 a3 a4)*",
    "DEFINE_CURVE": "lcid:=curve sidr sfa sfo offa offo dattyp lcint | (a1@20 o1@20)*",
    "DEFINE_TRANSFORMATION": "tranid:=transform | ($option a1 a2 a3 a4 a5 a6 a7)*",
    "CONTACT": "ssid msid sstyp mstyp sboxid mboxid spr mpr | fs fd dc vc:pressure vdc penchk bt:time dt:time "
    "| sfs sfm sst:length mst:length sfst sfmt fsf vsf",
    "INITIAL_VELOCITY_GENERATION": "(id styp omega:rate vx:velocity vy:velocity vz:velocity ivatn icid:system "
    "| xc:length yc:length zc:length nx ny nz phase irigid)*",
    "BOUNDARY_PRESCRIBED_MOTION_RIGID": "(pid:part dof vad lcid:curve sf vid death:time birth:time)*",
    "BOUNDARY_PRESCRIBED_MOTION_SET": "(nsid:node_set dof vad lcid:curve sf vid death:time birth:time)*",
    "BOUNDARY_SPC_SET": "(nsid:node_set cid:system dofx dofy dofz dofrx dofry dofrz)*",
    "BOUNDARY_SPC_NODE": "(nid:node cid:system dofx dofy dofz dofrx dofry dofrz)*",
    "CONSTRAINED_RIGID_BODIES": "(pidm:part pids:part iflag)*",
    "CONTROL_TERMINATION": "endtim:time endcyc dtmin endeng endmas nosol",
    "CONTROL_TIMESTEP": "dtinit:time tssfac isdo tslimt:time dt2ms:time lctm:curve erode ms1st "
    "| dt2msf dt2mslc imscl unused1 unused2 rmscl emscl ihdo",
    "CONTROL_HOURGLASS": "ihq qh",
    "CONTROL_BULK_VISCOSITY": "q1 q2 type btype tstype",
    "CONTROL_ENERGY": "hgen rwen slnten rylen irgen maten drlen disen",
}
_NUMBERS = {
    "001": "ELASTIC", "003": "PLASTIC_KINEMATIC", "006": "VISCOELASTIC", "020": "RIGID",
    "024": "PIECEWISE_LINEAR_PLASTICITY", "057": "LOW_DENSITY_FOAM", "062": "VISCOUS_FOAM", "063": "CRUSHABLE_FOAM",
    "077_H": "HYPERELASTIC_RUBBER", "077_O": "OGDEN_RUBBER",
}  # fmt: skip
_ALIASES = {
    **{f"MAT_{number}": f"MAT_{name}" for number, name in _NUMBERS.items()},
    **{f"MAT_{int(number)}": f"MAT_{name}" for number, name in _NUMBERS.items() if number.isdigit()},
    "SET_NODE": "SET_NODE_LIST",
    "SET_PART": "SET_PART_LIST",
    "SET_SOLID_LIST": "SET_SOLID",
    "SET_SHELL": "SET_SHELL_LIST",
}
#: Any other *MAT, *SECTION or *DATABASE: only what all of them have in common.
_FAMILIES = {"MAT_": f"{_BODY}", "SECTION_": "secid:=section", "DATABASE_": "dt:time"}
_DATABASE_PLAIN = re.compile(r"DATABASE_(GLSTAT|MATSUM|RBDOUT|RCFORC|SLEOUT|NODOUT|ELOUT|JNTFORC|BINARY_D3PLOT)")


def canonical(keyword: str) -> str:
    """One name for keywords that mean the same: ``MAT_024`` is ``MAT_PIECEWISE_LINEAR_PLASTICITY``."""
    return _ALIASES.get(keyword, keyword)


@cache
def form_of(keyword: str) -> Form | None:
    """Form of a canonical keyword, or None for one that is kept as it stands."""
    text = _FORMS.get(keyword)
    if text is None and keyword.startswith("CONTACT_"):
        text = _FORMS["CONTACT"]
    if (
        text is None
        and not keyword.startswith("MAT_ADD")
        and (keyword.startswith(("MAT_", "SECTION_")) or _DATABASE_PLAIN.fullmatch(keyword))
    ):
        text = next(form for family, form in _FAMILIES.items() if keyword.startswith(family))
    return None if text is None else _parse(text)


def is_complete(keyword: str) -> bool:
    """Whether every card of the keyword is in its form."""
    return keyword in _FORMS or _DATABASE_PLAIN.fullmatch(keyword) is not None


def _parse(text: str) -> Form:
    repeat = -1
    if "(" in text:
        repeat = text[: text.index("(")].count("|")
        text = text.replace("(", "").replace(")*", "")
    return Form(tuple(tuple(_field(word) for word in card.split()) for card in text.split("|")), repeat)


def _field(word: str) -> Field:
    word, _, width = word.partition("@")
    name, _, kind = word.partition(":")
    if name.startswith("$"):
        return Field(name[1:], "text", width=80 if name == "$title" else 10)
    return Field(name, kind.lstrip("="), kind.startswith("="), int(width or 10))
