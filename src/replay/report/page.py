"""The page of one play: verdict first, then the evidence, then what it cannot show.

One HTML file with everything inside: no script, no link to anywhere, no request to any
network (a content policy in the page forbids them).
"""

from __future__ import annotations

from pathlib import Path

from replay.files import atomic_path, write_text
from replay.report import sections
from replay.report.collision import collision_figures, pads_table
from replay.report.damage import damage_section
from replay.report.figure import Picture
from replay.report.markup import section, text
from replay.report.model import ReportInput
from replay.report.published import published_section
from replay.report.verdict_view import banner, gates_section


def write_report(folder: str | Path, report: ReportInput) -> Path:
    """Write ``report.html`` and its figures.

    Parameters
    ----------
    folder
        Receives ``report.html`` and ``figures/``; the page does not need the latter.
    report
        What the stages of the play have left; what is None is said to be missing.

    Returns
    -------
    Path
        The page. The same input gives the same bytes.
    """
    folder = Path(folder)
    pictures: list[Picture] = []
    html = _page(report, pictures)
    for picture in pictures:
        with atomic_path(folder / "figures" / f"{picture.name}.{picture.ending}") as temporary:
            temporary.write_bytes(picture.data)
    write_text(folder / "report.html", html)
    return folder / "report.html"


def _fidelity(report: ReportInput, pictures: list[Picture]) -> list[tuple[str, str, str]]:
    """Return the section that only a recorded motion has."""
    return [("driver", "Driver fidelity", sections.driver_section(report, pictures))] if report.recorded else []


def _collision(report: ReportInput, pictures: list[Picture]) -> list[tuple[str, str, str]]:
    """Return the section that only two players have."""
    if report.scene is None:
        return []
    published = "" if report.published is None else published_section(report.published)
    content = collision_figures(report, pictures) + published + pads_table(report)
    return [("collision", "The collision", content)]


def _page(report: ReportInput, pictures: list[Picture]) -> str:
    parts = [
        ("play", "The play", sections.play_section(report)),
        ("gates", "Gates", gates_section(report)),
        *_fidelity(report, pictures),
        *_collision(report, pictures),
        ("motion", "Head motion", sections.motion_section(report, pictures)),
        ("numerics", "Solver", sections.numerics_section(report, pictures)),
        ("brain", "Brain", sections.brain_section(report, pictures)),
        ("damage", "Damage variable", damage_section(report, pictures)),
        ("action", "Mechanical action", sections.action_section(report, pictures)),
        ("model", "Model", sections.model_section(report, pictures)),
        ("limits", "What this run cannot show", sections.cannot_show_section(report)),
        ("provenance", "Provenance", sections.provenance_section(report)),
    ]
    title = f"{report.play['name']}: {report.verdict['status']}"
    links = "".join(f'<li><a href="#{name}">{text(words)}</a></li>' for name, words, _ in parts)
    css = Path(__file__).with_name("page.css").read_text(encoding="utf-8")
    body = "".join(section(name, words, content) for name, words, content in parts)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; img-src data:; '
        "style-src 'unsafe-inline'\">\n"
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{text(title)}</title>\n<style>\n{css}</style></head>\n<body>"
        f'<header><div class="inner"><p class="kicker">Finite-element replay of one play</p>'
        f"<h1>{text(report.play.get('title') or report.play['name'])}</h1>{banner(report)}</div></header>\n"
        f'<nav aria-label="Sections"><ul>{links}</ul></nav>\n<main>{body}</main>\n'
        "<footer><p>Process diagnostics of a computed replay. No medical statement, no helmet rating.</p></footer>"
        "</body></html>\n"
    )
