"""Rays through wire mesh, twigs and glass against the Beer-Lambert law."""

import numpy as np
import pytest

from semgrid_edu.workshop.simulation.sensors.raycast import MISS, Instant, PorousMesh, RayMesh
from semgrid_edu.workshop.simulation.things import roadside
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, box, quads

N = 20_000
FOUR_SIGMA = 4 / np.sqrt(4 * N)
"""The share of successes in N trials is off by more than this in at most 1 of 16,000 runs."""
EYE = np.array([0.0, 0.0, 1.0])


def instant(*porous: tuple[Shape, float], wall: float = 20.0) -> Instant:
    """A wall across the x axis with porous objects in front."""
    solid = RayMesh.of(
        [quads([wall, -90, -90], [0, 180, 0], [0, 0, 180], (0.5,) * 3, Material.PLASTER, Kind.BUILDING)], [0]
    )
    mesh = PorousMesh.of(*zip(*porous, strict=True)) if porous else None
    return Instant(solid, None, mesh)


def sheet(x: float, material: Material) -> Shape:
    return quads([x, -90, -90], [0, 180, 0], [0, 0, 180], (0.5,) * 3, material, Kind.FENCE)


def twigs(x: float, length: float) -> Shape:
    return box((x + length / 2, 0, 0), (length, 180, 180), (0.1,) * 3, Material.TWIGS, Kind.PLANT)


def ranges(world: Instant, angle: float = 0.0, seed: int = 0) -> np.ndarray:
    """Lengths of N equal rays at an angle from the x axis."""
    ray = np.float32([np.cos(angle), np.sin(angle), 0])
    return world.cast(EYE, np.tile(ray, (N, 1)), np.random.default_rng(seed)).distance


@pytest.mark.parametrize("angle", [0.0, 0.8, 1.2])
@pytest.mark.parametrize("x", [4.0, 8.0])
def test_wire_stops_more_beams_at_a_distance_and_at_grazing_incidence(x, angle):
    distance, cosine = x / np.cos(angle), np.cos(angle)
    through = ranges(instant((sheet(x, Material.WIRE), 0.03)), angle) > distance + 0.1
    assert through.mean() == pytest.approx(np.exp(-0.03 * distance / cosine), abs=FOUR_SIGMA)


@pytest.mark.parametrize("x", [4.0, 8.0])
def test_a_pane_transmits_the_same_share_at_any_distance(x):
    through = ranges(instant((sheet(x, Material.PANE), 0.2)), 0.8) > x / np.cos(0.8) + 0.1
    assert through.mean() == pytest.approx(np.exp(-0.2 / np.cos(0.8)), abs=FOUR_SIGMA)


def test_shares_of_two_sheets_multiply():
    through = ranges(instant((sheet(4, Material.PANE), 0.2), (sheet(6, Material.PANE), 0.5))) == 20
    assert through.mean() == pytest.approx(np.exp(-0.7), abs=FOUR_SIGMA)


def test_a_hedge_returns_beams_from_inside():
    """In an endless volume, the path inside has an exponential distribution with mean 1 / opacity."""
    depth = ranges(instant((twigs(3.0, 16.0), 4.0))) - 3.0
    assert depth.min() >= -1e-5
    assert depth.mean() == pytest.approx(0.25, rel=4 / np.sqrt(N))
    assert depth.std() == pytest.approx(0.25, rel=8 / np.sqrt(N))


@pytest.mark.parametrize("pieces", [1, 3])
def test_a_thin_hedge_lets_beams_through_to_the_wall_however_it_is_cut(pieces):
    length = 0.6 / pieces
    distance = ranges(instant(*[(twigs(3 + k * length, length), 2.0) for k in range(pieces)]))
    assert np.mean(distance == 20) == pytest.approx(np.exp(-1.2), abs=FOUR_SIGMA)
    assert np.all((distance == 20) | ((distance > 2.99) & (distance < 3.61)))


def test_rays_that_start_inside_a_hedge_hit_its_twigs():
    assert ranges(instant((twigs(-8.0, 18.0), 4.0))).mean() == pytest.approx(0.25, rel=4 / np.sqrt(N))


def test_a_wall_inside_a_hedge_is_hit_by_the_rays_that_reach_it():
    distance = ranges(instant((twigs(19.5, 2.0), 2.0)))
    assert np.mean(distance == 20) == pytest.approx(np.exp(-1.0), abs=FOUR_SIGMA)
    assert distance.max() == 20


def test_porous_objects_behind_a_wall_stop_nothing():
    assert np.all(ranges(instant((sheet(25, Material.WIRE), 100.0))) == 20)


def test_the_tables_give_the_material_that_stopped_a_ray():
    world = instant((sheet(4, Material.PANE), 0.5), (twigs(6, 4.0), 1.0))
    hits = world.cast(EYE, np.tile(np.float32([1, 0, 0]), (N, 1)), np.random.default_rng(0))
    material = world.material[hits.triangle]
    for low, high, expected in ((3.9, 4.1, Material.PANE), (6, 10, Material.TWIGS), (19.9, 20.1, Material.PLASTER)):
        there = (hits.distance > low) & (hits.distance < high)
        assert there.any()
        assert np.all(material[there] == expected)
    assert np.allclose(hits.position[:, 0], hits.distance, atol=1e-5)


def test_a_ray_that_hits_nothing_is_a_miss():
    assert np.all(ranges(instant((sheet(4, Material.PANE), 0.2)), np.pi) == MISS)


def test_without_porous_objects_no_random_numbers_are_used():
    rng, untouched = np.random.default_rng(0), np.random.default_rng(0)
    instant().cast(EYE, np.tile(np.float32([1, 0, 0]), (N, 1)), rng)
    assert rng.random() == untouched.random()


def test_wire_mesh_fills_its_frame():
    frame, wire = roadside.sheet_fence("wire", 2.5)
    assert set(wire.material) == {Material.WIRE}
    assert wire.vertices[:, 0].min() == 0
    assert wire.vertices[:, 0].max() == pytest.approx(2.5)
    assert frame.vertices[:, 2].max() == pytest.approx(wire.vertices[:, 2].max(), abs=0.06)
