import pytest
import torch

from surfsup.errors import SimulationError
from surfsup.scene import SPACING
from surfsup.sph.kernel_sums import KERNELS, PARITY, Gather, Graph, KernelSums, graph, join, sparse
from surfsup.sph.neighbor_search import NeighborList, find_neighbors

RADIUS = 0.4


def some_graph(count: int, seed: int = 0, dtype: torch.dtype = torch.float64) -> tuple[torch.Tensor, Graph]:
    positions = torch.rand(count, 3, generator=torch.Generator().manual_seed(seed), dtype=dtype)
    return positions, graph(positions, find_neighbors(positions, RADIUS), RADIUS)


def two_particles(displacement: list[float]) -> Graph:
    positions = torch.tensor([[0.0, 0.0, 0.0], displacement], dtype=torch.float64)
    both = NeighborList(torch.tensor([0, 1, 2]), torch.tensor([0, 1]), torch.tensor([1, 0]))
    return graph(positions, both, RADIUS)


def dense_convolution(mixed: torch.Tensor, seen: Graph) -> torch.Tensor:
    """Written out edge by edge."""
    out = torch.zeros(len(seen), mixed.shape[2], dtype=mixed.dtype)
    near = seen.neighborhood
    for receiver, sender, kernels in zip(near.receivers, near.senders, seen.kernels, strict=True):
        for kernel in range(KERNELS):
            out[receiver] += kernels[kernel] * mixed[sender, kernel]
    return out


@pytest.mark.parametrize("distance", [RADIUS, 1.01 * RADIUS, 3 * RADIUS])
def test_kernels_vanish_at_the_radius_and_beyond(distance):
    assert (two_particles([0, distance, 0]).kernels == 0).all()


@pytest.mark.parametrize(
    ("share", "window", "slope"), [(0.25, 0.71875, 0.9375), (0.5, 0.25, 0.75), (0.75, 0.03125, 0.1875)]
)
def test_kernels_are_the_cubic_spline_and_its_slope_times_the_direction(share, window, slope):
    kernels = two_particles([0, 0, share * RADIUS]).kernels
    expected = kernels.new_tensor([window, 0, 0, slope])
    torch.testing.assert_close(kernels[0], expected)
    torch.testing.assert_close(kernels[1], expected * kernels.new_tensor(PARITY))


def test_the_slope_is_minus_half_of_that_of_the_window_a_radius():
    place, step = 0.3, 1e-6
    ahead, behind = (two_particles([0, 0, (place + move) * RADIUS]).kernels[0, 0] for move in (step, -step))
    slope = two_particles([0, 0, place * RADIUS]).kernels[0, 3]
    torch.testing.assert_close(slope, -0.5 * (ahead - behind) / (2 * step), rtol=1e-6, atol=0)


def test_on_the_lattice_that_water_starts_on_density_is_that_of_the_solver():
    positions = torch.cartesian_prod(*[SPACING * torch.arange(5, dtype=torch.float64)] * 3)
    seen = graph(positions, find_neighbors(positions, 2 * SPACING), 2 * SPACING)
    middle = seen.neighborhood.receivers == 62
    density = 8 / torch.pi / 8 * (1 + seen.kernels[middle, 0].sum())
    torch.testing.assert_close(density, density.new_tensor(1.0), rtol=1e-4, atol=0)


def test_an_edge_and_its_reverse_differ_by_the_parity_of_the_kernels():
    kernels = two_particles([0.1, -0.05, 0.2]).kernels
    torch.testing.assert_close(kernels[1], kernels[0] * kernels.new_tensor(PARITY))


def test_particles_in_one_place_have_finite_kernels_and_gradients():
    positions = torch.zeros(2, 3, dtype=torch.float64, requires_grad=True)
    seen = graph(positions, find_neighbors(positions, RADIUS), RADIUS)
    assert torch.isfinite(seen.kernels).all()
    (gradient,) = torch.autograd.grad(seen.kernels.square().sum(), positions)
    assert torch.isfinite(gradient).all()


