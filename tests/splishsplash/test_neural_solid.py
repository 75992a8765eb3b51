"""The reference solver with a neural surface."""

import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.scene import PARTICLE_RADIUS, Scene
from surfsup.splishsplash import solver

try:
    solver.check_installed()
except InputError as missing:
    pytest.skip(str(missing), allow_module_level=True)

SCENE = """
container: {size: [0.4, 0.4, 0.5]}
surface: {siren: {file: coral, fit: 0.3}}
fluid: [{block: {min: [-0.1, -0.1, 0.22], max: [0.1, 0.1, 0.36]}}]
frames: 40
"""


def test_water_reaches_the_neural_solid_and_stays_out_of_it():
    scene = Scene.from_yaml(SCENE, "test")
    coral = scene.build_surface()
    frames = [
        torch.from_numpy(positions) for positions, _ in solver.simulate(scene, coral, scene.initial_particles(coral))
    ]
    with torch.no_grad():
        nearest = np.array([float(coral.distance(positions).min()) for positions in frames])
    assert nearest[0] > 3 * PARTICLE_RADIUS
    assert 0.5 * PARTICLE_RADIUS < nearest.min() < 2 * PARTICLE_RADIUS
