"""A play is described once, and every mistake in its description is named at once."""

import json
import shutil

import pytest

from replay.errors import InputError, InputErrors
from replay.play import Play, load_play, play_schema, play_schema_text

PLAYS = ("demo", "broadcast", "wearable", "collision-demo", "linear-impactor", "drop")


@pytest.fixture
def demo(tmp_path, repository):
    """A copy of the demo play that a test may spoil."""
    return shutil.copytree(repository / "config" / "plays" / "demo", tmp_path / "demo")


@pytest.fixture
def wearable(tmp_path, repository):
    """A copy of the wearable play that a test may spoil."""
    return shutil.copytree(repository / "config" / "plays" / "wearable", tmp_path / "wearable")


def spoil(folder, old, new):
    path = folder / "play.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def message(folder):
    with pytest.raises((InputError, InputErrors)) as caught:
        load_play(folder / "play.yaml")
    assert caught.value.exit_code == 2
    return str(caught.value)


@pytest.mark.parametrize("name", PLAYS)
def test_shipped_plays_are_sound_and_lie_in_folders_of_their_name(repository, name):
    play = load_play(repository / "config" / "plays" / name)
    assert play.name == name
    assert all(path.is_file() for path in play.files)


def test_schema_in_the_repository_is_that_of_the_models(repository):
    text = (repository / "workflow" / "schemas" / "play.schema.json").read_text()
    assert text == play_schema_text(), "write play_schema_text() to workflow/schemas/play.schema.json"


def test_every_setting_has_a_description_and_a_default_or_an_example():
    def check(block, where):
        for name, entry in block.get("properties", {}).items():
            assert entry.get("description"), f"{where}.{name}"
            assert "default" in entry or "examples" in entry or "$ref" in entry, f"{where}.{name}"

    schema = play_schema()
    check(schema, "play")
    for name, block in schema["$defs"].items():
        check(block, name)


def test_play_survives_json(repository):
    play = load_play(repository / "config" / "plays" / "wearable")
    assert Play.model_validate(json.loads(json.dumps(play.model_dump(mode="json")))).model_dump() == play.model_dump()


def test_a_play_cannot_be_changed(repository):
    play = load_play(repository / "config" / "plays" / "demo")
    with pytest.raises(ValueError, match="frozen"):
        play.t0 = "linear"


def test_all_problems_are_named_at_once_in_the_order_of_the_file(demo):
    spoil(demo, "mass_kg: 1.83 ", "mass_kg: 4.0 ")
    spoil(demo, "struck_player:", "struk_player:")
    spoil(demo, "clicks: kinovea_clicks.csv", "clicks: nowhere.csv")
    spoil(demo, "t0: angular", "t0: angluar")
    spoil(demo, "time_step_factor: 0.9", 'time_step_factor: "0,9"')
    spoil(demo, "quadratic: 1.2", "quadratc: 1.2")
    text = message(demo)
    assert text.startswith("6 problems")
    lines = [int(row.split("play.yaml:")[1].split(":")[0]) for row in text.split("\n") if "play.yaml:" in row]
    assert lines == sorted(lines)
    for expected in (
        "struk_player: is no known setting",
        "did you mean `struck_player`?",
        "source.clicks: 'nowhere.csv': the file does not exist",
        "did you mean `angular`?",
        "use a decimal point",
        "solver.bulk_viscosity.quadratc",
        "did you mean `quadratic`?",
    ):
        assert expected in text


def test_a_helmet_of_four_kilograms_is_refused_with_the_range(demo):
    spoil(demo, "mass_kg: 1.83 ", "mass_kg: 4.0 ")
    text = message(demo)
    assert "play.yaml:21: helmet.mass_kg: 4.0 [kg]" in text
    assert "1.82 +- 0.5 kg" in text
    assert "weigh the helmet" in text


@pytest.mark.parametrize("mass", [1.32, 2.32])
def test_the_range_of_the_helmet_includes_its_ends(demo, mass):
    spoil(demo, "mass_kg: 1.83 ", f"mass_kg: {mass} ")
    assert load_play(demo).helmet.mass_kg == mass


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("t0: angular", "t0: angular\nt0: linear", "the key is written twice"),
        ("  before_t0_s: 0.010", "\tbefore_t0_s: 0.010", "a tab is used to indent"),
        ("hourglass: {method", "hourglass: [{method", "is not YAML"),
        ("duration_s: 0.030", "duration_s: -0.030", "> 0"),
        ("duration_s: 0.030", "duration_s: yes", "truth value"),
        ("duration_s: 0.030", "duration_s: .nan", "finite"),
        ("duration_s: 0.030", "duration_s: 30 ms", "a number [s]"),
        ("name: demo", "name: Demo!", "small letters"),
        ("name: demo", "name: other", "the folder is called 'demo'"),
        ("kind: clicks", "kind: click", "did you mean `clicks`?"),
        ("kind: clicks   ", "knd: clicks   ", "`kind`"),
        ("resolution: coarse", "resolution: finest", "'tiny', 'coarse', 'medium' or 'fine'"),
    ],
)
def test_a_mistake_is_named_with_what_was_expected(demo, old, new, expected):
    spoil(demo, old, new)
    assert expected in message(demo)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("axes: sae_j211", "axes: {x: +x, y: +y, z: -z}", "mirror"),
        ("axes: sae_j211", "axes: sae", "did you mean `sae_j211`?"),
        ("unit: deg/s}", "unit: degs}", "did you mean `deg/s`?"),
        ("kind: butterworth,", "kind: buterworth,", "did you mean `butterworth`?"),
        ("unit: g}", "}", "source.columns.acceleration.unit: is missing"),
        ("  sensor_to_cg_m: [-0.075, 0.0, 0.055]", "  #", "source.sensor_to_cg_m: is missing"),
        ("[0.074773, -0.001055, -0.853344, 0.515957]", "[0, 0, 0, 2]", "unit quaternion"),
    ],
)
def test_a_wearable_is_described_whole(wearable, old, new, expected):
    spoil(wearable, old, new)
    assert expected in message(wearable)


