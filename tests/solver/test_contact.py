"""Contact of deforming and rigid blocks: no tunnelling, no made energy, in every awkward place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from tests.contact_scenes import Block, Steps, elastic, rigid, scene

from replay.errors import InputError
from replay.solver import ContactControls, ContactPair, Material, PrescribedMotion

SOFT = elastic(1e7, 0.3, 1000.0)
FOAM = Material("foam", "crushable_foam", 84.3, {"youngs_modulus_pa": 10.5e6, "plateau_stress_pa": 0.2e6,
                                                "densification_strain": 0.65, "unloading_factor": 0.2})  # fmt: skip


def meet(blocks: Sequence[Block], end: float, *, deepest: float = 0.05, **contact: object) -> Steps:
    """Run blocks into each other and hold what every contact must keep."""
    march = Steps(scene(blocks, ContactControls(**contact)))  # type: ignore[arg-type]
    made = taken = given = 0.0
    while march.run.time_s < end:
        march.step()
        energy = march.run.energies()
        lost = energy.contact_normal + energy.friction
        # in all, and by corrections of penetration out of what was lost before
        made = max(made, -lost)
        taken = max(taken, lost)
        given = max(given, taken - lost)
    energy = march.run.energies()
    result = march.run.contact
    assert result is not None
    assert np.isfinite(march.x).all()
    assert result.counts[0] > 0, "they never met"
    assert made <= 1e-6 * energy.initial
    assert given <= 1e-3 * energy.initial
    assert march.worst_closure < 1e-12
    assert result.penetration_over_edge < deepest
    assert np.abs(march.momentum - march.momentum0).max() < 1e-12 * np.abs(march.run.mass[:, None] * 10.0).sum()
    return march


def bounce(upper: Block, lower: Block, end: float, **contact: object) -> Steps:
    """Run two blocks together along z; both must leave the way they came."""
    march = meet([upper, lower], end, **contact)
    above, below = (march.x[march.nodes_of(k)][:, 2].mean() for k in (0, 1))
    assert above > below
    return march


@pytest.mark.parametrize("count", [4, 3])
@pytest.mark.parametrize("shift", [0.0, 0.005])
def test_flat_faces_matching_or_shifted(count: int, shift: float) -> None:
    # a peer's internal energy doubles where the nodes of both faces match exactly
    march = bounce(
        Block((4, 4, 4), (0.04, 0.04, 0.04), (shift, 0.7 * shift, 0.02), SOFT, (0, 0, -2.0)),
        Block((count,) * 3, (0.04, 0.04, 0.04), (0, 0, -0.02), SOFT, (0, 0, 2.0)),
        3e-3,
    )
    energy = march.run.energies()
    # N = 4 elements: an eighth is lost at closure, what is left rings within the blocks
    assert energy.contact_normal / energy.initial == pytest.approx(1 / 8, rel=0.25)
    assert energy.kinetic + energy.internal < energy.initial


def test_peak_internal_energy_does_not_depend_on_whether_nodes_match() -> None:
    peaks = []
    for count in (4, 5):
        blocks = [
            Block((count, count, 4), (0.04, 0.04, 0.04), (0, 0, 0.02), SOFT, (0, 0, -2.0)),
            Block((4, 4, 4), (0.04, 0.04, 0.04), (0, 0, -0.02), SOFT, (0, 0, 2.0)),
        ]
        march, peak = Steps(scene(blocks, ContactControls())), 0.0
        while march.run.time_s < 2e-3:
            march.step()
            peak = max(peak, march.run.energies().internal)
        peaks.append(peak)
    assert peaks[1] == pytest.approx(peaks[0], rel=0.03)


@pytest.mark.parametrize(("light", "heavy"), [(100.0, 10000.0), (10000.0, 100.0)])
def test_mass_ratio_of_a_hundred(light: float, heavy: float) -> None:
    bounce(
        Block((3, 3, 3), (0.03, 0.03, 0.03), (0, 0, 0.0151), elastic(1e7, 0.3, light), (0, 0, -5.0),
              turn_deg=(0, 0, 30)),
        Block((4, 4, 4), (0.04, 0.04, 0.04), (0, 0, -0.02), elastic(1e7, 0.3, heavy)),
        3e-3, friction=0.3,
    )  # fmt: skip


def test_element_size_ratio_of_eight() -> None:
    bounce(
        Block((8, 8, 4), (0.04, 0.04, 0.02), (0, 0, 0.0101), SOFT, (1.0, 0, -3.0), turn_deg=(0, 0, 30)),
        Block((1, 1, 1), (0.04, 0.04, 0.04), (0, 0, -0.02), SOFT), 3e-3, friction=0.3,
    )  # fmt: skip


def test_sharp_edge_on_a_face() -> None:
    bounce(
        Block((4, 4, 4), (0.03, 0.03, 0.03), (0, 0, 0.0222), SOFT, (0, 0, -3.0), turn_deg=(45, 0, 0)),
        Block((5, 5, 2), (0.06, 0.06, 0.02), (0, 0, -0.01), SOFT, (0, 0, 1.0), turn_deg=(0, 0, 15)),
        5e-3, friction=0.3,
    )  # fmt: skip


def test_sharp_corner_on_a_face() -> None:
    bounce(
        Block((4, 4, 4), (0.03, 0.03, 0.03), (0, 0, 0.0265), SOFT, (0, 0, -3.0), turn_deg=(45, 35.264, 0)),
        Block((5, 5, 2), (0.06, 0.06, 0.02), (0, 0, -0.01), SOFT, (0, 0, 1.0), turn_deg=(0, 0, 15)),
        5e-3, friction=0.3,
    )  # fmt: skip


def test_corner_in_a_valley_rests_on_both_walls() -> None:
    c = np.sqrt(0.5)
    walls = [
        Block((4, 4, 2), (0.06, 0.06, 0.02), (-side * 0.04 * c, 0, 0.02 * c), SOFT, turn_deg=(0, side * 45, 0))
        for side in (1, -1)
    ]
    march = meet([*walls, Block((2, 3, 2), (0.02, 0.03, 0.02), (0, 0, 0.02 * c + 0.003), SOFT, (0, 0, -3.0),
                                turn_deg=(0, 45, 0))], 4e-3, friction=0.3)  # fmt: skip
    contact = march.run.contact
    assert contact is not None
    left, right = (contact.pair_sums[contact.pairs.index((k, 2)), :3] for k in (0, 1))
    assert left[2] < 0 < right[0]  # pushed down, and apart
    assert left[0] < 0 > right[2]
    # mirror images, but for which wall is looked at first
    assert left[0] == pytest.approx(-right[0], rel=0.05)


def test_thin_plate_struck_from_both_sides_is_not_passed() -> None:
    march = meet(
        [
            Block((8, 8, 1), (0.08, 0.08, 0.002), (0, 0, 0), elastic(1e8, 0.3, 1000.0)),
            Block((2, 2, 2), (0.02, 0.02, 0.02), (0, 0, 0.0115), SOFT, (0, 0, -10.0), turn_deg=(0, 0, 20)),
            Block((2, 2, 2), (0.02, 0.02, 0.02), (0.005, 0.003, -0.0115), SOFT, (0, 0, 10.0), turn_deg=(0, 0, -10)),
        ],
        3e-3, friction=0.2,
    )  # fmt: skip
    plate, above, below = (march.x[march.nodes_of(k)][:, 2] for k in range(3))
    assert above.min() > plate.max() - 0.01
    assert below.max() < plate.min() + 0.01
    assert above.mean() > plate.mean() > below.mean()


@pytest.mark.parametrize(
    ("material", "velocity"),
    [(rigid(1000.0), (150.0, 0, -5.0)), (SOFT, (80.0, 0, -20.0)), (elastic(1e7, 0.3, 200.0), (150.0, 0, -20.0))],
)
def test_fast_block_that_moves_up_to_half_a_face_in_a_step(
    material: Material, velocity: tuple[float, float, float]
) -> None:
    # the rigid corner ploughs: in a step it slides to where the dented face has another slope
    march = bounce(
        Block((3, 3, 3), (0.03, 0.03, 0.03), (-0.05, 0, 0.0152), material, velocity, turn_deg=(0, 0, 30)),
        Block((12, 4, 2), (0.2, 0.06, 0.02), (0, 0, -0.01), elastic(1e8, 0.3, 5000.0)), 1.2e-3, friction=0.1,
        deepest=0.05 if material is SOFT else 0.08,
    )  # fmt: skip
    assert march.run.dt_s * velocity[0] > 0.15 * 0.2 / 12


@pytest.mark.parametrize("across", [12, 24])
def test_pressed_block_widens_between_smooth_plates_whatever_their_mesh(across: int) -> None:
    # nodes of a plate lie flush with the block's rim and beside it: they must not hold it
    def rim(across: int) -> float:
        plates = [
            Block((across, across, 1), (0.06, 0.06, 0.01), (0, 0, side * 0.025), rigid(1e6), (0, 0, -side * 0.5))
            for side in (1, -1)
        ]
        march = Steps(scene([Block((4, 4, 4), (0.04, 0.04, 0.04), (0, 0, 0), SOFT), *plates], ContactControls()))
        while march.run.time_s < 4e-3:
            march.step()
        return float(np.ptp(march.x[march.nodes_of(0)][::5, 0]))

    assert rim(across) - 0.04 == pytest.approx(rim(1) - 0.04, rel=0.01)
    assert rim(1) > 0.041


@pytest.mark.parametrize("speed", [2.0, 200.0])
def test_node_that_meets_a_plate_within_one_step_is_stopped(speed: float) -> None:
    # rigid and plate: the step is ours, long enough for half a face
    dt = 0.5 * 0.01 / speed
    march = Steps(
        scene(
            [
                Block((1, 1, 1), (0.01, 0.01, 0.01), (0.002, 0.001, 0.0061), rigid(1000.0), (0.0, 0, -speed),
                      turn_deg=(0, 0, 20)),
                Block((4, 4, 1), (0.04, 0.04, 0.001), (0, 0, -0.0005), rigid(1e6)),
            ],
            ContactControls(),
        ),
        rigid_step_s=dt,
    )  # fmt: skip
    for _ in range(60):
        march.step()
        assert march.x[march.nodes_of(0)][:, 2].min() > march.x[march.nodes_of(1)][:, 2].max() - 5e-4
    assert np.isfinite(march.x).all()


def crusher(to: float, end: float) -> PrescribedMotion:
    t = np.linspace(0.0, end, 41)
    still = np.zeros((41, 3))
    place, speed = still.copy(), still.copy()
    place[:, 2] = -0.5 * to * (1 - np.cos(2 * np.pi * t / end))
    speed[:, 2] = -np.pi / end * to * np.sin(2 * np.pi * t / end)
    return PrescribedMotion((2,), t, place, np.tile([0, 0, 0, 1.0], (41, 1)), speed, still)


def test_pad_squeezed_to_a_fifth_neither_inverts_nor_leaks() -> None:
    blocks = [
        Block((5, 5, 4), (0.06, 0.06, 0.04), (0, 0, 0.02), FOAM),
        Block((4, 4, 1), (0.08, 0.08, 0.01), (0.001, 0.002, 0.045), rigid(1000.0)),
        Block((3, 3, 1), (0.09, 0.09, 0.01), (0, 0, -0.005), elastic(1e9, 0.3, 1000.0)),
    ]
    plain = scene(blocks, None)
    fixed = np.zeros(plain.nodes.shape, bool)
    fixed[np.unique(plain.hexes[plain.element_part == 2])] = True
    end = 0.02
    march = Steps(scene(blocks, ContactControls(friction=0.5), end=end, prescribed=(crusher(0.032, end),), fixed=fixed))
    thinnest = np.inf
    while march.run.time_s < end:
        march.step()
        pad = march.x[march.nodes_of(0)][:, 2]
        thinnest = min(thinnest, np.ptp(pad))
        assert pad.min() > -1e-3
    contact, energy = march.run.contact, march.run.energies()
    assert contact is not None
    assert thinnest < 0.2 * 0.04 * 1.05
    assert contact.penetration_over_edge < 0.05
    assert energy.contact_normal > -1e-6 * energy.external_work
    assert energy.friction > 0
    assert march.worst_closure < 1e-12
    assert energy.ratio == pytest.approx(1.0, abs=0.02)


def test_self_contact_only_on_request() -> None:
    # a block with a slit: two flaps of one part, moving together
    blocks = [Block((4, 2, 3), (0.04, 0.02, 0.03), (0, 0, 0), SOFT)]
    plain = scene(blocks, None)
    centre = plain.nodes[plain.hexes].mean(axis=1)
    kept = ~((np.abs(centre[:, 2]) < 0.005) & (centre[:, 0] > -0.01))
    used = np.unique(plain.hexes[kept])
    row = np.full(len(plain.nodes), -1)
    row[used] = np.arange(len(used))
    nodes = plain.nodes[used]
    velocity = np.zeros_like(nodes)
    flap = nodes[:, 0] > -0.01
    velocity[flap, 2] = -8.0 * np.sign(nodes[flap, 2]) * (nodes[flap, 0] + 0.01) / 0.03
    closest = {}
    for chosen in ((), (1,)):
        problem = scene(blocks, None)
        fields = {
            "nodes": nodes, "hexes": row[plain.hexes[kept]], "element_part": plain.element_part[kept],
            "initial_velocity": velocity, "contact": ContactControls(self_contact=chosen),
        }  # fmt: skip
        march = Steps(type(problem)(parts=problem.parts, controls=problem.controls, **fields))
        upper = np.isclose(nodes[:, 2], 0.005) & (nodes[:, 0] > 0.015)
        lower = np.isclose(nodes[:, 2], -0.005) & (nodes[:, 0] > 0.015)
        gap = np.inf
        while march.run.time_s < 3e-3:
            march.step()
            gap = min(gap, march.x[upper, 2].min() - march.x[lower, 2].max())
        closest[chosen] = gap
    assert closest[()] < -1e-3
    assert closest[1,] > -5e-4


def test_a_pair_that_is_switched_off_passes_through() -> None:
    blocks = [
        Block((2, 2, 2), (0.02, 0.02, 0.02), (0, 0, 0.0101), SOFT, (0, 0, -5.0)),
        Block((2, 2, 2), (0.03, 0.03, 0.02), (0, 0, -0.0101), SOFT),
    ]
    off = ContactControls(pairs=(ContactPair((1,), (2,), active=False),))
    march = Steps(scene(blocks, off)).until(1e-3)
    assert march.v[march.nodes_of(0)][:, 2].mean() == pytest.approx(-5.0, rel=1e-9)


def test_both_solvers_of_the_multipliers_agree() -> None:
    ends = []
    for solver in ("l1_jacobi", "projected_cg"):
        blocks = [
            Block((4, 4, 3), (0.04, 0.04, 0.03), (0.003, 0.002, 0.0162), SOFT, (1.0, 0.5, -3.0), turn_deg=(4, -3, 20)),
            Block((5, 5, 3), (0.06, 0.06, 0.03), (0, 0, -0.0165), SOFT),
        ]
        contact = ContactControls(friction=0.3, solver=solver, most_iterations=500, tolerance=1e-6)
        march = Steps(scene(blocks, contact)).until(1e-3)
        ends.append(march.v[march.nodes_of(0)].mean(axis=0))
    assert np.allclose(ends[0], ends[1], atol=3e-3)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"most_iterations": 0}, "most_iterations"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"solver": "gauss_seidel"}, "l1_jacobi or projected_cg"),
        ({"points": "edges"}, "center_plus_corners"),
        ({"friction": -0.1}, "the friction is -0.1"),
        ({"self_contact": (7,)}, "part 7 does not exist"),
        ({"pairs": (ContactPair((1,), (9,)),)}, "part 9 does not exist"),
        ({"pairs": (ContactPair((1,), ()),)}, "a part on either side"),
        ({"pairs": (ContactPair((1,), (2,), restitution=0.5),)}, "part 1 deforms and has a restitution"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings: dict[str, object], message: str) -> None:
    blocks = [Block((1, 1, 1), (1, 1, 1), (0, 0, z), SOFT) for z in (0, 2)]
    with pytest.raises(InputError, match=message):
        scene(blocks, ContactControls(**settings))  # type: ignore[arg-type]
