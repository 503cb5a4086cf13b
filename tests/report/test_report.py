"""The report: complete, self-contained, honest about what is missing, and the same bytes twice."""

from __future__ import annotations

import dataclasses
import re
from html.parser import HTMLParser
from pathlib import Path

import finished_play as example
import matplotlib as mpl
import pytest

from replay.report import write_report

VOID = {"meta", "img", "br", "link", "hr", "input"}


class Page(HTMLParser):
    """Reads a page and keeps what the tests ask about."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.misnested: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.misnested.append(tag)

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    return write_report(tmp_path_factory.mktemp("report"), example.finished_play())


@pytest.fixture(scope="module")
def page(written) -> Page:
    return Page(written.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def rejected(tmp_path_factory) -> Page:
    path = write_report(tmp_path_factory.mktemp("rejected"), example.rejected_play())
    return Page(path.read_text(encoding="utf-8"))


def test_page_is_self_contained(written, page):
    html = written.read_text(encoding="utf-8")
    assert "default-src 'none'" in html
    assert not [tag for tag, _ in page.tags if tag in ("script", "link", "iframe", "object")]
    for _, attributes in page.tags:
        assert (attributes.get("src") or "data:image/").startswith("data:image/")
        assert (attributes.get("href") or "#").startswith("#")
    outside_images = re.sub(r'src="data:[^"]*"', "", html)
    assert "http" not in outside_images.replace("http-equiv", "")
    assert "url(" not in outside_images


def test_page_is_small_enough_to_mail(written):
    assert written.stat().st_size < 15e6


@pytest.mark.parametrize("which", ["page", "rejected"])
def test_every_tag_is_closed_in_turn(which, request):
    read = request.getfixturevalue(which)
    assert read.misnested == []
    assert read.open == []


def test_page_can_be_read_without_seeing_it(page):
    images = [attributes for tag, attributes in page.tags if tag == "img"]
    assert len(images) >= 14
    assert all(len(image["alt"]) > 20 for image in images)
    assert all("scope" in attributes for tag, attributes in page.tags if tag == "th")
    assert sum(tag == "caption" for tag, _ in page.tags) == sum(tag == "table" for tag, _ in page.tags)
    assert dict(page.tags[0][1])["lang"] == "en"


def test_links_of_the_page_lead_somewhere(page):
    targets = {attributes.get("id") for _, attributes in page.tags}
    links = [attributes["href"][1:] for tag, attributes in page.tags if tag == "a"]
    assert links
    assert set(links) <= targets


def test_verdict_stands_first_with_its_causes_and_loosened_limits(page):
    text = page.text
    verdict = text.index("Accepted with warnings")
    assert verdict < text.index("The play")
    assert "hourglass share: energy pad 0.061, limit ≤ 0.05" in text
    assert "Loosened by the play: Reconstruction quality, focal drift median ≤ 4 % instead of ≤ 3 %" in text
    assert "loosened from ≤ 3" in text


def test_every_gate_and_check_is_on_the_page_with_its_source(page):
    for facts in example.GATE_FACTS.values():
        assert facts["title"] in page.text
    for gate in example.gates():
        for check in gate["checks"]:
            assert check["source"] in page.text
    assert page.text.count("no power") >= 2


def test_the_articles_four_tables_are_filled(page):
    for start in ("Table 1.", "Table 2.", "Table 3.", "Table 4."):
        assert start in page.text
    assert "640 at 12" in page.text
    assert "638.7 at 12.1" in page.text
    assert "[0.2, 8.323, 0]" in page.text
    assert "5.806" in page.text


def test_both_modes_stand_side_by_side_and_what_is_not_resolved_says_so(written):
    html = written.read_text(encoding="utf-8")
    for words in (
        "Peaks in both modes",
        "30.5 (28.4 to 32.5)",
        "not resolvable from this footage",
        "98.4 (97.1 to 130), 2 instants compete",
        "91.2 (89.7 to 93.1)",
    ):
        assert words in html
    assert "Angular velocity: protocol mode up to 29 rad/s" in html


def test_strain_never_stands_without_its_convergence_class(page):
    assert "Convergence class A" in page.text
    assert "published convergence studies need 202 800" in page.text


def test_page_says_what_it_cannot_show(page):
    assert "None is a risk, a threshold or a verdict on a person" in page.text
    assert "Pads share nodes with scalp and shell" in page.text
    assert "Not checked, because no contact in this model: initial penetration (Assembly)" in page.text


def test_play_that_was_stopped_says_what_was_not_run(rejected):
    assert "The gate “Reconstruction quality” ended the play; later stages were not run." in rejected.text
    assert "reprojection rmse median 11.2 px, limit ≤ 8" in rejected.text
    assert "The replay was not run: the gate “Reconstruction quality” ended the play." in rejected.text
    assert "The solver was not run" in rejected.text
    assert "Table 4 is empty: no replay was run." in rejected.text
    assert "Table 1 is empty: no model was assembled." in rejected.text


def test_same_play_gives_the_same_bytes_whatever_the_users_plot_settings(written, tmp_path):
    with mpl.rc_context({"font.size": 20, "lines.linewidth": 9, "svg.hashsalt": None}):
        again = write_report(tmp_path, example.finished_play())
    assert again.read_bytes() == written.read_bytes()
    figures = sorted((written.parent / "figures").iterdir())
    assert [f.name for f in figures] == sorted(f.name for f in (tmp_path / "figures").iterdir())
    for figure in figures:
        assert (tmp_path / "figures" / figure.name).read_bytes() == figure.read_bytes()


def test_figures_tell_no_clock_and_no_version(written):
    for figure in (written.parent / "figures").iterdir():
        data = figure.read_bytes()
        assert b"Matplotlib" not in data
        assert not re.search(rb"20\d\d-\d\d-\d\dT", data)


def test_a_title_cannot_write_html(tmp_path):
    bad = example.rejected_play()
    play = {**bad.play, "title": '<script>alert("x")</script>', "note": "a < b & c"}
    html = write_report(tmp_path, dataclasses.replace(bad, play=play)).read_text(encoding="utf-8")
    assert "<script" not in html
    assert "&lt;script&gt;" in html
    assert "a &lt; b &amp; c" in html


def test_wearable_play_says_that_table_2_does_not_apply(tmp_path):
    play = dataclasses.replace(example.rejected_play(), quality=())
    html = write_report(tmp_path, play).read_text(encoding="utf-8")
    assert "Table 2 does not apply" in html


def test_accepted_play_has_no_list_of_causes(tmp_path):
    verdict = {**example.verdict("accepted"), "causes": [], "loosened": []}
    play = dataclasses.replace(example.rejected_play(), verdict=verdict, gates=example.gates()[:1])
    text = Page(write_report(tmp_path, play).read_text(encoding="utf-8")).text
    assert "Accepted Every gate of the protocol passes. The play" in text
