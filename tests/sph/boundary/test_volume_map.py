import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import InputError
from surfsup.sdf import Box, CappedCone, Sphere, Surface, Transformed
from surfsup.sph.boundary.volume_map import VOLUME_FACTOR, each_once, extension, volume_map
from surfsup.sph.kernels import KERNEL_SUPPORT, cubic_spline

CELL = np.full(3, 0.025)
LOWER, UPPER = np.full(3, -0.2), np.full(3, 0.2)


def node_positions(made) -> np.ndarray:
    """Where the nodes are, from the cells that have them, as Discregrid numbers both."""
    x = made.kept % made.resolution[0]
    y = made.kept // made.resolution[0] % made.resolution[1]
    z = made.kept // (made.resolution[0] * made.resolution[1])
    corners = made.lower + made.cell * np.stack([x, y, z], axis=1)
    third = made.cell / 3
    steps = [(i, j, k) for k in (0, 3) for j in (0, 3) for i in (0, 3)]
    steps += [(i, j, k) for j in (0, 3) for k in (0, 3) for i in (1, 2)]
    steps += [(i, j, k) for k in (0, 3) for i in (0, 3) for j in (1, 2)]
    steps += [(i, j, k) for i in (0, 3) for j in (0, 3) for k in (1, 2)]
    positions = np.full((len(made.distances), 3), np.nan)
    positions[made.nodes] = corners[:, None] + third * np.array(steps)
    return positions


def integral(surface: Surface, point: np.ndarray) -> float:
    """The volume around ``point`` by brute force: the midpoint rule on 60³ cells."""
    side = (np.arange(60) + 0.5) / 30 - 1
    ball = KERNEL_SUPPORT * np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    ball = ball[np.square(ball).sum(axis=1) < KERNEL_SUPPORT**2]
    share = extension(surface.distance(torch.from_numpy(point + ball)).numpy())
    return VOLUME_FACTOR * share.sum() * (KERNEL_SUPPORT / 30) ** 3


SOLIDS = {
    "ball": Sphere(0.12),
    "turned box": Transformed(
        Box((0.2, 0.15, 0.1)), torch.linalg.qr(torch.randn(3, 3, generator=torch.manual_seed(0)))[0]
    ),
    "sharp cone": CappedCone(0.2, 0.1, 0.01),
    "thin plate": Box((0.3, 0.3, 0.03)),
}


def test_the_extension_is_one_inside_and_the_kernel_outside():
    distances = np.linspace(-0.05, 0.08, 200)
    expected = cubic_spline(distances.clip(min=0) / KERNEL_SUPPORT)
    np.testing.assert_allclose(extension(distances), expected, atol=1e-14)


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS)
def test_nodes_know_the_exact_distance(solid):
    made = volume_map(solid, LOWER, UPPER, CELL)
    exact = solid.distance(torch.from_numpy(node_positions(made))).numpy()
    np.testing.assert_allclose(made.distances, exact, atol=1e-6)


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS)
def test_volumes_are_the_integral_over_the_support(solid):
    made = volume_map(solid, LOWER, UPPER, CELL)
    positions = node_positions(made)
    boundary_map = np.flatnonzero((made.distances > 0) & (made.distances < KERNEL_SUPPORT))
    whole = 4 / 3 * np.pi * KERNEL_SUPPORT**3
    for node in np.random.default_rng(0).choice(boundary_map, 12, replace=False):
        assert made.volumes[node] == pytest.approx(integral(solid, positions[node]), abs=0.004 * whole)


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS)
def test_wherever_the_solver_feels_the_solid_there_is_a_cell(solid):
    made = volume_map(solid, LOWER, UPPER, CELL)
    points = np.random.default_rng(1).uniform(-0.2, 0.2, (20_000, 3))
    distance = solid.distance(torch.from_numpy(points)).numpy()
    cells = np.floor((points - made.lower) / made.cell).astype(int) @ [
        1, made.resolution[0], made.resolution[0] * made.resolution[1]
    ]  # fmt: skip
    near = np.abs(distance) < KERNEL_SUPPORT
    assert near.any()
    assert np.isin(cells[near], made.kept).all()
    assert len(made.kept) < made.resolution.prod()


def test_deep_inside_a_solid_the_whole_ball_counts():
    made = volume_map(Box((0.35, 0.35, 0.35)), LOWER, UPPER, CELL)
    deep = made.distances < -KERNEL_SUPPORT
    whole = VOLUME_FACTOR * 4 / 3 * np.pi * KERNEL_SUPPORT**3
    np.testing.assert_allclose(made.volumes[deep], whole, rtol=1e-2)


def test_volumes_are_right_of_a_solid_that_fills_half_of_the_map_too():
    """A large mean is what single precision could be wrong by, and then everywhere."""
    ground = Transformed(Box((4.0, 4.0, 2.0)), translation=(0.0, 0.0, -1.0))
    made = volume_map(ground, LOWER, UPPER, CELL)
    positions = node_positions(made)
    whole = 4 / 3 * np.pi * KERNEL_SUPPORT**3
    for height in (0.025, 0.05, 0.075):
        node = np.flatnonzero(np.isclose(positions[:, 2], height))[0]
        assert made.volumes[node] == pytest.approx(integral(ground, positions[node]), abs=0.002 * whole)


def test_cells_may_have_sides_of_different_lengths():
    cell = np.array([0.025, 0.03, 0.02])
    made = volume_map(SOLIDS["ball"], LOWER, UPPER, cell)
    positions = node_positions(made)
    exact = SOLIDS["ball"].distance(torch.from_numpy(positions)).numpy()
    np.testing.assert_allclose(made.distances, exact, atol=1e-6)
    node = np.flatnonzero((made.distances > 0.02) & (made.distances < 0.03))[0]
    whole = 4 / 3 * np.pi * KERNEL_SUPPORT**3
    assert made.volumes[node] == pytest.approx(integral(SOLIDS["ball"], positions[node]), abs=0.004 * whole)


def test_a_box_of_no_whole_cells_is_widened_upward():
    made = volume_map(Sphere(0.1), np.full(3, -0.21), np.array([0.2, 0.21, 0.22]), np.full(3, 0.05))
    np.testing.assert_array_equal(made.resolution, [9, 9, 9])
    np.testing.assert_allclose(made.lower, -0.21)


def test_a_solid_far_from_the_container_is_refused():
    with pytest.raises(InputError, match="no point near the container"):
        volume_map(Transformed(Sphere(0.1), translation=(3.0, 0.0, 0.0)), LOWER, UPPER, CELL)


@given(st.lists(st.integers(0, 30), min_size=1, max_size=60))
def test_numbers_each_once_are_what_sorting_them_tells(numbers):
    there, where = each_once(np.array(numbers), 31)
    expected = np.unique(numbers, return_inverse=True)
    np.testing.assert_array_equal(there, expected[0])
    np.testing.assert_array_equal(where, expected[1])
