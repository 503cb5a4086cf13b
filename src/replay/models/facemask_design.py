"""The description of a facemask: rows of bars across the face, columns down it, and the mounts that hold them."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from replay.documents import Number, Setting, refuse
from replay.play import Positive

BROW = "brow"
"""End of a span that runs to the brow's edge."""


class Mount(Setting):
    """Where a bar is tied to the shell, left and right alike: the face of its edge nearest to this place."""

    edge: Literal["brow", "flap"] = Field(description="Edge of the shell.")
    at_deg: Number = Field(description="Azimuth along the brow, or elevation along the flap [degrees].")


class Row(Setting):
    """A bar across the face: at an elevation between the outermost columns, or through a mount from flap to flap."""

    elevation_deg: Number | None = Field(default=None, description="Elevation [degrees].")
    mount: str | None = Field(default=None, description="Mount at the flap.")

    @model_validator(mode="after")
    def _is_somewhere(self) -> Row:
        if (self.elevation_deg is None) == (self.mount is None):
            refuse("the bar is nowhere, or at two places", "`elevation_deg` or `mount`", "give one of the two")
        return self


class Column(Setting):
    """A bar down the face and its image at the other side; at azimuth 0 a single one."""

    azimuth_deg: Annotated[Number, Field(ge=0, lt=90)] | None = Field(default=None, description="Azimuth [degrees].")
    mount: str | None = Field(default=None, description="Mount at the brow.")
    spans: tuple[tuple[str, str], ...] = Field(description="From one row up to another, or to `brow`.", min_length=1)

    @model_validator(mode="after")
    def _is_somewhere(self) -> Column:
        if (self.azimuth_deg is None) == (self.mount is None):
            refuse("the bar is nowhere, or at two places", "`azimuth_deg` or `mount`", "give one of the two")
        return self


class Facemask(Setting):
    """A facemask of square bars."""

    title: str = Field(description="What it is.", min_length=1)
    source: str = Field(description="Where its numbers come from.", min_length=1)
    certainty: dict[str, Literal["measured", "calibrated", "assumed", "article"]]
    mass_kg: Positive = Field(description="Mass on the `nfl` head [kg].")
    material: Literal["titanium"] = Field(description="Material of the bars.")
    pid: Annotated[int, Field(gt=0, lt=10_000_000)] = 2
    bar_m: Annotated[Number, Field(gt=0.002, lt=0.02)] = Field(description="Side of a bar's section [m].")
    mount_deg: Positive = Field(description="Length of a mount between the shell's edge and a bar [degrees].")
    smoothing_deg: Positive = Field(description="Smoothing of the scalp before which the bars lie [degrees].")
    standoff_m: Annotated[Number, Field(ge=0)] = Field(description="Of the middle beyond the shell's surface [m].")
    mounts: dict[str, Mount] = Field(description="Mounts of the left side; the right side is their image.")
    rows: dict[str, Row] = Field(description="Bars across, from the lowest up.", min_length=2)
    columns: tuple[Column, ...] = Field(description="Bars down.", min_length=1)

    @model_validator(mode="after")
    def _hangs_together(self) -> Facemask:
        names = list(self.rows)
        for edge, users in (
            ("flap", [row.mount for row in self.rows.values()]),
            ("brow", [column.mount for column in self.columns]),
        ):
            own = sorted(self.mounts_at(edge))
            if sorted(user for user in users if user) != own:
                kind = "row" if edge == "flap" else "column"
                refuse(
                    f"mounts at the {edge}: {', '.join(own) or 'none'}", f"one {kind} at each", f"name it in a {kind}"
                )
        if len(self.mounts_at("flap")) < 2 or not self.mounts_at("brow"):
            refuse("too few mounts", "two at the flap and one at the brow, of a side", "add a mount")
        heights = [row.elevation_deg for row in self.rows.values() if row.elevation_deg is not None]
        mounted = [self.mounts[row.mount].at_deg for row in self.rows.values() if row.mount]
        if any(b <= a for line in (heights, mounted) for a, b in pairwise(line)):
            refuse("rows are out of order", "rows from the lowest up", "sort them by elevation")
        if any(row.mount is None for row in list(self.rows.values())[-len(mounted) :]):
            refuse("a row without a mount lies above one with", "rows at mounts above all others", "move it down")
        held = {name for name, row in self.rows.items() if row.mount} | {BROW}
        links = [self.crossed(span) for column in self.columns for span in column.spans]
        for _ in names:
            held |= {name for link in links if held & set(link) for name in link}
        loose = [name for name in names if name not in held]
        if loose:
            refuse(f"row {loose[0]} hangs on nothing", "a column from it to a mounted row", "add a span")
        for column in self.columns:
            if column.mount and not any(span[1] == BROW for span in column.spans):
                refuse(f"mount {column.mount} holds nothing", "a span that ends in `brow`", "add one to its column")
        return self

    def mounts_at(self, edge: str) -> list[str]:
        """Names of the mounts at an edge."""
        return [name for name, mount in self.mounts.items() if mount.edge == edge]

    def crossed(self, span: tuple[str, str]) -> list[str]:
        """Rows that a span crosses, its ends included, and `BROW` where it runs that far."""
        line = [*self.rows, BROW]
        if span[0] not in line or span[1] not in line or line.index(span[0]) >= line.index(span[1]):
            refuse(f"no span from {span[0]!r} up to {span[1]!r}", f"two of {', '.join(line)}", "correct the names")
        return line[line.index(span[0]) : line.index(span[1]) + 1]
