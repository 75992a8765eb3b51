import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import SimulationError
from surfsup.scene import Block
from surfsup.sph.cell_list import MAX_CELL, pairs_by_cells
from surfsup.sph.neighbor_search import pairs_by_tree


def assert_same(positions: torch.Tensor, radius: float) -> None:
    for found, expected in zip(pairs_by_cells(positions, radius), pairs_by_tree(positions, radius), strict=True):
        assert found.dtype == expected.dtype == torch.int64
        assert torch.equal(found, expected)


@given(st.integers(0, 150), st.floats(0.01, 1.5), st.integers(0, 2**32 - 1))
def test_it_equals_the_tree(count, radius, seed):
    assert_same(torch.rand(count, 3, generator=torch.Generator().manual_seed(seed)), radius)


@given(st.integers(0, 2**32 - 1))
def test_it_equals_brute_force(seed):
    positions = torch.rand(80, 3, generator=torch.Generator().manual_seed(seed))
    apart = torch.cdist(positions.double(), positions.double())
    expected = ((apart <= 0.2) & ~torch.eye(80, dtype=torch.bool)).nonzero()
    assert torch.equal(torch.stack(pairs_by_cells(positions, 0.2), dim=1), expected)


@pytest.mark.parametrize("chunk", [1, 7, 79, 80, 81])
def test_the_chunk_size_does_not_change_the_result(chunk):
    positions = torch.rand(80, 3, generator=torch.Generator().manual_seed(0))
    for found, expected in zip(pairs_by_cells(positions, 0.2, chunk), pairs_by_cells(positions, 0.2), strict=True):
        assert torch.equal(found, expected)


@pytest.mark.parametrize("radius", [0.0299, 0.031, 0.045, 0.061])
def test_on_the_initial_lattice(radius):
    assert_same(torch.from_numpy(Block(min=(0, 0, 0), max=(0.24, 0.24, 0.24)).positions()), radius)


def test_particles_far_away_keep_their_neighbors():
    near = torch.rand(30, 3, generator=torch.Generator().manual_seed(0)).double()
    far = near + torch.tensor([3.0 * MAX_CELL, -1e7, 0.0])
    assert_same(torch.cat([near, near, near, far]), 0.4)


def test_particles_in_one_place_are_neighbors_but_none_of_itself():
    assert_same(torch.zeros(4, 3), 0.1)


def test_a_clump_is_a_collapse_and_not_a_memory_error():
    with pytest.raises(SimulationError, match="the simulation collapsed"):
        pairs_by_cells(torch.rand(40_000, 3) / 1000, 0.06)


@pytest.mark.parametrize("value", [torch.nan, torch.inf])
def test_a_position_that_is_not_finite_is_refused(value):
    with pytest.raises(SimulationError, match="the simulation blew up"):
        pairs_by_cells(torch.tensor([[0.0, 0.0, 0.0], [0.0, value, 0.0]]), 0.1)
