import pytest
import torch

from surfsup import native
from surfsup.learned.corrected.convolution import GatherMessages, convolve
from surfsup.native.dispatch import is_built
from surfsup.sph.kernel_sums import KERNELS, KernelGraph, kernel_graph
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import find_neighbors

needs_cpp = pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")


def graph_of(count: int, seed: int = 0, dtype: torch.dtype = torch.float32) -> KernelGraph:
    positions = 0.2 * torch.rand(count, 3, generator=torch.Generator().manual_seed(seed))
    return kernel_graph(positions.to(dtype), find_neighbors(positions, KERNEL_SUPPORT))


def random_inputs(width: int, count: int, seed: int = 0) -> list[torch.Tensor]:
    """Hidden states and weights, which require gradients."""
    random = torch.Generator().manual_seed(seed)
    sizes = [(count, width), (KERNELS * width, width), (width, width)]
    return [torch.randn(size, generator=random).div_(width**0.5).requires_grad_() for size in sizes]


def edge_by_edge(messages: torch.Tensor, graph: KernelGraph) -> torch.Tensor:
    out = torch.zeros(len(graph), messages.shape[2], dtype=messages.dtype)
    for receiver, sender, kernels in zip(
        graph.neighbors.receivers, graph.neighbors.senders, graph.kernels, strict=True
    ):
        for kernel in range(KERNELS):
            out[receiver] += kernels[kernel] * messages[sender, kernel]
    return out


def by_torch(hidden: torch.Tensor, mix: torch.Tensor, self_weight: torch.Tensor, graph: KernelGraph) -> torch.Tensor:
    messages = (hidden @ mix.T).unflatten(1, (KERNELS, -1))
    return GatherMessages.apply(messages, graph.kernels, graph) + hidden @ self_weight.T


@pytest.mark.parametrize("count", [1, 2, 40])
def test_messages_are_summed_over_neighbors_and_kernels(count):
    graph = graph_of(count, dtype=torch.float64)
    messages = torch.randn(count, KERNELS, 5, dtype=torch.float64)
    torch.testing.assert_close(GatherMessages.apply(messages, graph.kernels, graph), edge_by_edge(messages, graph))


def test_the_gradients_of_the_sum_equal_finite_differences():
    graph = graph_of(30, dtype=torch.float64)
    assert len(graph.kernels) > 10
    messages = torch.randn(30, KERNELS, 2, dtype=torch.float64, requires_grad=True)
    kernels = graph.kernels.clone().requires_grad_()

    def gather(messages: torch.Tensor, kernels: torch.Tensor) -> torch.Tensor:
        return GatherMessages.apply(messages, kernels, KernelGraph(graph.neighbors, kernels))

    assert torch.autograd.gradcheck(gather, (messages, kernels))


@needs_cpp
@pytest.mark.parametrize("width", [16, 32, 48, 64])
@pytest.mark.parametrize("count", [1, 13, 300])
def test_convolution_and_gradients_in_cpp_equal_those_of_torch(width, count):
    inputs, graph = random_inputs(width, count), graph_of(count)
    out = convolve(*inputs, graph)
    assert "NativeConvolution" in out.grad_fn.name()
    weight = torch.randn(out.shape, generator=torch.Generator().manual_seed(1))
    gradients = torch.autograd.grad((out * weight).sum(), inputs)
    exact = [one.detach().double().requires_grad_() for one in inputs]
    expected = by_torch(*exact, graph_of(count, dtype=torch.float64))
    exact_gradients = torch.autograd.grad((expected * weight).sum(), exact)
    torch.testing.assert_close(out, expected.float(), atol=1e-5, rtol=1e-5)
    for one, other in zip(gradients, exact_gradients, strict=True):
        torch.testing.assert_close(one, other.float(), atol=2e-5, rtol=1e-4)


def test_the_gradients_of_the_convolution_equal_finite_differences():
    inputs, graph = random_inputs(16, 120), graph_of(120)
    weight = torch.randn(120, 16, generator=torch.Generator().manual_seed(1))

    def value(*values: torch.Tensor) -> torch.Tensor:
        return (convolve(*values, graph).double().square() * weight).sum()

    gradients = torch.autograd.grad(value(*inputs), inputs)
    for place, gradient in enumerate(gradients):
        direction = torch.randn(gradient.shape, generator=torch.Generator().manual_seed(place))
        step = 1e-2  # the value is quadratic in each input, so the central difference is exact
        with torch.no_grad():
            ends = [
                value(*(one + sign * step * direction if k == place else one for k, one in enumerate(inputs)))
                for sign in (1, -1)
            ]
        slope = (ends[0] - ends[1]) / (2 * step)
        torch.testing.assert_close(slope, (gradient.double() * direction).sum(), rtol=1e-3, atol=1e-3)


@needs_cpp
def test_gradients_do_not_depend_on_the_number_of_threads():
    graph, threads, results = graph_of(1500), torch.get_num_threads(), []
    try:
        for count in (1, 2, 1, 2):
            torch.set_num_threads(count)
            inputs = random_inputs(32, 1500)
            results.append(torch.autograd.grad(convolve(*inputs, graph).square().sum(), inputs))
    finally:
        torch.set_num_threads(threads)
    assert all(torch.equal(one, first) for other in results for one, first in zip(other, results[0], strict=True))


@pytest.mark.parametrize("width", [8, 24])
def test_torch_serves_other_widths_double_precision_and_kernels_with_gradients(width):
    assert "NativeConvolution" not in convolve(*random_inputs(width, 40), graph_of(40)).grad_fn.name()
    exact = [one.double() for one in random_inputs(32, 40)]
    assert "NativeConvolution" not in convolve(*exact, graph_of(40, dtype=torch.float64)).grad_fn.name()
    graph = graph_of(40)
    learning = KernelGraph(graph.neighbors, graph.kernels.clone().requires_grad_())
    assert "NativeConvolution" not in convolve(*random_inputs(32, 40), learning).grad_fn.name()


@needs_cpp
def test_sizes_that_do_not_fit_are_refused():
    graph = graph_of(20)
    arrays = [one.numpy() for one in (graph.neighbors.starts, graph.neighbors.senders, graph.kernels)]
    hidden, mix, self_weight = (one.detach().numpy() for one in random_inputs(16, 20))
    with pytest.raises(ValueError, match="a multiple of 16"):
        native.convolve(*arrays, hidden, mix[:48], self_weight, hidden.copy(), 1)
    with pytest.raises(ValueError, match="hidden has 19 rows, but must have 20"):
        native.convolve(*arrays, hidden[:19], mix, self_weight, hidden.copy(), 1)
