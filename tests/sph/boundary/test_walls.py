import numpy as np
import pytest
import torch

from surfsup.scene import Container
from surfsup.sph.boundary.density import plane_fraction, solid_density
from surfsup.sph.boundary.scene_boundaries import wall_map
from surfsup.sph.boundary.shape_functions import shape_functions
from surfsup.sph.boundary.volume_map import VolumeMap
from surfsup.sph.boundary.walls import wall_cells, walls_density
from surfsup.sph.kernels import KERNEL_SUPPORT


def corners(size: tuple[float, float, float] = (1.0, 1.0, 2.0)) -> tuple[torch.Tensor, torch.Tensor]:
    """Lower and upper corner of a container."""
    lower = torch.tensor([-size[0] / 2, -size[1] / 2, 0.0], dtype=torch.float64)
    return lower, lower + torch.tensor(size, dtype=torch.float64)


def interpolated(volume_map: VolumeMap, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance (N,), volume (N,) and normal (N, 3) as the reference interpolates them."""
    cell = np.floor((points - volume_map.lower) / volume_map.cell).astype(int)
    number = cell @ [1, volume_map.resolution[0], volume_map.resolution[0] * volume_map.resolution[1]]
    nodes = volume_map.cell_nodes[np.searchsorted(volume_map.cells, number)]
    order = np.argsort(volume_map.cells)
    assert np.array_equal(volume_map.cells[order], volume_map.cells)
    at = 2 * ((points - volume_map.lower) / volume_map.cell - cell) - 1

    values, slopes = (part.numpy() for part in shape_functions(torch.from_numpy(at)))
    distance, volume = ((values * field[nodes]).sum(axis=1) for field in (volume_map.distances, volume_map.volumes))
    normal = (slopes * volume_map.distances[nodes][:, None]).sum(axis=2) / volume_map.cell
    return distance, volume, normal / np.linalg.norm(normal, axis=1, keepdims=True)


@pytest.mark.parametrize(("size", "close"), [((1.0, 1.0, 2.0), 0.05), ((1.23, 1.48, 0.97), 0.1)])
@pytest.mark.parametrize("corner", [(1, 1, 1), (-1, 1, 1), (-1, -1, -1)])
def test_density_and_gradient_equal_those_of_the_reference_s_map_even_in_corners(size, close, corner):
    """The agreement is closest for cubic cells."""
    lower, upper = corners(size)
    from_corner = torch.rand(400, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) * 0.025 + 0.022
    from_corner[:100, 0] += 0.3  # along one edge
    from_corner[100:200, 1:] += 0.3  # at one wall
    sides = torch.tensor(corner, dtype=torch.float64)
    points = torch.where(sides > 0, lower + from_corner, upper - from_corner)
    distance, volume, normal = interpolated(wall_map(Container(size=size)), points.numpy())
    fraction = torch.from_numpy(volume / (0.8 * 4 / 3 * np.pi * KERNEL_SUPPORT**3))
    density, slope_per_support = solid_density(torch.from_numpy(distance), fraction)
    ours, slope = walls_density(points, lower, upper)
    torch.testing.assert_close(ours, density, atol=0.015, rtol=close)
    torch.testing.assert_close(
        slope, (slope_per_support / KERNEL_SUPPORT)[:, None] * -torch.from_numpy(normal), atol=1.0, rtol=2 * close
    )


def test_a_single_wall_is_a_plane_solid():
    lower, upper = corners()
    points = torch.tensor([[0.0, 0.0, height] for height in (0.02, 0.03, 0.045)], dtype=torch.float64)
    density, slope = walls_density(points, lower, upper)
    expected, slope_per_support = solid_density(points[:, 2], plane_fraction(points[:, 2]))
    torch.testing.assert_close(density, expected)
    torch.testing.assert_close(slope[:, 2], -slope_per_support / KERNEL_SUPPORT)
    assert not slope[:, :2].any()


def test_an_edge_acts_along_its_bisector_and_more_than_either_wall():
    lower, upper = corners()
    inward = torch.tensor([[0.03, 0.03, 1.0], [0.03, 0.5, 1.0]], dtype=torch.float64)
    density, slope = walls_density(lower + inward, lower, upper)
    assert density[0] > 1.5 * density[1]
    assert slope[0, 0] == pytest.approx(slope[0, 1].item())
    assert slope[0, 0] < slope[1, 0] / 2**0.5 < 0


@pytest.mark.parametrize("size", [(1.0, 1.0, 2.0), (1.23, 1.48, 0.97), (0.04, 0.06, 0.08)])
def test_cells_are_those_of_the_reference_s_map(size):
    ours = wall_cells(*corners(size))
    volume_map = wall_map(Container(size=size))
    np.testing.assert_allclose(ours.numpy(), volume_map.cell)
    within = torch.tensor(size, dtype=torch.float64) / ours
    torch.testing.assert_close(within, within.round())


def test_away_from_all_walls_density_is_zero_and_gradients_are_finite():
    lower, upper = corners()
    points = torch.tensor([[0.0, 0.0, 1.0], [0.4, 0.0, 0.07]], dtype=torch.float64, requires_grad=True)
    density, slope = walls_density(points, lower, upper)
    assert not density.any()
    assert not slope.any()
    (density.sum() + slope.sum()).backward()
    assert not points.grad.any()


def test_gradients_equal_finite_differences():
    lower, upper = corners()
    inward = torch.tensor([[0.0303, 0.0271, 0.0317], [0.0303, 0.0271, 0.5], [0.0333, 0.4, 0.5]], dtype=torch.float64)
    points = (lower + inward).requires_grad_()
    assert torch.autograd.gradcheck(lambda at: walls_density(at, lower, upper), points, eps=1e-7, atol=1e-3, rtol=1e-3)


def test_beyond_a_wall_it_still_acts():
    density, slope = walls_density(torch.tensor([[0.0, 0.0, -0.01]]).double(), *corners())
    assert density > 1.5
    assert slope[0, 2] < 0


def test_nan_stays_nan():
    density, _ = walls_density(torch.tensor([[torch.nan, 0.0, 0.5], [0.0, 0.0, 0.5]]).double(), *corners())
    assert density.isnan().tolist() == [True, False]
