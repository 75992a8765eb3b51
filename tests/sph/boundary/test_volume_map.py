import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import InputError
from surfsup.sdf import Box, CappedCone, Sphere, Surface, Transformed
from surfsup.sph.boundary.density import VOLUME_FACTOR
from surfsup.sph.boundary.volume_map import build_volume_map, extension, unique_with_inverse
from surfsup.sph.kernels import KERNEL_SUPPORT, cubic_spline

CELL = np.full(3, 0.025)
LOWER, UPPER = np.full(3, -0.2), np.full(3, 0.2)


def node_positions(volume_map) -> np.ndarray:
    """Positions (K, 3) of the nodes, from the cells that have nodes, in Discregrid's numbering."""
    x = volume_map.cells % volume_map.resolution[0]
    y = volume_map.cells // volume_map.resolution[0] % volume_map.resolution[1]
    z = volume_map.cells // (volume_map.resolution[0] * volume_map.resolution[1])
    corners = volume_map.lower + volume_map.cell * np.stack([x, y, z], axis=1)
    third = volume_map.cell / 3
    steps = [(i, j, k) for k in (0, 3) for j in (0, 3) for i in (0, 3)]
    steps += [(i, j, k) for j in (0, 3) for k in (0, 3) for i in (1, 2)]
    steps += [(i, j, k) for k in (0, 3) for i in (0, 3) for j in (1, 2)]
    steps += [(i, j, k) for i in (0, 3) for j in (0, 3) for k in (1, 2)]
    positions = np.full((len(volume_map.distances), 3), np.nan)
    positions[volume_map.cell_nodes] = corners[:, None] + third * np.array(steps)
    return positions


def integral(surface: Surface, point: np.ndarray) -> float:
    """The boundary volume at ``point`` by the midpoint rule on 60³ cells."""
    side = (np.arange(60) + 0.5) / 30 - 1
    ball = KERNEL_SUPPORT * np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    ball = ball[np.square(ball).sum(axis=1) < KERNEL_SUPPORT**2]
    weight = extension(surface.distance(torch.from_numpy(point + ball)).numpy())
    return VOLUME_FACTOR * weight.sum() * (KERNEL_SUPPORT / 30) ** 3


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
def test_nodes_have_the_exact_distance(solid):
    volume_map = build_volume_map(solid, LOWER, UPPER, CELL)
    exact = solid.distance(torch.from_numpy(node_positions(volume_map))).numpy()
    np.testing.assert_allclose(volume_map.distances, exact, atol=1e-6)


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS)
def test_volumes_are_the_integral_over_the_kernel_support(solid):
    volume_map = build_volume_map(solid, LOWER, UPPER, CELL)
    positions = node_positions(volume_map)
    near = np.flatnonzero((volume_map.distances > 0) & (volume_map.distances < KERNEL_SUPPORT))
    ball_volume = 4 / 3 * np.pi * KERNEL_SUPPORT**3
    for node in np.random.default_rng(0).choice(near, 12, replace=False):
        assert volume_map.volumes[node] == pytest.approx(integral(solid, positions[node]), abs=0.004 * ball_volume)


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS)
def test_every_point_within_the_kernel_support_of_the_surface_is_in_a_cell(solid):
    volume_map = build_volume_map(solid, LOWER, UPPER, CELL)
    points = np.random.default_rng(1).uniform(-0.2, 0.2, (20_000, 3))
    distance = solid.distance(torch.from_numpy(points)).numpy()
    cells = np.floor((points - volume_map.lower) / volume_map.cell).astype(int) @ [
        1, volume_map.resolution[0], volume_map.resolution[0] * volume_map.resolution[1]
    ]  # fmt: skip
    near = np.abs(distance) < KERNEL_SUPPORT
    assert near.any()
    assert np.isin(cells[near], volume_map.cells).all()
    assert len(volume_map.cells) < volume_map.resolution.prod()


def test_deep_inside_the_solid_the_volume_is_that_of_the_ball():
    volume_map = build_volume_map(Box((0.35, 0.35, 0.35)), LOWER, UPPER, CELL)
    deep = volume_map.distances < -KERNEL_SUPPORT
    ball_volume = VOLUME_FACTOR * 4 / 3 * np.pi * KERNEL_SUPPORT**3
    np.testing.assert_allclose(volume_map.volumes[deep], ball_volume, rtol=1e-2)


def test_volumes_are_accurate_for_a_solid_that_fills_half_of_the_map():
    """A large mean would show an error of single precision everywhere."""
    ground = Transformed(Box((4.0, 4.0, 2.0)), translation=(0.0, 0.0, -1.0))
    volume_map = build_volume_map(ground, LOWER, UPPER, CELL)
    positions = node_positions(volume_map)
    ball_volume = 4 / 3 * np.pi * KERNEL_SUPPORT**3
    for height in (0.025, 0.05, 0.075):
        node = np.flatnonzero(np.isclose(positions[:, 2], height))[0]
        assert volume_map.volumes[node] == pytest.approx(integral(ground, positions[node]), abs=0.002 * ball_volume)


def test_cell_sides_may_differ():
    cell = np.array([0.025, 0.03, 0.02])
    volume_map = build_volume_map(SOLIDS["ball"], LOWER, UPPER, cell)
    positions = node_positions(volume_map)
    exact = SOLIDS["ball"].distance(torch.from_numpy(positions)).numpy()
    np.testing.assert_allclose(volume_map.distances, exact, atol=1e-6)
    node = np.flatnonzero((volume_map.distances > 0.02) & (volume_map.distances < 0.03))[0]
    ball_volume = 4 / 3 * np.pi * KERNEL_SUPPORT**3
    assert volume_map.volumes[node] == pytest.approx(integral(SOLIDS["ball"], positions[node]), abs=0.004 * ball_volume)


def test_the_upper_corner_moves_to_whole_cells():
    volume_map = build_volume_map(Sphere(0.1), np.full(3, -0.21), np.array([0.2, 0.21, 0.22]), np.full(3, 0.05))
    np.testing.assert_array_equal(volume_map.resolution, [9, 9, 9])
    np.testing.assert_allclose(volume_map.lower, -0.21)


def test_a_solid_far_from_the_box_is_an_error():
    with pytest.raises(InputError, match="no point near the container"):
        build_volume_map(Transformed(Sphere(0.1), translation=(3.0, 0.0, 0.0)), LOWER, UPPER, CELL)


@given(st.lists(st.integers(0, 30), min_size=1, max_size=60))
def test_unique_values_and_their_inverse_are_those_of_numpy(numbers):
    values, inverse = unique_with_inverse(np.array(numbers), 31)
    expected = np.unique(numbers, return_inverse=True)
    np.testing.assert_array_equal(values, expected[0])
    np.testing.assert_array_equal(inverse, expected[1])
