"""Shapes have the sizes, positions and kinds that their functions promise."""

import numpy as np
import pytest
import trimesh

from semgrid_edu.workshop.simulation.things.buildings import House, build_house
from semgrid_edu.workshop.simulation.things.cars_and_people import BODIES, Person, bicycle, car, car_size, rider, walker
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.roadside import FENCES, SIGNS, TREES, bush, fence, hedge, sign, tree
from semgrid_edu.workshop.simulation.things.shapes import ball, box, merge, quads, tube

STYLE = {"colour": (0.5, 0.5, 0.5), "material": Material.MATTE, "kind": Kind.POLE}


def test_a_tube_has_the_volume_of_its_prism():
    shape = tube((1, 2, 3), (4, 6, 3), (0.5, 0.5), sides=64, **STYLE)
    assert trimesh.Trimesh(shape.vertices, shape.faces).volume == pytest.approx(np.pi * 0.25 * 5, rel=0.01)


def test_a_quad_faces_right_cross_up():
    assert quads([0, 0, 0], [1, 0, 0], [0, 0, 1], **STYLE).normals == pytest.approx(np.array([[0, -1, 0]] * 2))


def test_placing_rotates_then_translates():
    turned = box((1, 0, 0), (0.2, 0.2, 0.2), **STYLE).placed((10, 20, 1), np.pi / 2)
    assert turned.vertices.mean(axis=0) == pytest.approx([10, 21, 1], abs=1e-5)


def test_an_overturned_car_rests_on_its_roof():
    height = car_size("sedan")[2]
    upright, lying = car("sedan"), car("sedan").overturned(height)
    ends = upright.vertices.min(axis=0), upright.vertices.max(axis=0)
    turned = lying.vertices.min(axis=0), lying.vertices.max(axis=0)
    np.testing.assert_allclose(turned[0][2], height - ends[1][2], atol=1e-5)
    np.testing.assert_allclose([turned[0][0], turned[1][0]], [ends[0][0], ends[1][0]], atol=1e-5)
    np.testing.assert_allclose(lying.vertices[:, 2], height - upright.vertices[:, 2], atol=1e-5)
    outward = np.cross(*(lying.vertices[lying.faces[:, k]] - lying.vertices[lying.faces[:, 0]] for k in (1, 2)))
    lengths = np.linalg.norm(outward, axis=1, keepdims=True)
    flat = lengths[:, 0] > 1e-6
    np.testing.assert_allclose((outward / np.maximum(lengths, 1e-9))[flat], lying.normals[flat], atol=1e-3)


def test_merging_keeps_every_triangle():
    one, two = box((0, 0, 0), (1, 1, 1), **STYLE), ball((5, 0, 0), (1, 1, 1), **STYLE)
    both = merge([one, two])
    assert np.array_equal(both.vertices[both.faces[-len(two.faces) :]], two.vertices[two.faces])


def test_a_car_fills_its_box_and_touches_the_ground():
    offenders = []
    for body in BODIES:
        low, high = car(body).vertices.min(axis=0), car(body).vertices.max(axis=0)
        errors = [*(high - low - car_size(body))[:2], high[2] - car_size(body)[2], low[2]]
        if np.any(np.abs(errors) > [0.1, 0.3, 0.01, 0.01]):
            offenders.append((body, errors))
    assert offenders == []


def test_people_have_their_height_and_touch_the_ground():
    person = Person.random(np.random.default_rng(0))
    for distance in (0.0, 0.4, 1.0):
        shape = walker(person, distance)
        assert shape.vertices[:, 2].min() == pytest.approx(0.0, abs=0.05)
        assert shape.vertices[:, 2].max() == pytest.approx(person.height, abs=0.06)
        assert set(shape.kind) == {Kind.PEDESTRIAN}
        assert set(rider(person, distance).kind) == {Kind.BICYCLE}


def test_the_gait_repeats():
    person = Person.random(np.random.default_rng(0))
    assert np.array_equal(walker(person, 0.3).vertices, walker(person, 0.3 + 1.45).vertices)


def test_a_house_covers_its_plan_up_to_its_eaves():
    house = House(10.0, 8.0, 2, "flat", False, 3)
    shape = build_house(house)
    walls = trimesh.Trimesh(shape.vertices, shape.faces)
    assert walls.bounds[:, 2] == pytest.approx([-2.5, house.eaves + 1.8], abs=0.01)
    assert set(shape.kind) == {Kind.BUILDING}


def test_all_triangles_have_the_kind_of_their_object():
    kinds = {Kind.PLANT: [tree(s, 0) for s in TREES] + [bush(0), hedge(0)], Kind.FENCE: [fence(s, 2.5) for s in FENCES]}
    for kind, shapes in kinds.items():
        assert all(set(shape.kind) == {kind} for shape in shapes)
    assert all(set(sign(s).kind) == {Kind.POLE, Kind.SIGN} for s in SIGNS)
    assert set(bicycle().kind) == {Kind.BICYCLE}
