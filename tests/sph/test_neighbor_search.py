import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup.errors import SimulationError
from surfsup.native.dispatch import is_built
from surfsup.scene import Block
from surfsup.sph.neighbor_search import NeighborList, find_neighbors, neighbors_native, pairs_by_tree


def brute_force(positions: torch.Tensor, radius: float) -> set[tuple[int, int]]:
    apart = torch.cdist(positions.double(), positions.double())
    near = (apart <= radius) & ~torch.eye(len(positions), dtype=torch.bool)
    return {(int(receiver), int(sender)) for receiver, sender in near.nonzero()}


def edges(found: NeighborList) -> set[tuple[int, int]]:
    pairs = list(zip(found.receivers.tolist(), found.senders.tolist(), strict=True))
    assert len(set(pairs)) == len(pairs), "no edge occurs twice"
    return set(pairs)


def assert_well_formed(found: NeighborList, count: int) -> None:
    assert found.starts.dtype == found.receivers.dtype == found.senders.dtype == torch.int64
    assert found.starts.shape == (count + 1,)
    assert (found.starts[0], found.starts[-1]) == (0, len(found.senders))
    for receiver in range(count):
        group = slice(found.starts[receiver], found.starts[receiver + 1])
        assert (found.receivers[group] == receiver).all()
        assert (found.senders[group].diff() > 0).all()


@given(st.integers(1, 120), st.floats(0.01, 1.5), st.integers(0, 2**32 - 1))
def test_it_equals_all_pairs_by_brute_force(count, radius, seed):
    positions = torch.rand(count, 3, generator=torch.Generator().manual_seed(seed))
    found = find_neighbors(positions, radius)
    assert_well_formed(found, count)
    assert edges(found) == brute_force(positions, radius)


@pytest.mark.parametrize(("radius", "most"), [(0.0299, 0), (0.031, 6), (0.043, 18), (0.0599, 26), (0.061, 32)])
def test_on_the_initial_lattice(radius, most):
    positions = torch.from_numpy(Block(min=(0, 0, 0), max=(0.24, 0.24, 0.24)).positions())
    found = find_neighbors(positions, radius)
    assert edges(found) == brute_force(positions, radius)
    assert int(found.starts.diff().max()) == most


def test_every_edge_has_its_reverse():
    found = find_neighbors(torch.rand(200, 3, generator=torch.Generator().manual_seed(0)), 0.2)
    assert edges(found) == {(sender, receiver) for receiver, sender in edges(found)}


@pytest.mark.parametrize("count", [1, 5])
def test_lone_particles_have_no_neighbors(count):
    found = find_neighbors(torch.arange(count)[:, None] * torch.ones(3), 0.1)
    assert_well_formed(found, count)
    assert len(found.senders) == 0


def test_particles_in_one_place_are_neighbors_but_none_of_itself():
    assert edges(find_neighbors(torch.zeros(3, 3), 0.1)) == {(a, b) for a in range(3) for b in range(3) if a != b}


def test_double_precision_and_positions_with_gradients_work():
    positions = torch.rand(20, 3, dtype=torch.float64, requires_grad=True)
    assert edges(find_neighbors(positions, 0.3)) == brute_force(positions.detach(), 0.3)


@pytest.mark.parametrize("value", [torch.nan, torch.inf])
def test_a_position_that_is_not_finite_is_refused(value):
    with pytest.raises(SimulationError, match="the simulation blew up"):
        find_neighbors(torch.tensor([[0.0, 0.0, 0.0], [0.0, value, 0.0]]), 0.1)


def test_a_clump_is_a_collapse_and_not_a_memory_error():
    with pytest.raises(SimulationError, match="collapsed: a particle has more than 113 neighbors within"):
        find_neighbors(torch.rand(1000, 3) * 1e-3, 0.045)


needs_cpp = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")


@needs_cpp
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(0, 300), side=st.floats(0.1, 3.0))
@settings(max_examples=50)
def test_cpp_finds_the_neighbors_of_the_tree(seed, count, side):
    positions = side * torch.rand(count, 3, generator=torch.Generator().manual_seed(seed))
    found = neighbors_native(positions, 0.061)
    receivers, senders = pairs_by_tree(positions, 0.061)
    assert torch.equal(found.receivers, receivers)
    assert torch.equal(found.senders, senders)
    assert torch.equal(found.starts, torch.searchsorted(receivers, torch.arange(count + 1)))


@needs_cpp
@pytest.mark.parametrize("radius", [0.03, 0.06, 0.0599, 0.0301])
@pytest.mark.parametrize("shift", [0.0, 0.37, 7.0])
def test_cpp_breaks_the_ties_of_the_lattice_as_the_tree_does(radius, shift):
    positions = torch.cartesian_prod(*[torch.arange(7) * 0.03] * 3) + shift
    found = neighbors_native(positions, radius)
    receivers, senders = pairs_by_tree(positions, radius)
    assert torch.equal(found.receivers, receivers)
    assert torch.equal(found.senders, senders)
