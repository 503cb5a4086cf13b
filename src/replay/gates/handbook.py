"""The table of limits in docs/gates.md, written from ``limits.yaml`` (a test holds the two together)."""

from __future__ import annotations

from replay.gates.limits import Limits

_UNIT = {"1": ""}


def limits_markdown(limits: Limits | None = None) -> str:
    """Return every limit as Markdown, one table a gate."""
    limits = limits or Limits.load()
    blocks = []
    for gate in limits.gates.values():
        stops = "stops the play when it fails" if gate.stops_run else "sets the verdict, does not stop the play"
        stops = "judges finished plays against each other" if gate.between_plays else stops
        lines = [f"### {gate.title} (`{gate.name}`)", "", f"From: {gate.source}. It {stops}.", ""]
        lines += ["| check | limit | unit | source |", "|---|---|---|---|"]
        for name, limit in limits.of(gate.name).items():
            kind = " (setting)" if limit.parameter is not None else ""
            cells = (
                f"`{name}`{kind}",
                limit.text().replace("|", "\\|"),
                _UNIT.get(limit.unit, limit.unit),
                limit.source,
            )
            lines.append(f"| {' | '.join(cells)} |")
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks) + "\n"


if __name__ == "__main__":
    print(limits_markdown(), end="")
