"""Whatever program tracked the landmarks, the same tracks come in; what cannot be trusted is refused by line."""

from __future__ import annotations

import json
import types

import numpy as np
import pytest
from tests.motion.formats import FIRST, FORMATS, FPS, NAMES, SIZE, deeplabcut, kinovea_csv, kinovea_txt, pixels, sleap

from replay.errors import InputError, InputErrors
from replay.motion import check_tracks
from replay.motion.clip import load_clip
from replay.motion.readers import READERS, Context, read_tracks
from replay.motion.readers.kinovea_xml import blocks
from replay.motion.tracks import Template
from replay.play import ClicksSource, load_play

TEMPLATE = Template(NAMES, np.array([[0.18, 0.0, -0.04], [0.13, 0.09, -0.05], [0.13, -0.09, -0.05], [0.14, 0.0, 0.08]]))
CONTEXT = Context(FPS, SIZE)


def read(tmp_path, text, context=CONTEXT, **options):
    path = tmp_path / "tracks.txt"
    path.write_text(text, encoding="utf-8")
    return read_tracks(path, TEMPLATE, context, **options)


def refused(tmp_path, text, context=CONTEXT, **options):
    with pytest.raises((InputError, InputErrors)) as caught:
        read(tmp_path, text, context, **options)
    assert caught.value.exit_code == 2
    return str(caught.value)


@pytest.mark.parametrize("name", FORMATS)
def test_every_program_gives_the_same_tracks(tmp_path, name):
    reading = read(tmp_path, FORMATS[name](pixels()))
    assert reading.format == name.split(",")[0].split(" ")[-1 if "clicks" in name else 0]
    assert reading.tracks.frames.tolist() == list(range(FIRST, FIRST + 7))
    half = 0.5 if name == "kva 0.8" else 1e-9
    assert reading.tracks.pixels == pytest.approx(pixels(), abs=half)
    named = read(tmp_path, FORMATS[name](pixels()), format=reading.format)
    assert (named.tracks.pixels == reading.tracks.pixels).all()


def test_every_reader_is_tried_by_the_formats_above():
    assert {name.split(",")[0].split(" ")[-1 if "clicks" in name else 0] for name in FORMATS} == set(READERS)


def test_windows_line_ends_are_read_by_all(tmp_path):
    for name, write in FORMATS.items():
        text = write(pixels())
        (tmp_path / "tracks").write_bytes(text.replace("\n", "\r\n").encode("utf-8"))
        crlf = read_tracks(tmp_path / "tracks", TEMPLATE, CONTEXT).tracks.pixels
        assert (crlf == read(tmp_path, text).tracks.pixels).all(), name


def test_likelihoods_become_weights_and_small_ones_no_click(tmp_path):
    for text, weight in ((deeplabcut(pixels()), 0.9), (sleap(pixels()), 0.8)):
        assert read(tmp_path, text).tracks.weight[1:] == pytest.approx(weight)
    doubtful = deeplabcut(pixels()).replace("657.00,260.25,0.9", "657.00,260.25,0.3")
    at = np.argwhere(pixels() == (657.0, 260.25))
    text = deeplabcut(pixels())
    u, v = pixels()[3, 2]
    doubtful = text.replace(f"{u:.2f},{v:.2f},0.9", f"{u:.2f},{v:.2f},0.3")
    assert doubtful != text
    assert at.size == 0
    seen = read(tmp_path, doubtful).tracks.seen
    assert not seen[3, 2]
    assert seen.sum() == seen.size - 1
    assert read(tmp_path, doubtful, Context(FPS, SIZE, least_likelihood=0.2)).tracks.weight[3, 2] == pytest.approx(0.3)


def test_the_weights_of_a_click_table_are_kept(tmp_path):
    text = FORMATS["weighted clicks"](pixels())
    assert (read(tmp_path, text).tracks.weight == 0.5).all()
    assert "weight is 1.5" in refused(tmp_path, text.replace(",0.5\n", ",1.5\n", 1))


@pytest.mark.parametrize("write", [lambda p, n: deeplabcut(p, n), lambda p, n: sleap(p, n)])
def test_one_of_several_individuals_is_named(tmp_path, write):
    text = write(pixels(), ("home 12", "away 54"))
    assert "individual: home 12" in refused(tmp_path, text)
    assert "no individual 'ref'" in refused(tmp_path, text, Context(FPS, SIZE, individual="ref"))
    reading = read(tmp_path, text, Context(FPS, SIZE, individual="away 54"))
    assert reading.tracks.pixels == pytest.approx(pixels())


