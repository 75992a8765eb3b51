import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import SimulationError
from surfsup.scene import Block
from surfsup.sph.neighbor_search import NeighborList, find_neighbors


def brute_force(positions: torch.Tensor, radius: float) -> set[tuple[int, int]]:
    apart = torch.cdist(positions.double(), positions.double())
    near = (apart <= radius) & ~torch.eye(len(positions), dtype=torch.bool)
    return {(int(receiver), int(sender)) for receiver, sender in near.nonzero()}


def edges(near: NeighborList) -> set[tuple[int, int]]:
    pairs = list(zip(near.receivers.tolist(), near.senders.tolist(), strict=True))
    assert len(set(pairs)) == len(pairs), "no edge comes twice"
    return set(pairs)


def assert_well_formed(near: NeighborList, count: int) -> None:
    assert near.starts.dtype == near.receivers.dtype == near.senders.dtype == torch.int64
    assert near.starts.shape == (count + 1,)
    assert (near.starts[0], near.starts[-1]) == (0, len(near.senders))
    for receiver in range(count):
        group = slice(near.starts[receiver], near.starts[receiver + 1])
        assert (near.receivers[group] == receiver).all()
        assert (near.senders[group].diff() > 0).all()


@given(st.integers(1, 120), st.floats(0.01, 1.5), st.integers(0, 2**32 - 1))
def test_it_equals_all_pairs_by_brute_force(count, radius, seed):
    positions = torch.rand(count, 3, generator=torch.Generator().manual_seed(seed))
    near = find_neighbors(positions, radius)
    assert_well_formed(near, count)
    assert edges(near) == brute_force(positions, radius)


@pytest.mark.parametrize(("radius", "most"), [(0.0299, 0), (0.031, 6), (0.043, 18), (0.0599, 26), (0.061, 32)])
def test_on_the_solvers_lattice(radius, most):
    positions = torch.from_numpy(Block(min=(0, 0, 0), max=(0.24, 0.24, 0.24)).positions())
    near = find_neighbors(positions, radius)
    assert edges(near) == brute_force(positions, radius)
    assert int(near.starts.diff().max()) == most


def test_with_every_edge_there_is_its_reverse():
    near = find_neighbors(torch.rand(200, 3, generator=torch.Generator().manual_seed(0)), 0.2)
    assert edges(near) == {(sender, receiver) for receiver, sender in edges(near)}


@pytest.mark.parametrize("count", [1, 5])
def test_particles_on_their_own_have_no_neighbors(count):
    near = find_neighbors(torch.arange(count)[:, None] * torch.ones(3), 0.1)
    assert_well_formed(near, count)
    assert len(near.senders) == 0


def test_particles_in_one_place_are_neighbors_but_none_is_its_own():
    assert edges(find_neighbors(torch.zeros(3, 3), 0.1)) == {(a, b) for a in range(3) for b in range(3) if a != b}


def test_double_precision_and_gradients_are_taken_as_they_come():
    positions = torch.rand(20, 3, dtype=torch.float64, requires_grad=True)
    assert edges(find_neighbors(positions, 0.3)) == brute_force(positions.detach(), 0.3)


@pytest.mark.parametrize("value", [torch.nan, torch.inf])
def test_a_position_that_is_not_finite_is_said_in_one_line(value):
    with pytest.raises(SimulationError, match="the simulation blew up"):
        find_neighbors(torch.tensor([[0.0, 0.0, 0.0], [0.0, value, 0.0]]), 0.1)


def test_a_clump_in_which_everybody_sees_everybody_is_a_collapse_and_not_a_memory_error():
    with pytest.raises(SimulationError, match="collapsed: more than 113 particles are within"):
        find_neighbors(torch.rand(1000, 3) * 1e-3, 0.045)
