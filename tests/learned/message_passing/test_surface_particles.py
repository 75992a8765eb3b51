import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from surfsup.learned.message_passing.surface_particles import SurfaceParticles, poisson_disk
from surfsup.sdf import Box, Sphere, Torus, Transformed, Union, axis_rotation

SURFACES = [Sphere(0.3), Torus(0.3, 0.1), Union(Box((0.4, 0.4, 0.4)), Transformed(Sphere(0.2), None, (0, 0, 0.3)))]


@pytest.mark.parametrize("surface", SURFACES, ids=lambda surface: type(surface).__name__)
def test_the_requested_number_of_points_lies_evenly_on_the_surface(surface):
    points = poisson_disk(surface, 500, seed=1)
    assert (points.shape, points.dtype) == ((500, 3), np.float32)
    assert float(surface.distance(torch.from_numpy(points)).abs().max()) < 0.006
    nearest = cKDTree(points).query(points, k=2)[0][:, 1]
    assert nearest.max() < 2.5 * nearest.min()


def test_points_depend_on_the_seed_alone():
    assert np.array_equal(poisson_disk(Sphere(0.2), 50, 3), poisson_disk(Sphere(0.2), 50, 3))
    assert not np.array_equal(poisson_disk(Sphere(0.2), 50, 3), poisson_disk(Sphere(0.2), 50, 4))


def test_particles_are_transformed_with_their_surface():
    torus, particles = Torus(0.3, 0.1), SurfaceParticles(200)
    moved = Transformed(torus, axis_rotation((1, 2, 0), 40), (0.1, 0.2, 0.3), 0.5)
    mirrored = Transformed(moved, torch.diag(torch.tensor([-1.0, 1.0, 1.0])))
    assert particles.of(torus) is particles.of(torus), "drawn once"
    for surface in (moved, mirrored):
        assert surface.distance(particles.of(surface)).abs().max() < 0.001
    torch.testing.assert_close(moved.to_own_frame(particles.of(moved)), particles.of(torus))


def test_particles_of_a_deleted_surface_are_freed():
    particles = SurfaceParticles(20)
    for _ in range(3):
        particles.of(Sphere(0.2))
    assert len(particles._samples) == 0
