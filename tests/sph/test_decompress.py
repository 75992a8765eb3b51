"""Water denser than at rest is moved apart; other water is left alone."""

import numpy as np
import torch

from surfsup.scene import Scene
from surfsup.sph.decompress import decompressed, density_and_gradient
from surfsup.sph.environment import Environment
from surfsup.sph.kernel_sums import kernel_graph
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import find_neighbors

CORNER = """
container: {size: [0.6, 0.6, 1]}
surface: {sphere: {radius: 0.08}, at: [-0.12, -0.12, 0.1]}
fluid: [{block: {min: [-0.3, -0.3, 0], max: [0, 0, 0.3]}}]
"""


def densities(positions: np.ndarray, environment: Environment) -> torch.Tensor:
    """Density (N,) of particles at ``positions``."""
    points = torch.from_numpy(positions)
    return density_and_gradient(points, kernel_graph(points, find_neighbors(points, KERNEL_SUPPORT)), environment)[0]


def test_no_particle_is_denser_than_at_rest_afterwards_or_in_a_solid():
    scene = Scene.from_yaml(CORNER, "test")
    surface = scene.build_surface()
    environment = Environment.of(scene, surface)
    start = scene.initial_particles(surface)
    apart = decompressed(start, environment)
    assert densities(start.positions, environment).max() > 1.5
    assert densities(apart.positions, environment).max() < 1.01
    assert [len(block) for block in apart.block_positions] == [len(block) for block in start.block_positions]
    assert environment.distance_and_normal(torch.from_numpy(apart.positions))[0].min() > 0
    assert (apart.positions > scene.container.lower).all()


def test_water_at_the_rest_density_stays_where_it_is():
    scene = Scene.from_yaml("fluid: [{block: {min: [-0.2, -0.2, 0.3], max: [0.2, 0.2, 0.6]}}]", "test")
    start = scene.initial_particles(None)
    assert np.array_equal(decompressed(start, Environment.of(scene, None)).positions, start.positions)


def test_the_gradient_of_the_density_is_that_of_central_differences():
    environment = Environment.of(Scene.from_yaml(CORNER, "test"), None)
    pair = torch.tensor([[0.0, 0.1, 0.5], [0.02, 0.11, 0.485]], dtype=torch.float64)  # far from walls

    def density(points):
        graph = kernel_graph(points, find_neighbors(points, KERNEL_SUPPORT))
        return density_and_gradient(points, graph, environment)

    def moved(step):
        return density(pair + torch.stack([step, torch.zeros(3)]))[0][0]

    steps = 1e-6 * torch.eye(3, dtype=torch.float64)
    differences = torch.stack([(moved(step) - moved(-step)) / 2e-6 for step in steps])
    assert torch.allclose(density(pair)[1][0], differences, rtol=1e-4)
