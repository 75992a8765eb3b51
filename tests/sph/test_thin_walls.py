"""Walls that are too thin for particles are warned of, and edges are no walls."""

import warnings

import pytest
import torch
import trimesh

from surfsup.scene import Block, Scene
from surfsup.scene.solids import Solids, build_solids
from surfsup.scene.units import Units
from surfsup.sdf import Box, Sphere, Torus, Transformed
from surfsup.sdf.mesh.surface import MeshSurface
from surfsup.simulation import Simulation
from surfsup.sph.thin_walls import ThinWallWarning, thin_wall, thin_wall_warning

LIMIT = 0.02


@pytest.mark.parametrize("thickness", [0.0002, 0.005, 0.015])
def test_the_thickness_of_a_plate_is_found(thickness):
    assert thin_wall(Box((1.0, 0.7, thickness)), LIMIT) == pytest.approx(thickness, rel=0.01, abs=2e-5)


@pytest.mark.parametrize("solid", [Sphere(0.2), Torus(0.3, 0.05), Box((0.5, 0.5, 0.03)), Box((0.1, 0.1, 0.1))])
def test_what_is_thick_is_not_warned_of(solid):
    assert thin_wall(solid, LIMIT) is None


def test_the_wall_of_a_mesh_is_measured_and_the_edge_of_a_cone_is_no_wall():
    outer, inner = trimesh.creation.icosphere(3, 0.3), trimesh.creation.icosphere(3, 0.295)
    inner.invert()
    shell = MeshSurface(trimesh.util.concatenate([outer, inner]))
    assert thin_wall(shell, LIMIT) == pytest.approx(0.005, rel=0.05)
    assert thin_wall(MeshSurface(trimesh.creation.cone(0.2, 0.3)), LIMIT) is None


def test_the_warning_names_the_solid_and_a_radius_that_is_small_enough():
    scene = Scene.from_yaml(
        "surfaces: {lid: {box: {size: [1, 1, 0.004]}, at: [0, 0, 0.5], motion: {spin: {turns: 0.1}}}}\n"
        "fluid: [{block: {min: [0, 0, 1], max: [0.1, 0.1, 1.1]}}]",
        "test",
    )
    warning = thin_wall_warning(build_solids(scene), scene.units)
    assert "walls of 'lid' are 4 mm thick, particles 30 mm" in warning
    assert "particle_radius: 0.003 avoids it" in warning
    assert thin_wall_warning(build_solids(scene), Units(0.003 - 1e-4)) is None
    assert thin_wall_warning(Solids(None), scene.units) is None
    torch.manual_seed(1)
    assert thin_wall_warning(build_solids(scene), scene.units) == warning


def test_a_simulation_in_python_warns_of_them():
    water = [Block((0, 0, 0.6), (0.1, 0.1, 0.7))]
    plate = Transformed(Box((0.5, 0.5, 0.004)), translation=(0, 0, 0.4))
    with pytest.warns(ThinWallWarning, match="walls of the solid are 4 mm thick"):
        Simulation(Scene(surface=plate, fluid=water), device="cpu")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Simulation(Scene(surface=Transformed(Sphere(0.1), translation=(0, 0, 0.2)), fluid=water), device="cpu")
