from pathlib import Path

import numpy as np
import pytest
import trimesh

from surfsup.errors import SimulationError
from surfsup.viewing.liquid_look import WATER
from surfsup.viewing.shading_mesh import ShadingMesh
from surfsup.viewing.water import Background, Samples, reconstruct_surface, shade_water

RADIUS = 0.015
# Positions (N, 3) of a frame of a falling block, meters, float32.
# With a cell size of 0.7 particle radii pysplashsurf 0.14 loses a vertex around them.
UNLUCKY = np.load(Path(__file__).with_name("unlucky_particles.npy"), allow_pickle=False)


def mesh_of(surface: ShadingMesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(surface.vertices, surface.faces, process=False)


def test_a_failed_reconstruction_is_repeated_with_another_cell_size():
    surface = reconstruct_surface(UNLUCKY, RADIUS)
    assert len(surface.vertices) > 1000 and mesh_of(surface).is_watertight
    assert (UNLUCKY.min(0) - 2 * RADIUS < surface.vertices.min(0)).all()
    assert (surface.vertices.max(0) < UNLUCKY.max(0) + 2 * RADIUS).all()


def test_the_surface_encloses_the_volume_of_the_water():
    block = 0.03 * np.stack(np.meshgrid(*[np.arange(10.0)] * 3), -1).reshape(-1, 3).astype(np.float32)
    surface = reconstruct_surface(block, RADIUS)
    assert mesh_of(surface).volume == pytest.approx(len(block) * 0.03**3, rel=0.2)
    outwards = np.einsum("ij,ij->i", surface.normals, surface.vertices - block.mean(0))
    assert (outwards > 0).mean() > 0.99


def test_thick_water_is_blue_and_thin_water_over_brown_stays_brown():
    brown, up = np.array([0.6, 0.3, 0.17], np.float32), np.array([[0.0], [0.0], [1.0]], np.float32)
    depth = np.full((1, 1), np.inf, np.float32)

    def color(thickness):
        at = np.zeros(1, int)
        samples = Samples(up, up, np.ones(1, np.float32), np.full(1, thickness, np.float32), WATER, at, at)
        return shade_water(samples, Background(lambda rows, columns: brown[:, None], depth, 1000.0), np.eye(3))[:, 0]

    red, green, blue = color(0.03)
    assert red > green > blue
    red, green, blue = color(0.5)
    assert blue > green > red
    np.testing.assert_allclose(color(0.0), brown, atol=0.03)


def test_particles_without_a_surface_are_an_error():
    with pytest.raises(SimulationError, match="no surface around the 1 particles"):
        reconstruct_surface(np.full((1, 3), np.nan, np.float32), RADIUS)
