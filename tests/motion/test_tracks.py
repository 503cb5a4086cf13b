"""Every way a table of clicks can be wrong gives one message with file, line and mend."""

import pytest

from replay.errors import InputError, InputErrors
from replay.motion.readers import Context, read_tracks
from replay.motion.settings import load_camera
from replay.motion.tracks import read_template

SIZE = (1280.0, 720.0)
TEMPLATE = "landmark,X,Y,Z\nLM1,0.185,0,-0.045\nLM2,0.135,0.095,-0.05\nLM3,0.135,-0.095,-0.05\nLM4,0.145,0,0.085\n"


def clicks(frames=6):
    rows = ["frame,landmark_id,u_px,v_px"]
    for k in range(frames):
        rows += [f"{k},LM{i},{600 + 20 * i + k},{300 + 7 * i}" for i in (1, 2, 3, 4)]
    return "\n".join(rows) + "\n"


@pytest.fixture
def files(tmp_path):
    (tmp_path / "helmet_landmarks.csv").write_text(TEMPLATE)
    (tmp_path / "kinovea_clicks.csv").write_text(clicks())
    return tmp_path


def read(files):
    template = read_template(files / "helmet_landmarks.csv")
    return read_tracks(files / "kinovea_clicks.csv", template, Context(59.94, SIZE)).tracks


def message(files):
    with pytest.raises((InputError, InputErrors)) as caught:
        read(files)
    assert caught.value.exit_code == 2
    return str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("v_px", "vpx", ["kinovea_clicks.csv:1", "column v_px is missing", "rename the heading"]),
        ("0,LM1,620,307", "0,LM1,nan,307", ["kinovea_clicks.csv:2: u_px: the cell is nan", "fill it in"]),
        ("0,LM1,620,307", "0,LM1,,307", ["kinovea_clicks.csv:2: u_px: the cell is empty"]),
        ("2,LM3,662,321", "2,LM33,662,321", ["kinovea_clicks.csv:12", "'LM33' is not in the template", "LM3?"]),
        ("2,LM3,662,321", "2,LM2,662,321", ["kinovea_clicks.csv:12", "clicked twice in frame 2 (first in line 11)"]),
        ("3,LM1,623,307", "1,LM1,623,307", ["kinovea_clicks.csv:14", "out of order", "sort the rows"]),
        ("3,LM1,623,307", "3,LM1,6230,307", ["kinovea_clicks.csv:14", "far outside the image of 1280 x 720 px"]),
        ("3,LM1,623,307", "3,LM1,623,3,307", ["kinovea_clicks.csv:14", "decimal commas"]),
        ("3,LM1,623,307", '3,LM1,"623,3",307', ["kinovea_clicks.csv:14", "decimal comma", "decimal points"]),
        ("3,LM1,623,307", "3.5,LM1,623,307", ["kinovea_clicks.csv:14: frame", "not a whole number"]),
    ],
)
def test_bad_clicks_are_named_by_line(files, old, new, expected):
    path = files / "kinovea_clicks.csv"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    text = message(files)
    assert "mend:" in text
    for part in expected:
        assert part in text


def test_semicolons_are_named(files):
    path = files / "kinovea_clicks.csv"
    path.write_text(path.read_text().replace(",", ";"))
    assert "semicolons" in message(files)


@pytest.mark.parametrize("text", ["", "\n\n", "frame,landmark_id,u_px,v_px\n"])
def test_an_empty_table_is_named(files, text):
    (files / "kinovea_clicks.csv").write_text(text)
    assert "empty" in message(files) or "no row" in message(files)


def test_byte_order_mark_windows_line_ends_and_other_headings_are_read_silently(files):
    expected = read(files).pixels
    path = files / "kinovea_clicks.csv"
    text = path.read_text().replace("frame,landmark_id,u_px,v_px", "frame,landmark,u,v")
    path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert (read(files).pixels == expected).all()


@pytest.mark.parametrize(("factor", "word"), [(1000.0, "millimetres"), (100.0, "centimetres")])
def test_a_template_in_another_unit_is_named(files, factor, word):
    rows = [row.split(",") for row in TEMPLATE.strip().split("\n")[1:]]
    scaled = [",".join([name, *(str(float(v) * factor) for v in xyz)]) for name, *xyz in rows]
    (files / "helmet_landmarks.csv").write_text("\n".join(["landmark,X,Y,Z", *scaled]) + "\n")
    text = message(files)
    assert "helmet_landmarks.csv:2" in text
    assert f"looks like {word}" in text


