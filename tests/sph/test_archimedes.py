"""Water at rest: its weight, also where it is deep, and the buoyancy of a ball that the water touches."""

import numpy as np
import pytest

import surfsup as sf
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.sph.impulses import PARTICLE_VOLUME

pytestmark = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")


def test_a_held_ball_is_pushed_up_by_the_weight_of_the_water_in_its_place():
    simulation = sf.Simulation(
        Scene.from_yaml(
            "container: {size: [0.5, 0.5, 0.7]}\nforces: all\n"
            "surfaces: {ball: {sphere: {radius: 0.085}, at: [0, 0, 0.18], flush: true}}\n"
            "fluid: [{block: {min: [-0.23, -0.23, 0.02], max: [0.23, 0.23, 0.38]}}]",
            "test",
        )
    )
    for _ in range(200):
        simulation.step()
    frames = [simulation.step() for _ in range(150)]
    ball, walls = (np.mean([frame.forces[name].force for frame in frames], axis=0) for name in ("ball", "container"))
    weight = len(simulation.particles.positions) * 1000 * PARTICLE_VOLUME * 9.81
    assert ball[2] == pytest.approx(1000 * 9.81 * 4 / 3 * np.pi * 0.085**3, rel=0.05)
    assert np.abs(ball[:2]).max() < 0.1 * ball[2]
    assert -(ball + walls)[2] == pytest.approx(weight, rel=2e-3)


def test_deep_water_comes_to_rest_and_its_floor_bears_its_weight():
    simulation = sf.Simulation(
        Scene.from_yaml(
            "container: {size: [0.3, 0.3, 1.2]}\nforces: all\n"
            "fluid: [{block: {min: [-0.14, -0.14, 0.01], max: [0.14, 0.14, 0.85]}}]",
            "27 layers",
        )
    )
    start = simulation.frame
    for _ in range(200):
        simulation.step()
    frames = [simulation.step() for _ in range(50)]
    weight = len(start.positions) * 1000 * PARTICLE_VOLUME * 9.81
    assert -np.mean([frame.forces["container"].force[2] for frame in frames]) == pytest.approx(weight, rel=0.05)
    # A collapsed column would be at half its height.
    assert frames[-1].positions[:, 2].mean() > 0.85 * start.positions[:, 2].mean()
    assert np.linalg.norm(frames[-1].velocities, axis=1).mean() < 0.1
