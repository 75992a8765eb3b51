import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.scene import Container, Scene
from surfsup.sdf import Box, Difference, Sphere, Transformed, Union
from surfsup.sph.boundary.scene_boundaries import Walls, scene_volume_maps, surface_map, wall_map

WATER = "fluid: [{block: {min: [-0.1, -0.1, 0.6], max: [0.1, 0.1, 0.8]}}]\n"


def test_walls_are_solid_outside_the_container():
    walls = Walls(Container(size=(1.0, 1.0, 2.0)))
    points = torch.tensor([[0.0, 0.0, 0.1], [0.45, 0.0, 1.0], [0.6, 0.0, 1.0], [0.0, 0.0, -0.05], [0.0, 0.0, 1.9]])
    np.testing.assert_allclose(walls.distance(points), [0.1, 0.05, -0.1, -0.05, 0.1], atol=1e-6)


def test_the_walls_come_first_then_the_solid():
    scene = Scene.from_yaml(WATER, "test")
    assert len(scene_volume_maps(scene, None)) == 1
    assert len(scene_volume_maps(scene, Sphere(0.1))) == 2


def test_the_map_covers_both_sides_of_the_walls():
    volume_map = wall_map(Container(size=(0.4, 0.4, 0.4)))
    assert volume_map.distances.min() < -0.08
    assert volume_map.distances.max() > 0.06
    assert (volume_map.volumes[volume_map.distances <= 0] > 0.3e-3).all()


def test_cells_end_at_every_wall():
    container = Container(size=(1.23, 1.48, 0.97))
    volume_map = wall_map(container)
    for wall in (container.lower, container.upper):
        cells = (wall - volume_map.lower) / volume_map.cell
        np.testing.assert_allclose(cells, np.round(cells), atol=1e-9)
    np.testing.assert_allclose(volume_map.cell, 0.05, rtol=0.05)


def test_the_map_of_a_huge_solid_ends_just_beyond_the_container():
    container = Container()
    volume_map = surface_map(Transformed(Box((9.0, 9.0, 0.6))), container)
    assert volume_map.resolution[0] * volume_map.cell[0] < container.size[0] + 0.3
    assert volume_map.resolution[2] * volume_map.cell[2] < 0.6


def test_a_surface_whose_value_is_a_bound_gets_true_distances():
    # The difference is a box, but beside the cut edges its value is a bound, up to 30 % too small.
    solid = Difference(Box((0.2, 0.2, 0.2)), Transformed(Box((0.4, 0.4, 0.2)), translation=(0.0, 0.0, 0.1)))
    volume_map = surface_map(Transformed(solid, translation=(0.0, 0.0, 0.5)), Container())
    exact = surface_map(Transformed(Box((0.2, 0.2, 0.1)), translation=(0.0, 0.0, 0.45)), Container())
    assert volume_map.distances.max() == pytest.approx(exact.distances.max(), abs=5e-3)
    assert len(volume_map.cells) == pytest.approx(len(exact.cells), rel=0.05)


def test_a_combination_is_exact_outside_if_its_parts_are():
    ball, cut = Sphere(0.1), Difference(Sphere(0.1), Box((0.1, 0.1, 0.1)))
    assert Union(ball, Transformed(ball)).exact_outside
    assert not Union(ball, cut).exact_outside
    assert not Transformed(cut).exact_outside


def test_a_solid_outside_the_container_is_an_error():
    with pytest.raises(InputError, match="no point near the container"):
        surface_map(Transformed(Sphere(0.1), translation=(5.0, 0.0, 0.0)), Container())
