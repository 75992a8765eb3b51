"""Marching cubes: closed meshes whose vertices lie on the surface."""

import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.sdf import (
    Box,
    CappedCone,
    Cylinder,
    Difference,
    Intersection,
    Sphere,
    Torus,
    Transformed,
    Union,
    axis_rotation,
    polygonize,
)
from tests.sdf.solids import SHAPES, fine_mesh

SOLIDS = {name: kind(**parameters) for name, (kind, parameters) in SHAPES.items()} | {
    "union": Union(Box((0.5, 0.5, 0.3)), Transformed(Sphere(0.25), translation=(0, 0, 0.25))),
    "difference": Difference(Cylinder(0.3, 0.5), Transformed(Sphere(0.25), translation=(0, 0, 0.25))),
    "turned": Transformed(Torus(0.3, 0.1), axis_rotation((1, 1, 0), 50), (0.2, -0.1, 0.5), 1.4),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_the_mesh_is_closed_oriented_outward_and_on_the_surface(name):
    solid = SOLIDS[name]
    mesh = polygonize(solid, 48)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    distance = solid.distance(torch.as_tensor(mesh.vertices, dtype=torch.float64))
    assert distance.abs().max() < 1e-4
    lower, upper = solid.bounds().numpy()
    assert (mesh.bounds[0] >= lower - 1e-4).all()
    assert (mesh.bounds[1] <= upper + 1e-4).all()


@pytest.mark.parametrize(("kind", "parameters"), [SHAPES["sphere-small"], SHAPES["torus-fat"]])
def test_the_volume_is_that_of_the_solid(kind, parameters):
    assert polygonize(kind(**parameters), 64).volume == pytest.approx(fine_mesh(kind, parameters).volume, rel=5e-3)


def test_a_higher_resolution_gives_more_triangles():
    assert len(polygonize(Sphere(0.3), 32).faces) > 3 * len(polygonize(Sphere(0.3), 16).faces)


def test_double_precision_surfaces_and_flat_faces_on_grid_planes_work():
    cube = Box(torch.tensor([0.5, 0.5, 0.5], dtype=torch.float64))
    assert polygonize(cube, 32).is_watertight
    np.testing.assert_allclose(polygonize(CappedCone(0.5, 0.3), 64).bounds[:, 2], (-0.25, 0.25), atol=1e-5)


@pytest.mark.parametrize("gap", [0.3, 5.0])
def test_an_empty_solid_is_refused(gap):
    apart = Transformed(Sphere(0.1), translation=(gap, 0.15, 0.0))
    with pytest.raises(InputError, match="empty"):
        polygonize(Intersection(Sphere(0.1), apart))
