import pytest
import torch

from surfsup.errors import SimulationError
from surfsup.native.dispatch import is_built
from surfsup.scene import SPACING
from surfsup.sph.dfsph import SELF_DENSITY
from surfsup.sph.kernel_sums import (
    KERNELS,
    PARITY,
    KernelGraph,
    KernelSums,
    join_graphs,
    kernel_graph,
    kernel_sums,
    sparse_matrix,
)
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import NeighborList, find_neighbors


def random_positions(count: int, seed: int = 0, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    return 0.15 * torch.rand(count, 3, generator=torch.Generator().manual_seed(seed), dtype=dtype)


def graph_of(positions: torch.Tensor) -> KernelGraph:
    return kernel_graph(positions, find_neighbors(positions, KERNEL_SUPPORT))


def random_graph(count: int, seed: int = 0, dtype: torch.dtype = torch.float64) -> KernelGraph:
    return graph_of(random_positions(count, seed, dtype))


def two_particles(displacement: list[float]) -> KernelGraph:
    positions = torch.tensor([[0.0, 0.0, 0.0], displacement], dtype=torch.float64)
    return kernel_graph(positions, NeighborList(torch.tensor([0, 1, 2]), torch.tensor([0, 1]), torch.tensor([1, 0])))


@pytest.mark.parametrize("q", [1.0, 1.01, 3.0])
def test_kernels_vanish_from_the_support_on(q):
    assert (two_particles([0, q * KERNEL_SUPPORT, 0]).kernels == 0).all()


@pytest.mark.parametrize(("q", "value", "slope"), [(0.25, 0.71875, 0.9375), (0.5, 0.25, 0.75), (0.75, 0.03125, 0.1875)])
def test_kernels_are_the_cubic_spline_and_minus_half_its_gradient(q, value, slope):
    kernels = two_particles([0, 0, q * KERNEL_SUPPORT]).kernels
    expected = kernels.new_tensor([value, 0, 0, slope])
    torch.testing.assert_close(kernels[0], expected)
    torch.testing.assert_close(kernels[1], expected * kernels.new_tensor(PARITY))


def test_density_on_the_initial_lattice_is_the_rest_density():
    graph = graph_of(torch.cartesian_prod(*[SPACING * torch.arange(5, dtype=torch.float64)] * 3))
    middle = graph.neighbors.receivers == 62
    density = SELF_DENSITY * (1 + graph.kernels[middle, 0].sum())
    torch.testing.assert_close(density, density.new_tensor(1.0), rtol=1e-4, atol=0)


def test_an_edge_and_its_reverse_differ_by_the_parity_of_the_kernels():
    kernels = two_particles([0.02, -0.01, 0.03]).kernels
    torch.testing.assert_close(kernels[1], kernels[0] * kernels.new_tensor(PARITY))


def test_particles_in_one_place_have_finite_kernels_and_gradients():
    positions = torch.zeros(2, 3, dtype=torch.float64, requires_grad=True)
    kernels = graph_of(positions).kernels
    assert torch.isfinite(kernels).all()
    (gradient,) = torch.autograd.grad(kernels.square().sum(), positions)
    assert torch.isfinite(gradient).all()


def test_the_gradients_of_kernels_equal_finite_differences():
    positions = random_positions(12)
    neighbors = find_neighbors(positions, KERNEL_SUPPORT)
    assert torch.autograd.gradcheck(
        lambda x: kernel_graph(x, neighbors).kernels, positions.requires_grad_(), eps=1e-7, atol=1e-4
    )


def test_the_scatter_matrix_is_the_transpose_of_the_gather_matrix():
    graph = random_graph(30)
    torch.testing.assert_close(graph.scatter_matrix.to_dense(), graph.gather_matrix.to_dense().T)


@pytest.mark.parametrize("count", [1, 2, 40])
def test_it_sums_over_neighbors_for_every_kernel(count):
    graph = random_graph(count)
    values = torch.randn(count, 4, dtype=torch.float64)
    sent = graph.kernels[:, :, None] * values[graph.neighbors.senders][:, None]
    expected = torch.zeros(count, KERNELS, 4, dtype=torch.float64).index_add(0, graph.neighbors.receivers, sent)
    torch.testing.assert_close(KernelSums.apply(values, graph.kernels, graph), expected)


def test_without_edges_sums_and_gradients_are_zero():
    graph = graph_of(torch.arange(4.0, dtype=torch.float64)[:, None] * torch.ones(3, dtype=torch.float64))
    values = torch.randn(4, 3, dtype=torch.float64, requires_grad=True)
    sums = kernel_sums(values, graph)
    assert (sums == 0).all()
    sums.sum().backward()
    assert (values.grad == 0).all()


def test_the_gradients_of_sums_equal_finite_differences():
    positions = random_positions(12)
    neighbors = find_neighbors(positions, KERNEL_SUPPORT)

    def sums(positions: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        graph = kernel_graph(positions, neighbors)
        return KernelSums.apply(values, graph.kernels, graph)

    values = torch.randn(12, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(sums, (positions.requires_grad_(), values), eps=1e-7, atol=1e-4)


@pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")
def test_sums_and_gradient_in_cpp_equal_those_of_torch():
    graph = random_graph(250, dtype=torch.float32)
    values = torch.randn(250, 4, generator=torch.Generator().manual_seed(2), requires_grad=True)
    sums = kernel_sums(values, graph)
    assert "NativeKernelSums" in sums.grad_fn.name()
    weight = torch.randn(sums.shape, generator=torch.Generator().manual_seed(3))
    (gradient,) = torch.autograd.grad((sums * weight).sum(), values)
    exact = values.detach().double().requires_grad_()
    exact_graph = KernelGraph(graph.neighbors, graph.kernels.double())
    expected = KernelSums.apply(exact, exact_graph.kernels, exact_graph)
    (exact_gradient,) = torch.autograd.grad((expected * weight).sum(), exact)
    torch.testing.assert_close(sums, expected.float(), atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(gradient, exact_gradient.float(), atol=1e-5, rtol=1e-5)


def test_joined_graphs_have_no_edges_between_them():
    sizes = (7, 1, 20)
    graphs = [random_graph(size, seed) for seed, size in enumerate(sizes)]
    values = [torch.randn(size, 4, dtype=torch.float64) for size in sizes]
    joined = join_graphs(graphs)
    assert len(joined) == sum(sizes)
    alone = [kernel_sums(part, graph) for part, graph in zip(values, graphs, strict=True)]
    torch.testing.assert_close(kernel_sums(torch.cat(values), joined), torch.cat(alone))


def test_a_single_graph_joined_is_itself():
    graph = random_graph(5)
    assert join_graphs([graph]) is graph


def test_more_pairs_than_a_sparse_matrix_can_count_are_refused():
    columns = torch.empty(2**31, dtype=torch.long, device="meta")
    with pytest.raises(SimulationError, match="536870912 neighbor pairs"):
        sparse_matrix(columns[:2], columns, columns, (1, 1))
