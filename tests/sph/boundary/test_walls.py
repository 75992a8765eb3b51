import numpy as np
import pytest
import torch

from surfsup.scene import Container, Scene
from surfsup.sph.boundary.density import flat_share, solid_density
from surfsup.sph.boundary.scene_boundaries import wall_map
from surfsup.sph.boundary.shape_functions import shape_functions
from surfsup.sph.boundary.volume_map import VolumeMap
from surfsup.sph.boundary.walls import cell_sizes, walls_density
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.state import Environment


def around(size: tuple[float, float, float] = (1.0, 1.0, 2.0)) -> Environment:
    lower = torch.tensor([-size[0] / 2, -size[1] / 2, 0.0], dtype=torch.float64)
    return Environment(None, lower, lower + torch.tensor(size, dtype=torch.float64), torch.zeros(3).double())


def interpolated(made: VolumeMap, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance (N,), volume (N,) and normal (N, 3) as the solver looks them up."""
    cell = np.floor((points - made.lower) / made.cell).astype(int)
    number = cell @ [1, made.resolution[0], made.resolution[0] * made.resolution[1]]
    nodes = made.cell_nodes[np.searchsorted(made.cells, number)]
    order = np.argsort(made.cells)
    assert np.array_equal(made.cells[order], made.cells)
    at = 2 * ((points - made.lower) / made.cell - cell) - 1

    values, slopes = (part.numpy() for part in shape_functions(torch.from_numpy(at)))
    distance, volume = ((values * field[nodes]).sum(axis=1) for field in (made.distances, made.volumes))
    normal = (slopes * made.distances[nodes][:, None]).sum(axis=2) / made.cell
    return distance, volume, normal / np.linalg.norm(normal, axis=1, keepdims=True)


@pytest.mark.parametrize(("size", "close"), [((1.0, 1.0, 2.0), 0.05), ((1.23, 1.48, 0.97), 0.1)])
@pytest.mark.parametrize("corner", [(1, 1, 1), (-1, 1, 1), (-1, -1, -1)])
def test_it_is_what_the_solver_makes_of_its_map_in_corners_too(size, close, corner):
    """The more so the more its cells are cubes."""
    place = around(size)
    from_corner = torch.rand(400, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) * 0.025 + 0.022
    from_corner[:100, 0] += 0.3  # along one edge
    from_corner[100:200, 1:] += 0.3  # at one wall
    sides = torch.tensor(corner, dtype=torch.float64)
    points = torch.where(sides > 0, place.lower + from_corner, place.upper - from_corner)
    distance, volume, normal = interpolated(wall_map(Container(size=size)), points.numpy())
    share = torch.from_numpy(volume / (0.8 * 4 / 3 * np.pi * KERNEL_SUPPORT**3))
    density, rise = solid_density(torch.from_numpy(distance), share)
    ours, slope = walls_density(points, place)
    torch.testing.assert_close(ours, density, atol=0.015, rtol=close)
    torch.testing.assert_close(
        slope, (rise / KERNEL_SUPPORT)[:, None] * -torch.from_numpy(normal), atol=1.0, rtol=2 * close
    )


def test_at_one_wall_they_are_a_flat_solid():
    place = around()
    points = torch.tensor([[0.0, 0.0, height] for height in (0.02, 0.03, 0.045)], dtype=torch.float64)
    density, slope = walls_density(points, place)
    expected, rise = solid_density(points[:, 2], flat_share(points[:, 2]))
    torch.testing.assert_close(density, expected)
    torch.testing.assert_close(slope[:, 2], -rise / KERNEL_SUPPORT)
    assert not slope[:, :2].any()


def test_an_edge_pushes_along_its_middle_and_more_than_either_wall():
    place = around()
    inward = torch.tensor([[0.03, 0.03, 1.0], [0.03, 0.5, 1.0]], dtype=torch.float64)
    density, slope = walls_density(place.lower + inward, place)
    assert density[0] > 1.5 * density[1]
    assert slope[0, 0] == pytest.approx(slope[0, 1].item())
    assert slope[0, 0] < slope[1, 0] / 2**0.5 < 0


@pytest.mark.parametrize("size", [(1.0, 1.0, 2.0), (1.23, 1.48, 0.97), (0.04, 0.06, 0.08)])
def test_cells_are_the_map_s(size):
    ours = cell_sizes(around(size))
    made = wall_map(Container(size=size))
    np.testing.assert_allclose(ours.numpy(), made.cell)
    within = torch.tensor(size, dtype=torch.float64) / ours
    torch.testing.assert_close(within, within.round())


def test_away_from_all_walls_there_is_nothing_and_no_gradient_breaks():
    place = around()
    points = torch.tensor([[0.0, 0.0, 1.0], [0.4, 0.0, 0.07]], dtype=torch.float64, requires_grad=True)
    density, slope = walls_density(points, place)
    assert not density.any()
    assert not slope.any()
    (density.sum() + slope.sum()).backward()
    assert not points.grad.any()


def test_it_has_gradients_in_the_places():
    place = around()
    inward = torch.tensor([[0.0303, 0.0271, 0.0317], [0.0303, 0.0271, 0.5], [0.0333, 0.4, 0.5]], dtype=torch.float64)
    points = (place.lower + inward).requires_grad_()
    assert torch.autograd.gradcheck(lambda at: walls_density(at, place), points, eps=1e-7, atol=1e-3, rtol=1e-3)


def test_beyond_a_wall_they_are_still_felt():
    place = Environment.of(Scene.from_yaml("fluid: [{block: {min: [0, 0, 0.5], max: [0.1, 0.1, 0.6]}}]", "test"), None)
    density, slope = walls_density(torch.tensor([[0.0, 0.0, -0.01]]), place)
    assert density > 1.5
    assert slope[0, 2] < 0


def test_what_is_no_number_stays_none():
    density, _ = walls_density(torch.tensor([[torch.nan, 0.0, 0.5], [0.0, 0.0, 0.5]]).double(), around())
    assert density.isnan().tolist() == [True, False]
