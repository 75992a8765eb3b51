import copy
import pickle
from dataclasses import replace

import pytest
import torch

from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.sdf import Sphere, Transformed
from surfsup.sph.environment import Environment
from surfsup.sph.native_query import native_query

SCENE = Scene.from_yaml("fluid: [{block: {min: [0, 0, 1], max: [0.1, 0.1, 1.1]}}]", "test")
OTHER_DEVICE = "meta"  # a device that every torch has


def ball() -> Transformed:
    return Transformed(Sphere(0.3), torch.eye(3))


@pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")
def test_it_can_be_copied_and_pickled_after_cpp_code_has_queried_it():
    environment = Environment.of(SCENE, ball())
    assert native_query(environment) is not None
    # The tables of a map are made by a local function, which cannot be pickled.
    twin = pickle.loads(pickle.dumps(replace(environment, boundary_map=None)))
    assert torch.equal(twin.surface.distance(torch.ones(1, 3)), environment.surface.distance(torch.ones(1, 3)))
    assert copy.deepcopy(environment).boundary_map is not None


def test_on_another_device_the_caller_s_surface_stays_where_it_was():
    surface = ball()
    moved = Environment.of(SCENE, surface, OTHER_DEVICE)
    assert {buffer.device.type for buffer in moved.surface.buffers()} == {OTHER_DEVICE}
    assert {buffer.device.type for buffer in surface.buffers()} == {"cpu"}
    assert surface.distance(torch.tensor([[0.0, 0.0, 1.0]])).item() == torch.tensor(0.7)


def test_on_another_device_the_boundary_map_is_computed_where_the_surface_was():
    expected = Environment.of(SCENE, ball()).boundary_map.tables
    tables = Environment.of(SCENE, ball(), OTHER_DEVICE).boundary_map.tables
    assert (tables.nodes == expected.nodes).all()


def test_a_surface_with_gradients_is_moved_itself():
    surface = Sphere(torch.nn.Parameter(torch.tensor(0.3)))
    assert Environment.of(SCENE, surface, OTHER_DEVICE).surface is surface


def test_without_a_solid_the_distance_is_infinite_and_the_normal_zero():
    distance, normal = Environment.of(SCENE, None).distance_and_normal(torch.zeros(2, 3))
    assert distance.isinf().all()
    assert not normal.any()