def test_kernels_have_the_gradients_of_finite_differences():
    positions, _ = some_graph(12)
    near = find_neighbors(positions, RADIUS)
    torch.autograd.gradcheck(lambda x: graph(x, near, RADIUS).kernels, positions.requires_grad_())


@pytest.mark.parametrize("count", [1, 2, 40])
def test_it_is_the_sum_over_neighbors_and_kernels(count):
    _, seen = some_graph(count)
    mixed = torch.randn(count, KERNELS, 5, dtype=torch.float64)
    torch.testing.assert_close(Gather.apply(mixed, seen.kernels, seen), dense_convolution(mixed, seen))


def test_without_any_edge_the_sum_is_zero_and_so_are_its_gradients():
    positions = torch.arange(4.0, dtype=torch.float64)[:, None] * torch.ones(3, dtype=torch.float64)
    seen = graph(positions, find_neighbors(positions, RADIUS), RADIUS)
    mixed = torch.randn(4, KERNELS, 3, dtype=torch.float64, requires_grad=True)
    out = Gather.apply(mixed, seen.kernels, seen)
    assert (out == 0).all()
    out.sum().backward()
    assert (mixed.grad == 0).all()


def test_both_gradients_are_those_of_finite_differences():
    _, seen = some_graph(9)
    assert len(seen.kernels) > 10
    mixed = torch.randn(9, KERNELS, 2, dtype=torch.float64, requires_grad=True)
    kernels = seen.kernels.clone().requires_grad_()

    def gather(mixed: torch.Tensor, kernels: torch.Tensor) -> torch.Tensor:
        return Gather.apply(mixed, kernels, Graph(seen.neighborhood, kernels))

    assert torch.autograd.gradcheck(gather, (mixed, kernels))


def test_spreading_is_the_transpose_of_gathering():
    _, seen = some_graph(30)
    torch.testing.assert_close(seen.spreading.to_dense(), seen.gathering.to_dense().T)


def test_joined_graphs_are_the_separate_ones_side_by_side():
    sizes = (7, 1, 20)
    graphs = [some_graph(size, seed)[1] for seed, size in enumerate(sizes)]
    mixed = [torch.randn(size, KERNELS, 4, dtype=torch.float64) for size in sizes]
    joined = join(graphs)
    assert len(joined) == sum(sizes)
    together = Gather.apply(torch.cat(mixed), joined.kernels, joined)
    apart = [Gather.apply(part, one.kernels, one) for part, one in zip(mixed, graphs, strict=True)]
    torch.testing.assert_close(together, torch.cat(apart))


def test_one_graph_joined_is_itself():
    _, seen = some_graph(5)
    assert join([seen]) is seen


@pytest.mark.parametrize("count", [1, 2, 40])
def test_kernel_sums_are_the_sums_over_neighbors_of_each_kernel_apart(count):
    _, seen = some_graph(count)
    near = seen.neighborhood
    values = torch.randn(count, 4, dtype=torch.float64)
    sent = seen.kernels[:, :, None] * values[near.senders][:, None]
    expected = torch.zeros(count, KERNELS, 4, dtype=torch.float64).index_add(0, near.receivers, sent)
    torch.testing.assert_close(KernelSums.apply(values, seen.kernels, seen), expected)


def test_kernel_sums_have_the_gradients_of_finite_differences():
    positions, _ = some_graph(12)
    near = find_neighbors(positions, RADIUS)

    def sums(places, values):
        seen = graph(places, near, RADIUS)
        return KernelSums.apply(values, seen.kernels, seen)

    values = torch.randn(12, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(sums, (positions.requires_grad_(), values))


def test_more_pairs_than_a_sparse_matrix_can_count_are_refused_in_one_line():
    columns = torch.empty(2**31, dtype=torch.long, device="meta")
    with pytest.raises(SimulationError, match="536870912 pairs of neighbors"):
        sparse(columns[:2], columns, columns, (1, 1))
