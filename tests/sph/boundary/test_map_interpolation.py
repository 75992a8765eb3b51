import numpy as np
import pytest
import torch

from surfsup.scene import Container, Scene
from surfsup.sdf import Box, Sphere, Surface, Transformed
from surfsup.sph.boundary.density import flat_share
from surfsup.sph.boundary.map_interpolation import SolidMap, Tables
from surfsup.sph.boundary.shape_functions import NODES_OF_CELL
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.state import Environment

BALL = Transformed(Sphere(0.2), translation=(0.05, -0.1, 0.4))


def points_near(surface: Surface, count: int = 400, within: float = 0.05) -> torch.Tensor:
    random = torch.Generator().manual_seed(0)
    places = torch.rand(200 * count, 3, generator=random) * torch.tensor([1.0, 1.0, 1.0]) - torch.tensor([0.5, 0.5, 0])
    distance = surface.distance(places)
    return places[(distance > 0.01) & (distance < within)][:count]


def test_it_knows_the_distance_and_the_normal_of_a_smooth_solid():
    places = points_near(BALL)
    distance, _, normal = SolidMap.of(BALL, Container()).look(places)
    true_distance, true_normal = BALL.distance_and_normal(places)
    torch.testing.assert_close(distance, true_distance, atol=2e-4, rtol=0)
    torch.testing.assert_close(normal, true_normal, atol=0.03, rtol=0)


def test_the_share_of_a_flat_solid_is_that_of_a_flat_solid_and_more_than_at_an_edge():
    ground = Transformed(Box((0.8, 0.8, 0.2)), translation=(0.0, 0.0, 0.1))
    places = torch.tensor([[0.03, 0.02, 0.23], [0.03, -0.1, 0.25], [0.39, 0.02, 0.23]])
    distance, share, _ = SolidMap.of(ground, Container()).look(places)
    torch.testing.assert_close(share[:2], flat_share(distance[:2]), atol=5e-3, rtol=0)
    assert share[2] < 0.9 * share[0]


@pytest.mark.parametrize("seed", range(3))
def test_turned_it_is_the_turned_solid_s(seed):
    axes = torch.eye(3)[torch.randperm(3, generator=torch.Generator().manual_seed(seed))]
    matrix = axes * torch.tensor([-1.0, 1.0, 1.0])
    made, places = SolidMap.of(BALL, Container()), points_near(BALL)
    distance, share, normal = made.look(places)
    turned = made.turned(matrix).look(places @ matrix.T)
    for ours, expected in zip(turned, (distance, share, normal @ matrix.T), strict=True):
        torch.testing.assert_close(ours, expected, atol=2e-5, rtol=1e-4)
    assert made.turned(matrix).tables is made.tables  # they are not made again


def test_far_from_the_solid_nothing_is_felt_and_what_is_no_number_stays_none():
    distance, share, normal = SolidMap.of(BALL, Container()).look(
        torch.tensor([[0.4, 0.4, 1.5], [50.0, 0.0, 0.0], [torch.nan, 0.0, 0.4]])
    )
    assert (distance[:2] > KERNEL_SUPPORT).all()
    assert not share[:2].any()
    assert not normal[:2].any()
    assert distance[2].isnan()


def test_of_a_solid_out_of_reach_there_is_a_map_of_nothing():
    made = SolidMap.of(Transformed(Sphere(0.1), translation=(9.0, 0.0, 0.0)), Container())
    distance, share, _ = made.look(torch.zeros(1, 3))
    assert distance > KERNEL_SUPPORT
    assert share == 0


def test_it_has_gradients_in_the_places():
    made = SolidMap.of(BALL, Container())
    places = points_near(BALL, 4).double().requires_grad_()
    assert torch.autograd.gradcheck(made.look, places, eps=1e-7, atol=1e-4, rtol=1e-4)


def test_a_scene_s_solid_has_one_unless_its_shape_wants_a_gradient():
    scene = Scene.from_yaml("fluid: [{block: {min: [0, 0, 0.7], max: [0.1, 0.1, 0.8]}}]", "test")
    assert Environment.of(scene, None).boundary_map is None
    ball = Sphere(0.2)
    assert Environment.of(scene, ball).boundary_map is not None
    wanted = Sphere(torch.tensor(0.2, requires_grad=True))
    assert Environment.of(scene, wanted).boundary_map is None


def test_tables_are_those_that_the_solver_is_given():
    made = Tables.of(BALL, Container())
    cell = np.flatnonzero(made.places >= 0)[0]
    x, y, z = (cell % made.resolution[0], cell // made.resolution[0] % made.resolution[1],
               cell // (made.resolution[0] * made.resolution[1]))  # fmt: skip
    nodes = made.lower + made.cell * (np.array([x, y, z]) + NODES_OF_CELL / 3)
    expected = BALL.distance(torch.from_numpy(nodes.astype(np.float32))).numpy()
    np.testing.assert_allclose(made.nodes[made.places[cell], 0], expected, atol=1e-5)