def test_tracks_are_renamed_ignored_and_kept_for_the_background(tmp_path):
    text = kinovea_txt(pixels()).replace("# LM1", "# mask centre")
    assert "'mask centre' is not in the template" in refused(tmp_path, text)
    named = Context(FPS, SIZE, names={"mask centre": "LM1"})
    assert read(tmp_path, text, named).tracks.pixels == pytest.approx(pixels())
    text = kinovea_txt(pixels()).replace("# LM4", "# goal post")
    assert read(tmp_path, text, Context(FPS, SIZE, ignore=("goal post",))).tracks.seen.sum(axis=1).tolist() == [3] * 7
    reading = read(tmp_path, text, static_points=("goal post",))
    assert reading.static_px[:, 0] == pytest.approx(pixels()[:, 3])
    assert not reading.tracks.seen[:, 3].any()


def test_tracks_of_unequal_length_and_of_one_name_are_joined_where_they_do_not_overlap(tmp_path):
    rows = kinovea_txt(pixels()).split("\n")
    at = rows.index("# LM2")
    # LM2 was lost in its fourth frame and tracked again from the fifth
    text = "\n".join([*rows[: at + 4], "# LM2", *rows[at + 5 :]])
    seen = read(tmp_path, text).tracks.seen
    assert seen[:, 1].tolist() == [True, True, True, False, True, True, True]
    twice = "\n".join([*rows[: at + 4], "# LM2", *rows[at + 3 :]])
    assert f"LM2 is clicked twice in frame {FIRST + 2} (first in line {at + 4})" in refused(tmp_path, twice)


def test_the_origin_of_an_export_can_be_elsewhere(tmp_path):
    moved = read(tmp_path, kinovea_csv(pixels()), Context(FPS, SIZE, origin_px=(700.0, 500.0))).tracks.pixels
    assert moved - pixels() == pytest.approx(np.broadcast_to([60.0, 140.0], moved.shape))


@pytest.mark.parametrize(
    ("name", "old", "new", "expected"),
    [
        ("kva", "1280;720", "1920;1080", ["ImageSize: the image is 1920 x 1080 px", "image_size"]),
        ("kva", ">512<", ">0<", ["a frame lasts 0 time stamps"]),
        ("kva", "</Track>", "", ["not well-formed XML", "tracks.txt:"]),
        ("kva", "600.0;300.0", "600.0|300.0", ["is no x;y;t", "tracks.txt:15"]),
        ("kva", "600.0;300.0", "600.0;1e400", ["'1e400' is not a number", "tracks.txt:15"]),
        ("kva", "<Kinovea", '<!DOCTYPE k [<!ENTITY a "b">]><Kinovea', ["document type"]),
        ("kinovea_xml", "x,y:px", "x,y:cm", ["is in cm", "remove the calibration"]),
        ("kinovea_txt", "-40.00 60.00", "-40.00", ["is no row of a track", "tracks.txt:5"]),
        ("kinovea_txt", "-40.00 60.00", "-40.00 6.000,00", ["'6.000,00' is not a number", "tracks.txt:5"]),
        ("kinovea_txt", "# LM1", "", ["a row comes before the name"]),
        ("kinovea_csv", '"LM1 X","LM1 Y"', '"LM1 X","LM2 Y"', ["are no X and Y of one track"]),
        ("kinovea_csv", '"LM1 X"', '"LM1 Horizontal velocity"', ["filtered", "export the trajectories"]),
        ("kinovea_csv", '"LM1 X","LM1 Y"', '"LM1","LM1 again"', ["filtered"]),
        ("kinovea_csv", "0.250", "0.254", ["tracks.txt:2", "between two frames"]),
        ("deeplabcut", "coords", "cords", ["the headings are not"]),
        ("deeplabcut", "0.99", "7.5", ["the likelihood is 7.5", "tracks.txt:4"]),
        ("deeplabcut", f"\n{FIRST},", "\nimg030.png,", ["'img030.png' is not a number"]),
        ("sleap", "LM1.y", "LM1.w", ["node 'LM1' has no .y"]),
        ("sleap", f",{FIRST},", f",{FIRST}.5,", ["is no frame", "tracks.txt:2"]),
        ("clicks", f"{FIRST},LM1", "-99999999999999,LM1", ["the frames run from -99999999999999"]),
    ],
)
def test_what_cannot_be_trusted_is_refused_by_line(tmp_path, name, old, new, expected):
    text = FORMATS[name](pixels())
    assert old in text
    said = refused(tmp_path, text.replace(old, new, 1))
    for part in expected:
        assert part in said


