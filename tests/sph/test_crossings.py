"""Crossings are counted from the frames alone, whatever the simulator and collision handling do."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import torch

import surfsup as sf
from surfsup.scene import Scene
from surfsup.scene.pose import Pose
from surfsup.sdf import Box, Sphere, Transformed
from surfsup.sph import crossings
from surfsup.sph.crossings import CrossingCounter, trace
from surfsup.sph.environment import Environment
from surfsup.sph.state import ParticleState

PLATE = Box((1.0, 1.0, 0.005))


def ways(*pairs):
    return (np.array([pair[end] for pair in pairs], np.float32) for end in (0, 1))


def test_a_way_crosses_if_it_leads_through_a_solid_and_ends_outside():
    through, beside, back, into = (
        ((0, 0, 0.04), (0, 0, -0.04)),
        ((0.6, 0, 0.04), (0.6, 0, -0.04)),
        ((0, 0, 0.04), (0.2, 0, 0.04)),
        ((0, 0, 0.04), (0, 0, 0)),
    )
    assert trace(PLATE, *ways(through, beside, back, into)) == 1
    assert trace(Box((1.0, 1.0, 0.0002)), *ways(through, beside, back)) == 1
    assert trace(Sphere(0.1), *ways(((-1, 0.09, 0), (1, 0.09, 0)), ((-1, 0.11, 0), (1, 0.11, 0)))) == 1


SCENE = sf.Scene(
    surface=Transformed(PLATE, None, (0, 0, 0.2)),
    fluid=[sf.Block((-0.1, -0.1, 0.3), (0.1, 0.1, 0.4), velocity=(0, 0, -14))],
)


def test_a_simulator_that_knows_no_solid_is_found_out():
    environment = Environment.of(SCENE, SCENE.build_surface())
    heights, counter = (0.4, 0.33, 0.26, 0.19, 0.12), CrossingCounter(True)
    x = torch.linspace(-0.8, 0.8, 17)  # 11 of them above the plate

    def state(height):
        return ParticleState(torch.stack([x, 0 * x, 0 * x + height], dim=1), torch.zeros(17, 3))

    counts = [counter.count(state(old), state(new), environment) for old, new in pairwise(heights)]
    assert counts == [0, 0, 11, 0]
    counts = [CrossingCounter(False).count(state(0.21), state(height), environment) for height in (0.205, 0.19)]
    assert counts == [0, 11]


def test_collision_handling_lets_nothing_pass_and_reset_restores_the_number():
    simulation = sf.Simulation(SCENE, device="cpu")
    start = replace(simulation.state, crossings=2)
    simulation.reset(start)
    for _ in range(8):
        simulation.step()
    assert simulation.state.crossings == 2
    simulation.reset()
    assert simulation.state.crossings == 0


def test_the_motion_of_a_solid_is_part_of_the_way():
    """A plate that is moved over resting particles by a jump that no one cuts into parts."""
    moving = Scene.from_yaml(
        "surfaces: {plate: {box: {size: [1, 1, 0.005]}, at: [0, 0, 0.5], motion: {spin: {turns: 0.001}}}}\n"
        "fluid: [{block: {min: [0, 0, 1], max: [0.1, 0.1, 1.1]}}]",
        "test",
    )
    environment = Environment.of(moving, None)
    poses = [{"plate": Pose.of((0, 0, height))} for height in (0.5, 0.3)]
    environment = environment.moved(environment.moving.between(*poses))
    at = ParticleState(torch.tensor([[0, 0, 0.4], [0, 0, 0.2], [0.9, 0, 0.4]]), torch.zeros(3, 3))
    assert CrossingCounter(True).count(at, at, environment) == 1


def test_a_quiet_scene_costs_no_query(monkeypatch):
    queried = []
    real = crossings.distances
    monkeypatch.setattr(crossings, "distances", lambda *of: queried.append(of) or real(*of))
    water = sf.Block((-0.1, -0.1, 0.2), (0.1, 0.1, 0.3))
    simulation = sf.Simulation(sf.Scene(surface=sf.Sphere(0.1), fluid=[water]), device="cpu")
    for _ in range(20):
        simulation.step()
    assert not queried
