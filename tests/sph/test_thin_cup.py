"""A cup with a wall of a millimeter is carried about and loses nothing."""

import numpy as np
import pytest

import surfsup as sf
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene


@pytest.mark.skipif(not is_built(), reason="moving solids run in the C++ code")
@pytest.mark.parametrize("wall", [0.015, 0.001])
def test_no_particle_passes_the_wall_of_a_cup_that_is_carried_about(wall):
    simulation = sf.Simulation(
        Scene.from_yaml(
            "container: none\nsurfaces:\n  cup:\n    difference:\n"
            f"      - {{cylinder: {{radius: {0.15 + wall}, height: 0.6}}, at: [0, 0, 0.3]}}\n"
            f"      - {{cylinder: {{radius: 0.15, height: 1.6}}, at: [0, 0, {0.8 + wall}]}}\n"
            "    motion: {keyframes: [{time: 0}, {time: 0.4, position: [0.3, 0, 0.1]},"
            " {time: 0.8, position: [0, 0.3, 0], rotation: {axis: [1, 0, 0], degrees: 15}}]}\n"
            "fluid: [{fill: {below: 0.25, seed: [0, 0, 0.1]}}]",
            "test",
        )
    )
    for _ in range(200):
        frame = simulation.step()
        own = frame.poses["cup"].to_own(frame.positions)
        assert np.hypot(own[:, 0], own[:, 1]).max() < 0.15 and own[:, 2].min() > wall
        assert own[:, 2].max() < 0.6


@pytest.mark.parametrize("beyond", [0.0, 0.01])
def test_water_falls_into_a_cup_whose_cut_ends_at_its_mouth_or_just_above(beyond):
    scene = Scene.from_yaml(
        "surface:\n  difference:\n"
        "    - {cylinder: {radius: 0.13, height: 0.2}, at: [0, 0, 0.1]}\n"
        f"    - {{cylinder: {{radius: 0.1, height: {0.17 + beyond}}}, at: [0, 0, {0.115 + beyond / 2}]}}\n"
        "fluid: [{block: {min: [-0.06, -0.06, 0.3], max: [0.06, 0.06, 0.42]}}]",
        "test",
    )
    simulation = sf.Simulation(scene, device="cpu")
    for _ in range(100):
        frame = simulation.step()
    x, y, z = frame.positions.T  # a few splash above the mouth
    assert ((np.hypot(x, y) < 0.1) & (z < 0.2)).sum() > 20
    assert len(x) == 27 and (z > 0.03).all()
