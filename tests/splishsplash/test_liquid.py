import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.simulation import Simulation
from surfsup.splishsplash import solver

pytestmark = pytest.mark.skipif(not is_built(), reason="liquids need the C++ code")

try:
    solver.check_installed()
except InputError as missing:
    pytest.skip(str(missing), allow_module_level=True)


def test_honey_flows_over_a_ball_as_in_the_reference():
    """Of Weiler's viscosity and its friction in both; particle by particle within 1 mm after 60 frames."""
    scene = Scene.model_validate(
        {
            "surface": {"sphere": {"radius": 0.1}, "at": [0, 0, 0.15]},
            "fluid": [{"block": {"min": [-0.1, -0.1, 0.27], "max": [0.1, 0.1, 0.42]}}],
            "liquid": {"viscosity": 0.2},
            "frames": 60,
        }
    )
    surface = scene.build_surface()
    *_, (expected, _) = solver.simulate(scene, surface, scene.initial_particles(surface))
    *_, found = Simulation(scene).run()
    assert np.linalg.norm(found.positions - expected, axis=1).mean() < 1e-3
    assert np.linalg.norm(expected - scene.initial_particles(surface).positions, axis=1).mean() > 0.04
