"""Water denser than at rest is moved apart; other water is left alone."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.sph.boundary.density import solid_density
from surfsup.sph.boundary.walls import walls_density
from surfsup.sph.collision import CLEARANCE
from surfsup.sph.decompress import NoRoomWarning, decompressed
from surfsup.sph.dfsph import SELF_DENSITY
from surfsup.sph.environment import Environment
from surfsup.sph.kernel_sums import kernel_graph, kernel_sums
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.solver import DfsphSolver

CORNER = """
container: {size: [0.6, 0.6, 1]}
surface: {sphere: {radius: 0.08}, at: [-0.12, -0.12, 0.1]}
fluid: [{block: {min: [-0.3, -0.3, 0], max: [0, 0, 0.3]}}]
"""


def densities(positions: np.ndarray, environment: Environment) -> torch.Tensor:
    """Density (N,) of particles at ``positions``, relative to the rest density."""
    points = torch.from_numpy(positions)
    graph = kernel_graph(points, find_neighbors(points, KERNEL_SUPPORT))
    sums = kernel_sums(points.new_ones(len(points), 1), graph)[:, 0, 0]
    walls, _ = walls_density(points, environment.lower, environment.upper)
    distance, fraction, _ = environment.boundary_map.query(points)
    return SELF_DENSITY * (1 + sums) + walls + solid_density(distance, fraction)[0]


def corner() -> tuple[Scene, Environment]:
    scene = Scene.from_yaml(CORNER, "test")
    return scene, Environment.of(scene, scene.build_surface())


def test_no_particle_is_denser_than_at_rest_afterwards_or_in_a_solid():
    scene, environment = corner()
    start = scene.initial_particles(environment.surface)
    apart = decompressed(start, environment)
    assert densities(start.positions, environment).max() > 1.5
    assert densities(apart.positions, environment).max() < 1.005
    assert [len(block) for block in apart.block_positions] == [len(block) for block in start.block_positions]
    assert environment.distance_and_normal(torch.from_numpy(apart.positions))[0].min() > CLEARANCE - 1e-4
    assert (apart.positions > scene.container.lower).all()


def test_water_that_does_not_fit_gives_a_warning():
    block = "fluid: [{block: {min: [-0.2, -0.2, 0], max: [0.2, 0.2, 0.4]}}]"
    scene = Scene.from_yaml(f"container: {{size: [0.4, 0.4, 0.4]}}\n{block}", "test")
    with pytest.warns(NoRoomWarning, match="more of it than fits"):
        apart = decompressed(scene.initial_particles(None), Environment.of(scene, None))
    assert np.isfinite(apart.positions).all() and (np.abs(apart.positions[:, :2]) < 0.2).all()


def test_water_at_the_rest_density_stays_where_it_is():
    scene = Scene.from_yaml("fluid: [{block: {min: [-0.2, -0.2, 0.3], max: [0.2, 0.2, 0.6]}}]", "test")
    start = scene.initial_particles(None)
    assert decompressed(start, Environment.of(scene, None)) is start


@pytest.mark.skipif(not is_built(), reason="compares with the C++ code")
def test_both_engines_push_particles_apart_alike():
    scene, environment = corner()
    weightless = replace(environment, gravity=torch.zeros(3))
    positions = torch.from_numpy(scene.initial_particles(environment.surface).positions)
    by_warp = DfsphSolver()
    by_warp.native = None
    pushed = [solver.pushed_apart(positions, weightless) for solver in (DfsphSolver(), by_warp)]
    assert (pushed[0] - positions).norm(dim=1).max() > 1e-3
    assert torch.allclose(*pushed, atol=1e-6)