def test_a_template_must_span_a_plane_and_name_each_point_once(files):
    path = files / "helmet_landmarks.csv"
    path.write_text("landmark,X,Y,Z\nA,0,0,0\nB,0.1,0,0\nC,0.2,0,0\n")
    assert "on one line" in message(files)
    path.write_text(TEMPLATE + "LM2,0,0,0\n")
    assert "'LM2' is given twice (first in line 3)" in message(files)
    path.write_text("landmark,X,Y,Z\nA,0,0,0\nB,0.1,0,0\n")
    assert "too few" in message(files)


def test_hidden_landmarks_are_bridged_only_over_short_gaps(files):
    rows = clicks(9).strip().split("\n")
    path = files / "kinovea_clicks.csv"
    path.write_text("\n".join(r for r in rows if not r.startswith(("3,", "4,"))) + "\n")
    assert read(files).seen.sum(axis=1).tolist() == [4, 4, 4, 0, 0, 4, 4, 4, 4]
    path.write_text("\n".join(r for r in rows if not r.startswith(("3,", "4,", "5,"))) + "\n")
    assert "frame 5 and its neighbours show fewer than 3 landmarks" in message(files)
    path.write_text("\n".join(rows[:13]) + "\n")
    assert "too few to differentiate" in message(files)


CONFIG = '{\n  "fps": 59.94,\n  "principal_point": [640, 360],\n  "helmet_to_com": [0.01, 0.0, 0.03]\n}\n'


def test_the_articles_minimal_camera_file_is_enough(tmp_path):
    path = tmp_path / "Config.json"
    path.write_text(CONFIG)
    camera = load_camera(path)
    assert (camera.cutoffs.linear, camera.cutoffs.angular, camera.cutoffs.focal) == (15.0, 40.0, 5.0)
    assert camera.size == (1280.0, 720.0)
    assert not camera.has_reference
    assert "40 Hz is at or above the Nyquist" in camera.warnings()[0]


def test_the_articles_offset_is_accepted_with_a_warning(tmp_path):
    path = tmp_path / "Config.json"
    path.write_text(CONFIG.replace("[0.01, 0.0, 0.03]", "[-0.1, 0.4, 0.0]"))
    assert any("helmet_to_com is 0.412 m long" in warning for warning in load_camera(path).warnings())


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("59.94", "0", ["Config.json:2: fps", "> 0"]),
        ("59.94", '"59,94"', ["Config.json:2: fps", "decimal point"]),
        ("[640, 360]", "[640]", ["Config.json:3: principal_point"]),
        ('"fps"', '"fsp"', ["fps: is missing", "did you mean `fps`?"]),
        ("59.94,", "59.94", ["is not JSON"]),
        ("59.94", '59.94, "camera_distance_m": 40', ["belong together"]),
        ("59.94", '59.94, "image_size": [600, 300]', ["lies outside the image"]),
        ("59.94", '59.94, "image_size": [0, 300]', ["image_size[0]", "> 0"]),
    ],
)
def test_bad_camera_files_are_named_by_line(tmp_path, old, new, expected):
    path = tmp_path / "Config.json"
    path.write_text(CONFIG.replace(old, new, 1))
    with pytest.raises((InputError, InputErrors)) as caught:
        load_camera(path)
    for part in expected:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (CONFIG.replace("59.94", "59.94" + " " * 200_000), "is 200"),
        ("[" * 50_000, "nests brackets too deep"),
        ('{"a": ' + "[" * 400 + "]" * 400 + "}", "Config.json"),
        (CONFIG.replace('"fps"', '"f\x80ps"'), "Config.json"),
    ],
)
def test_a_camera_file_that_is_none_is_told_at_once(tmp_path, text, expected):
    path = tmp_path / "Config.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises((InputError, InputErrors), match=expected):
        load_camera(path)


def test_a_message_does_not_repeat_a_spoilt_file(files):
    path = files / "kinovea_clicks.csv"
    path.write_text(path.read_text().replace("0,LM1", "0," + "LM1" * 5000, 1))
    assert len(message(files)) < 3000
