import copy
import pickle
from dataclasses import replace

import torch

from surfsup.scene import Scene
from surfsup.sdf import Sphere, Transformed
from surfsup.sph.state import Environment

SCENE = Scene.from_yaml("fluid: [{block: {min: [0, 0, 1], max: [0.1, 0.1, 1.1]}}]", "test")
ELSEWHERE = "meta"  # a device that every torch has


def turned_ball() -> Transformed:
    return Transformed(Sphere(0.3), torch.eye(3))


def test_it_can_be_copied_though_the_native_code_has_looked_at_it():
    environment = Environment.of(SCENE, turned_ball())
    assert environment.asked() is not None
    assert environment.as_arrays
    twin = pickle.loads(pickle.dumps(replace(environment, boundary_map=None)))  # a map's tables are made by a function
    assert torch.equal(twin.surface.distance(torch.ones(1, 3)), environment.surface.distance(torch.ones(1, 3)))
    assert copy.deepcopy(environment).boundary_map is not None


def test_on_another_device_the_caller_s_surface_stays_where_it_was_and_still_answers():
    surface = turned_ball()
    there = Environment.of(SCENE, surface, ELSEWHERE)
    assert {buffer.device.type for buffer in there.surface.buffers()} == {ELSEWHERE}
    assert {buffer.device.type for buffer in surface.buffers()} == {"cpu"}
    assert surface.distance(torch.tensor([[0.0, 0.0, 1.0]])).item() == torch.tensor(0.7)


def test_on_another_device_the_solid_s_map_is_made_where_the_surface_was():
    expected = Environment.of(SCENE, turned_ball()).boundary_map.tables
    tables = Environment.of(SCENE, turned_ball(), ELSEWHERE).boundary_map.tables
    assert (tables.nodes == expected.nodes).all()


def test_a_surface_that_wants_gradients_is_moved_itself():
    surface = Sphere(torch.nn.Parameter(torch.tensor(0.3)))
    assert Environment.of(SCENE, surface, ELSEWHERE).surface is surface
