import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup import native
from surfsup.errors import SimulationError
from surfsup.sph.kernel_sums import KERNELS, Gather, Graph, KernelSums, convolve, graph, kernel_sums
from surfsup.sph.neighbor_search import find_neighbors, find_neighbors_native, pairs_by_tree

pytestmark = pytest.mark.skipif(
    not native.instruction_sets(), reason="the package was built without a compiler, so there is no native step"
)

RADIUS = 0.061


def cloud(count: int, seed: int = 0, side: float = 0.2) -> torch.Tensor:
    return torch.rand(count, 3, generator=torch.Generator().manual_seed(seed)) * side


def seen(count: int, seed: int = 0, dtype=torch.float32) -> Graph:
    positions = cloud(count, seed)
    return graph(positions.to(dtype), find_neighbors(positions, RADIUS), RADIUS)


def drawn(width: int, count: int, seed: int = 0, messages: int | None = None) -> list[torch.Tensor]:
    """Hidden, mix and own, which want gradients."""
    random = torch.Generator().manual_seed(seed)
    sizes = [(count, width), (KERNELS * width, messages or width), (width, width)]
    return [torch.randn(size, generator=random).div_(width**0.5).requires_grad_() for size in sizes]


def by_torch(hidden: torch.Tensor, mix: torch.Tensor, own: torch.Tensor, edges: Graph) -> torch.Tensor:
    mixed = (hidden[:, : mix.shape[1]] @ mix.T).unflatten(1, (KERNELS, -1))
    return Gather.apply(mixed, edges.kernels, edges) + hidden @ own.T


@pytest.mark.parametrize(("width", "messages"), [(16, 16), (32, 32), (32, 16), (48, 16), (48, 32), (64, 48)])
@pytest.mark.parametrize("count", [1, 13, 300])
def test_the_convolution_and_its_gradients_are_those_of_torch(width, messages, count):
    inputs, edges = drawn(width, count, messages=messages), seen(count)
    out = convolve(*inputs, edges)
    assert "NativeConvolution" in out.grad_fn.name()
    weight = torch.randn(out.shape, generator=torch.Generator().manual_seed(1))
    found = torch.autograd.grad((out * weight).sum(), inputs)
    exact = [one.detach().double().requires_grad_() for one in inputs]
    expected = by_torch(*exact, seen(count, dtype=torch.float64))
    wanted = torch.autograd.grad((expected * weight).sum(), exact)
    torch.testing.assert_close(out, expected.float(), atol=1e-5, rtol=1e-5)
    for one, other in zip(found, wanted, strict=True):
        torch.testing.assert_close(one, other.float(), atol=2e-5, rtol=1e-4)


def test_the_gradients_are_those_of_finite_differences():
    inputs, edges = drawn(16, 120), seen(120)
    weight = torch.randn(120, 16, generator=torch.Generator().manual_seed(1))

    def value(*given: torch.Tensor) -> torch.Tensor:
        return (convolve(*given, edges).double().square() * weight).sum()

    gradients = torch.autograd.grad(value(*inputs), inputs)
    for place, gradient in enumerate(gradients):
        direction = torch.randn(gradient.shape, generator=torch.Generator().manual_seed(place))
        step = 1e-2  # the value is of second order in each input, so the middle difference is exact
        with torch.no_grad():
            ends = [
                value(*(one + sign * step * direction if k == place else one for k, one in enumerate(inputs)))
                for sign in (1, -1)
            ]
        slope = (ends[0] - ends[1]) / (2 * step)
        torch.testing.assert_close(slope, (gradient.double() * direction).sum(), rtol=1e-3, atol=1e-3)


def test_gradients_do_not_depend_on_the_threads():
    edges, threads, found = seen(1500), torch.get_num_threads(), []
    try:
        for count in (1, 2, 1, 2):
            torch.set_num_threads(count)
            inputs = drawn(32, 1500)
            found.append(torch.autograd.grad(convolve(*inputs, edges).square().sum(), inputs))
    finally:
        torch.set_num_threads(threads)
    assert all(torch.equal(one, first) for other in found for one, first in zip(other, found[0], strict=True))


def test_kernel_sums_and_their_gradient_are_those_of_torch():
    edges = seen(250)
    values = torch.randn(250, 4, generator=torch.Generator().manual_seed(2), requires_grad=True)
    sums = kernel_sums(values, edges)
    assert "NativeKernelSums" in sums.grad_fn.name()
    weight = torch.randn(sums.shape, generator=torch.Generator().manual_seed(3))
    (gradient,) = torch.autograd.grad((sums * weight).sum(), values)
    exact = values.detach().double().requires_grad_()
    exact_edges = seen(250, dtype=torch.float64)
    expected = KernelSums.apply(exact, exact_edges.kernels, exact_edges)
    (wanted,) = torch.autograd.grad((expected * weight).sum(), exact)
    torch.testing.assert_close(sums, expected.float(), atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(gradient, wanted.float(), atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("width", [8, 24])
def test_other_widths_double_precision_and_kernels_that_learn_are_left_to_torch(width):
    inputs, edges = drawn(width, 40), seen(40)
    assert "NativeConvolution" not in convolve(*inputs, edges).grad_fn.name()
    exact = [one.double() for one in drawn(32, 40)]
    assert "NativeConvolution" not in convolve(*exact, seen(40, dtype=torch.float64)).grad_fn.name()
    learning = graph(cloud(40).requires_grad_(), find_neighbors(cloud(40), RADIUS), RADIUS)
    out = convolve(*drawn(32, 40), learning)
    assert "NativeConvolution" not in out.grad_fn.name()


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(0, 300), side=st.floats(0.1, 3.0))
@settings(max_examples=50)
def test_neighbors_are_those_of_the_tree(seed, count, side):
    positions = cloud(count, seed, side)
    found = find_neighbors_native(positions, RADIUS)
    receivers, senders = pairs_by_tree(positions, RADIUS)
    assert torch.equal(found.receivers, receivers)
    assert torch.equal(found.senders, senders)
    assert torch.equal(found.starts, torch.searchsorted(receivers, torch.arange(count + 1)))


@pytest.mark.parametrize("radius", [0.03, 0.06, 0.0599, 0.0301])
@pytest.mark.parametrize("shift", [0.0, 0.37, 7.0])
def test_ties_of_the_lattice_fall_as_in_the_tree(radius, shift):
    positions = torch.cartesian_prod(*[torch.arange(7) * 0.03] * 3) + shift
    found = find_neighbors_native(positions, radius)
    receivers, senders = pairs_by_tree(positions, radius)
    assert torch.equal(found.receivers, receivers)
    assert torch.equal(found.senders, senders)


def test_a_collapse_and_a_position_that_is_no_number_end_with_one_line():
    with pytest.raises(SimulationError, match="the simulation collapsed"):
        find_neighbors_native(cloud(2000, side=1e-3), RADIUS)
    positions = cloud(20)
    positions[3, 2] = torch.nan
    with pytest.raises(SimulationError, match="not a finite number"):
        find_neighbors_native(positions, RADIUS)


def test_sizes_that_do_not_fit_are_refused():
    edges = seen(20)
    told = [one.numpy() for one in (edges.neighborhood.starts, edges.neighborhood.senders, edges.kernels)]
    hidden, mix, own = (one.detach().numpy() for one in drawn(16, 20))
    with pytest.raises(ValueError, match="multiples of 16 channels"):
        native.convolve(*told, hidden, mix[:48], own, hidden.copy(), 1)
    with pytest.raises(ValueError, match="hidden has 19 rows, but must have 20"):
        native.convolve(*told, hidden[:19], mix, own, hidden.copy(), 1)
