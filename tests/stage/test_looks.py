"""The cars and the road, as far as geometry can tell."""

from __future__ import annotations

import numpy as np
import pytest

from study_core.domains.driving.cars import HUMAN_CAR, ROBOT_CAR
from study_core.domains.driving.ground import ground
from study_core.scene import Body, Bounds, Mesh

CARS = [ROBOT_CAR, HUMAN_CAR]


def points(body: Body) -> np.ndarray:
    return np.concatenate([mesh.vertices for mesh in body.meshes])


def coloured(body: Body, colour: str) -> Mesh:
    [mesh] = [mesh for mesh in body.meshes if mesh.colour == colour]
    return mesh


@pytest.mark.parametrize("car", CARS, ids=lambda car: car.name)
def test_a_car_has_a_cars_size_and_stands_on_the_ground(car: Body) -> None:
    solid = np.concatenate([mesh.vertices for mesh in car.meshes if len(mesh.colour) == 7])
    width, length, height = np.ptp(solid, axis=0)
    assert 0.10 < width < 0.13
    assert 0.22 < length < 0.26
    assert 0.07 < height < 0.13
    assert solid[:, 2].min() == pytest.approx(0.0, abs=0.002)


@pytest.mark.parametrize("car", CARS, ids=lambda car: car.name)
def test_a_car_is_the_same_on_its_left_and_right(car: Body) -> None:
    for mesh in car.meshes:
        corners = {tuple(corner) for corner in np.round(mesh.vertices, 6) + 0.0}
        assert corners == {(-x + 0.0, y, z) for x, y, z in corners}


@pytest.mark.parametrize("car", CARS, ids=lambda car: car.name)
def test_headlights_are_in_front_and_tail_lights_behind(car: Body) -> None:
    assert coloured(car, "#fffbe6").vertices[:, 1].min() > 0.09
    assert coloured(car, "#c4001c").vertices[:, 1].max() < -0.09


def test_the_two_cars_differ_in_silhouette() -> None:
    robot, human = (points(car)[:, 2].max() for car in CARS)
    assert human > 1.25 * robot


def test_both_cars_are_small_on_the_wire() -> None:
    assert sum(mesh.triangles.size * 3 * 4 for car in CARS for mesh in car.meshes) < 25_000


@pytest.mark.parametrize("mesh", ground(Bounds(-0.3, 0.3, -0.4, 4.3)), ids=lambda mesh: mesh.colour)
def test_everything_on_the_ground_faces_up(mesh: Mesh) -> None:
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()


def test_usual_drives_stand_on_the_same_ground_object() -> None:
    assert ground(Bounds(-0.3, 0.3, -0.4, 4.3)) is ground(Bounds(-0.5, 0.9, -0.9, 2.3))


def test_what_grows_beside_the_road_does_not_depend_on_the_bounds() -> None:
    near, far = (ground(Bounds(-0.3, 0.3, -0.4, y_max))[2] for y_max in (4.0, 40.0))
    tufts = {tuple(corner) for corner in np.round(near.vertices, 9)}
    assert tufts <= {tuple(corner) for corner in np.round(far.vertices, 9)}