def test_an_export_at_another_frame_rate_is_refused_rather_than_guessed(tmp_path):
    said = refused(tmp_path, kinovea_csv(pixels()), Context(59.94, SIZE))
    assert "no frame at 59.94 frames per second in s, ms, us or frames" in said


def test_time_codes_are_read_where_a_hundredth_tells_frames_apart(tmp_path):
    def coded(fps):
        rows = []
        for row in kinovea_txt(pixels()).split("\n"):
            time, _, rest = row.partition(" ")
            if time[:1].isdigit():
                # cut off, not rounded, as 0.8 did
                hundredths = int(round(float(time) * FPS) / fps * 100.0 + 1e-6)
                row = f"0:00:{hundredths // 100:02d}:{hundredths % 100:02d} {rest}"
            rows.append(row)
        return "\n".join(rows)

    for fps in (24.0, 25.0, 29.97, 50.0):
        reading = read(tmp_path, coded(fps), Context(fps, SIZE))
        assert reading.tracks.frames.tolist() == list(range(FIRST, FIRST + 7)), fps
    assert "times are given to 0.01, frames are 0.0167 apart" in refused(tmp_path, coded(59.94), Context(59.94, SIZE))


def test_tracks_that_each_start_at_their_own_zero_are_refused(tmp_path):
    text = kinovea_txt(pixels() - pixels()[:1] + np.array([640.0, 360.0]))
    assert "each counts from its own first point" in refused(tmp_path, text)


def test_a_play_reads_its_kva_as_it_would_read_the_clicks(tmp_path):
    folder = tmp_path / "play"
    folder.mkdir()
    points = [",".join([name, *map(str, xyz)]) for name, xyz in zip(NAMES, TEMPLATE.points_m)]
    (folder / "helmet_landmarks.csv").write_text("\n".join(["landmark,X,Y,Z", *points]) + "\n")
    camera = {"fps": FPS, "principal_point": [SIZE[0] / 2, SIZE[1] / 2], "helmet_to_com": [0, 0, 0]}
    (folder / "Config.json").write_text(json.dumps(camera))
    for file in ("kva", "clicks"):
        (folder / f"tracks.{file}").write_text(FORMATS[file](pixels()), encoding="utf-8")
    clips = []
    for file in ("kva", "clicks"):
        (folder / "play.yaml").write_text(f"name: play\nsource:\n  kind: clicks\n  clicks: tracks.{file}\n")
        play = load_play(folder)
        assert isinstance(play.source, ClicksSource)
        clips.append(load_clip(play, play.source))
        assert check_tracks(play)["format"] == file
    assert (clips[0].tracks.pixels == clips[1].tracks.pixels).all()
    assert (clips[0].tracks.frames == clips[1].tracks.frames).all()


def test_the_reader_that_the_page_shows_reads(tmp_path, repository, monkeypatch):
    page = (repository / "docs" / "reconstruction.md").read_text()
    code = page.split("<!-- example of a reader: begin -->")[1].split("```python\n")[1].split("```")[0]
    example = types.ModuleType("wide")
    exec(compile(code, "docs/reconstruction.md", "exec"), example.__dict__)
    monkeypatch.setattr("replay.motion.readers.registry.READERS", {"wide": example, **READERS})
    heading = ["frame", *(f"{name}_{axis}" for name in NAMES for axis in "xy")]
    rows = [[str(FIRST + k), *(f"{c:.2f}" for u, v in row for c in (u, SIZE[1] - v))] for k, row in enumerate(pixels())]
    text = "\n".join(",".join(row) for row in [heading, *rows]) + "\n"
    reading = read(tmp_path, text)
    assert reading.format == "wide"
    assert reading.tracks.pixels == pytest.approx(pixels())
    assert "tracks.txt:2: LM1_x: 'q' is not a number" in refused(tmp_path, text.replace("600.00", "q", 1))


@pytest.mark.shared
def test_a_real_spreadsheet_of_kinovea_is_read_and_its_centimetres_refused(shared):
    path = shared / "real" / "kinovea" / "box_jump.xml"
    tracks = blocks(path)
    assert {track.unit for track in tracks} == {"cm"}
    assert "Hanche" in {track.name for track in tracks}
    assert len({track.name for track in tracks}) == len(tracks) >= 4
    first = tracks[[track.name for track in tracks].index("Hanche")].rows[0]
    assert (first.x, first.y, first.time.value) == (209.34, 64.55, 0.0)
    template = Template(tuple(track.name for track in tracks), np.zeros((len(tracks), 3)))
    with pytest.raises(InputError, match="is in cm") as caught:
        read_tracks(path, template, Context(24.0, (640.0, 480.0)))
    assert "remove the calibration" in str(caught.value)