def test_byte_order_mark_and_windows_line_ends_are_no_mistakes(demo):
    path = demo / "play.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert load_play(demo).name == "demo"


def test_an_empty_description_is_named(demo):
    (demo / "play.yaml").write_text("")
    assert "the file is empty" in message(demo)
    (demo / "play.yaml").write_text("- a\n- b\n")
    assert "holds no settings" in message(demo)
    (demo / "play.yaml").unlink()
    assert "does not exist" in message(demo)


def test_a_play_may_lie_elsewhere(demo, tmp_path):
    play = load_play(demo)
    assert play.lying_in(tmp_path).files[0] == tmp_path / "kinovea_clicks.csv"
    assert play.files[0] == demo / "kinovea_clicks.csv"


def test_what_is_withheld_must_be_there_and_have_a_reason(demo):
    spoil(demo, "gates: {}", "withhold: {video.mp4: belongs to the league}\ngates: {}")
    assert "'video.mp4' cannot be withheld" in message(demo)
    (demo / "video.mp4").write_bytes(b"frames")
    assert load_play(demo).withhold == {"video.mp4": "belongs to the league"}
    spoil(demo, "belongs to the league", "''")
    assert "video.mp4 is withheld for no reason" in message(demo)


@pytest.fixture
def collision(tmp_path, repository):
    """A copy of the collision demo that a test may spoil."""
    return shutil.copytree(repository / "config" / "plays" / "collision-demo", tmp_path / "collision-demo")


def test_a_play_with_two_players_is_a_collision(collision, demo):
    assert load_play(collision / "play.yaml").mode == "collision"
    assert load_play(demo / "play.yaml").mode == "driver"


def test_an_axis_of_one_point_is_refused(collision):
    spoil(collision, "q_m: [0.0, 1.0, 0.0]", "q_m: [0.0, 0.0, 0.0]")
    assert "P and Q are one point" in message(collision)


def test_the_start_of_a_player_whom_nobody_filmed_cannot_be_reconstructed(collision):
    text = (collision / "play.yaml").read_text()
    head, start = text.split("    start:\n")
    rest = start[start.index("  aim_m") :]
    (collision / "play.yaml").write_text(f"{head}    start: {{kind: reconstruction}}\n{rest}")
    assert "start of the impactor is to be reconstructed, but the tracks show the other player" in message(collision)
    spoil(collision, "tracked: struck", "tracked: impactor")
    assert load_play(collision / "play.yaml").collision.impactor.start.fit_s == 0.020


@pytest.fixture
def laboratory(tmp_path, repository):
    """A copy of the linear impactor's play that a test may spoil."""
    return shutil.copytree(repository / "config" / "plays" / "linear-impactor", tmp_path / "linear-impactor")


def test_a_play_of_which_nothing_was_recorded_needs_a_collision_with_given_starts(laboratory):
    play = load_play(laboratory / "play.yaml")
    assert (play.mode, play.recorded, play.files) == ("collision", False, ())
    text = (laboratory / "play.yaml").read_text()
    (laboratory / "play.yaml").write_text(text[: text.index("collision:")])
    assert "nothing was recorded, and nothing says how the head moves" in message(laboratory)


def test_an_apparatus_strikes_alone_and_says_the_closing_speed_alone(laboratory):
    spoil(laboratory, "struck: {name: headform}", "struck: {start: {kind: given, velocity_m_per_s: [1.0, 0.0, 0.0]}}")
    assert "the struck player has a velocity of their own" in message(laboratory)
    spoil(laboratory, "struck: {start: {kind: given, velocity_m_per_s: [1.0, 0.0, 0.0]}}", "impactor: {name: another}")
    assert "an `impactor`, or an `apparatus` of a laboratory" in message(laboratory)


def test_friction_is_between_the_helmet_and_whatever_strikes_it(laboratory, collision):
    of = {folder.name: load_play(folder / "play.yaml").collision.pairs for folder in (laboratory, collision)}
    assert [pair.second for pairs in of.values() for pair in pairs] == ["apparatus", "helmet_2"]
