import numpy as np
import pytest
import torch

from surfsup.scene import Container, Scene
from surfsup.sdf import Box, Cylinder, Difference, Sphere, Surface, Transformed
from surfsup.sph.boundary.boundary_map import BoundaryMap, MapTables
from surfsup.sph.boundary.density import plane_fraction
from surfsup.sph.boundary.shape_functions import CELL_NODES
from surfsup.sph.environment import Environment
from surfsup.sph.kernels import KERNEL_SUPPORT

BALL = Transformed(Sphere(0.2), translation=(0.05, -0.1, 0.4))


def points_near(surface: Surface, count: int = 400, within: float = 0.05) -> torch.Tensor:
    random = torch.Generator().manual_seed(0)
    points = torch.rand(200 * count, 3, generator=random) * torch.tensor([1.0, 1.0, 1.0]) - torch.tensor([0.5, 0.5, 0])
    distance = surface.distance(points)
    return points[(distance > 0.01) & (distance < within)][:count]


def test_distance_and_normal_of_a_smooth_solid():
    points = points_near(BALL)
    distance, _, normal = BoundaryMap.of(BALL, Container()).query(points)
    true_distance, true_normal = BALL.distance_and_normal(points)
    torch.testing.assert_close(distance, true_distance, atol=2e-4, rtol=0)
    torch.testing.assert_close(normal, true_normal, atol=0.03, rtol=0)


def test_the_volume_fraction_of_a_plane_is_exact_and_exceeds_that_at_an_edge():
    ground = Transformed(Box((0.8, 0.8, 0.2)), translation=(0.0, 0.0, 0.1))
    points = torch.tensor([[0.03, 0.02, 0.23], [0.03, -0.1, 0.25], [0.39, 0.02, 0.23]])
    distance, fraction, _ = BoundaryMap.of(ground, Container()).query(points)
    torch.testing.assert_close(fraction[:2], plane_fraction(distance[:2]), atol=5e-3, rtol=0)
    assert fraction[2] < 0.9 * fraction[0]


@pytest.mark.parametrize("seed", range(3))
def test_a_rotated_map_is_the_map_of_the_rotated_solid(seed):
    axes = torch.eye(3)[torch.randperm(3, generator=torch.Generator().manual_seed(seed))]
    matrix = axes * torch.tensor([-1.0, 1.0, 1.0])
    made, points = BoundaryMap.of(BALL, Container()), points_near(BALL)
    distance, fraction, normal = made.query(points)
    rotated = made.rotated(matrix).query(points @ matrix.T)
    for ours, expected in zip(rotated, (distance, fraction, normal @ matrix.T), strict=True):
        torch.testing.assert_close(ours, expected, atol=2e-5, rtol=1e-4)
    assert made.rotated(matrix).tables is made.tables  # shared, not computed again


def test_far_from_the_solid_nothing_acts_and_nan_stays_nan():
    distance, fraction, normal = BoundaryMap.of(BALL, Container()).query(
        torch.tensor([[0.4, 0.4, 1.5], [50.0, 0.0, 0.0], [torch.nan, 0.0, 0.4]])
    )
    assert (distance[:2] > KERNEL_SUPPORT).all()
    assert not fraction[:2].any()
    assert not normal[:2].any()
    assert distance[2].isnan()


def test_a_solid_far_from_the_container_has_an_empty_map():
    made = BoundaryMap.of(Transformed(Sphere(0.1), translation=(9.0, 0.0, 0.0)), Container())
    distance, fraction, _ = made.query(torch.zeros(1, 3))
    assert distance > KERNEL_SUPPORT
    assert fraction == 0


def test_gradients_equal_finite_differences():
    made = BoundaryMap.of(BALL, Container())
    points = points_near(BALL, 4).double().requires_grad_()
    assert torch.autograd.gradcheck(made.query, points, eps=1e-7, atol=1e-4, rtol=1e-4)


def test_a_scene_has_a_map_unless_the_shape_requires_a_gradient():
    scene = Scene.from_yaml("fluid: [{block: {min: [0, 0, 0.7], max: [0.1, 0.1, 0.8]}}]", "test")
    assert Environment.of(scene, None).boundary_map is None
    ball = Sphere(0.2)
    assert Environment.of(scene, ball).boundary_map is not None
    learning = Sphere(torch.tensor(0.2, requires_grad=True))
    assert Environment.of(scene, learning).boundary_map is None


def test_the_nodes_hold_the_values_of_the_reference_s_map():
    made = MapTables.of(BALL, Container())
    cell = np.flatnonzero(made.cell_indices >= 0)[0]
    x, y, z = (cell % made.resolution[0], cell // made.resolution[0] % made.resolution[1],
               cell // (made.resolution[0] * made.resolution[1]))  # fmt: skip
    nodes = made.lower + made.cell * (np.array([x, y, z]) + CELL_NODES / 3)
    expected = BALL.distance(torch.from_numpy(nodes.astype(np.float32))).numpy()
    np.testing.assert_allclose(made.nodes[made.cell_indices[cell], 0], expected, atol=1e-5)


def test_beside_the_rim_of_a_hole_the_map_has_the_true_distance():
    plate = Difference(Box((0.8, 0.8, 0.06)), Box((0.15, 0.15, 0.3)))
    boundary = BoundaryMap.of(Transformed(plate, translation=(0, 0, 0.5)), Container())
    distance, _, normal = boundary.query(torch.tensor([[0.055, 0.0, 0.545]]))
    assert distance.item() == pytest.approx(0.025, abs=1.5e-3)
    torch.testing.assert_close(normal[0], torch.tensor([-0.8, 0.0, 0.6]), atol=0.05, rtol=0)


def test_the_mouth_of_a_cup_that_moves_has_no_lid():
    # The cut ends 1 mm above the mouth: in its middle the bound is 1 mm, the distance to the rim 8 cm.
    cup = Difference(Cylinder(0.1, 0.2), Transformed(Cylinder(0.08, 0.181), translation=(0.0, 0.0, 0.0105)))
    mouth = torch.tensor([[0.0, 0.0, 0.1]])
    assert cup.distance(mouth).item() == pytest.approx(1e-3, abs=1e-6)
    distance, fraction, _ = BoundaryMap.of_whole(cup, "cup").query(mouth)
    assert distance > KERNEL_SUPPORT
    assert fraction < 0.1  # the bound makes 0.75 of it
