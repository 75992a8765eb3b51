import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.scene import Container, Scene
from surfsup.sdf import Box, Difference, Sphere, Transformed, Union
from surfsup.sph.boundary.scene_boundaries import Walls, boundaries, surface_map, wall_map

WATER = "fluid: [{block: {min: [-0.1, -0.1, 0.6], max: [0.1, 0.1, 0.8]}}]\n"


def test_walls_are_solid_where_the_container_is_not():
    walls = Walls(Container(size=(1.0, 1.0, 2.0)))
    points = torch.tensor([[0.0, 0.0, 0.1], [0.45, 0.0, 1.0], [0.6, 0.0, 1.0], [0.0, 0.0, -0.05], [0.0, 0.0, 1.9]])
    np.testing.assert_allclose(walls.distance(points), [0.1, 0.05, -0.1, -0.05, 0.1], atol=1e-6)


def test_an_empty_container_has_walls_only():
    scene = Scene.from_yaml(WATER, "test")
    assert len(boundaries(scene, None)) == 1
    assert len(boundaries(scene, Sphere(0.1))) == 2


def test_walls_are_felt_from_both_sides():
    made = wall_map(Container(size=(0.4, 0.4, 0.4)))
    assert made.distances.min() < -0.08
    assert made.distances.max() > 0.06
    assert (made.volumes[made.distances <= 0] > 0.3e-3).all()


def test_cells_end_at_all_walls_so_that_all_corners_are_alike():
    container = Container(size=(1.23, 1.48, 0.97))
    made = wall_map(container)
    for wall in (container.lower, container.upper):
        cells = (wall - made.lower) / made.cell
        np.testing.assert_allclose(cells, np.round(cells), atol=1e-9)
    np.testing.assert_allclose(made.cell, 0.05, rtol=0.05)


def test_a_map_of_a_huge_solid_ends_a_little_beyond_the_container():
    container = Container()
    made = surface_map(Transformed(Box((9.0, 9.0, 0.6))), container)
    assert made.resolution[0] * made.cell[0] < container.size[0] + 0.3
    assert made.resolution[2] * made.cell[2] < 0.6


def test_of_a_bound_the_true_distance_is_taken():
    # What is left is a box again, but beside its cut edges the value is the bound: up to 30 % too small.
    solid = Difference(Box((0.2, 0.2, 0.2)), Transformed(Box((0.4, 0.4, 0.2)), translation=(0.0, 0.0, 0.1)))
    made = surface_map(Transformed(solid, translation=(0.0, 0.0, 0.5)), Container())
    exact = surface_map(Transformed(Box((0.2, 0.2, 0.1)), translation=(0.0, 0.0, 0.45)), Container())
    assert made.distances.max() == pytest.approx(exact.distances.max(), abs=5e-3)
    assert len(made.kept) == pytest.approx(len(exact.kept), rel=0.05)


def test_exactness_is_inherited():
    ball, cut = Sphere(0.1), Difference(Sphere(0.1), Box((0.1, 0.1, 0.1)))
    assert Union(ball, Transformed(ball)).exact_outside
    assert not Union(ball, cut).exact_outside
    assert not Transformed(cut).exact_outside


def test_a_solid_outside_the_container_is_refused():
    with pytest.raises(InputError, match="no point near the container"):
        surface_map(Transformed(Sphere(0.1), translation=(5.0, 0.0, 0.0)), Container())
