import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup.learned.message_passing.graph import EdgeGraph, edge_graph, join_graphs
from surfsup.learned.message_passing.network import MessagePassingNetwork
from surfsup.sph.neighbor_search import NeighborList, find_neighbors
from tests.learned.message_passing.plain import plain_network


def network(inputs=5, outputs=3, width=16, layers=3, seed=0, dtype=torch.float32) -> MessagePassingNetwork:
    torch.manual_seed(seed)
    made = MessagePassingNetwork(inputs, outputs, width, layers).to(dtype)
    for name, parameter in made.named_parameters():
        if "norm" in name:  # fresh ones are ones and zeros, which would hide most faults
            torch.nn.init.normal_(parameter)
    return made


def water(count: int, seed: int = 0, dtype=torch.float32) -> tuple[torch.Tensor, EdgeGraph]:
    random = torch.Generator().manual_seed(seed)
    positions = torch.rand(count, 3, generator=random, dtype=dtype)
    features = torch.randn(count, 5, generator=random, dtype=dtype)
    return features, edge_graph(positions, find_neighbors(positions, 0.4), 0.4)


def test_the_split_layer_equals_the_plain_one_at_the_size_of_the_paper():
    made = network(width=128, layers=10)
    features, graph = water(300)
    with torch.no_grad():
        torch.testing.assert_close(made(features, graph), plain_network(made, features, graph), atol=1e-5, rtol=1e-5)


@settings(max_examples=20)
@given(st.integers(1, 40), st.integers(1, 24), st.integers(1, 3), st.integers(0, 2**31))
def test_it_equals_the_plain_one_at_any_size(count, width, layers, seed):
    made = network(width=width, layers=layers, seed=seed, dtype=torch.float64)
    features, graph = water(count, seed, torch.float64)
    torch.testing.assert_close(made(features, graph), plain_network(made, features, graph))


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float64, 1e-9), (torch.float32, 1e-3)])
def test_its_gradients_are_those_of_the_plain_one(dtype, tolerance):
    made = network(dtype=dtype)
    features, graph = water(50, dtype=dtype)
    features.requires_grad_()
    wanted = [features, *made.parameters()]
    losses = [run(features, graph).square().sum() for run in (made, lambda *seen: plain_network(made, *seen))]
    ours, plain = (torch.autograd.grad(loss, wanted, allow_unused=True) for loss in losses)
    for one, other in zip(ours, plain, strict=True):
        torch.testing.assert_close(one, other, atol=tolerance * float(other.abs().max()), rtol=tolerance)


def test_gradients_in_features_places_and_weights_are_those_of_finite_differences():
    made = network(width=6, layers=2, dtype=torch.float64)
    features, graph = water(7, dtype=torch.float64)
    positions = torch.rand(7, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    names, weights = zip(*made.named_parameters(), strict=True)

    def run(features, positions, *weights):
        seen = edge_graph(positions, graph.neighborhood, 0.4)
        return torch.func.functional_call(made, dict(zip(names, weights, strict=True)), (features, seen))

    inputs = [value.detach().requires_grad_() for value in (features, positions, *weights)]
    assert torch.autograd.gradcheck(run, inputs, fast_mode=True)


def test_the_order_of_particles_does_not_matter():
    made = network(dtype=torch.float64)
    positions = torch.rand(60, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(4))
    features, order = torch.randn(60, 5, dtype=torch.float64), torch.randperm(60)

    def run(positions, features):
        return made(features, edge_graph(positions, find_neighbors(positions, 0.3), 0.3))

    torch.testing.assert_close(run(positions[order], features[order]), run(positions, features)[order])


def test_graphs_side_by_side_are_seen_as_on_their_own():
    made = network(dtype=torch.float64)
    parts = [water(count, count, torch.float64) for count in (12, 1, 30)]
    joined = made(torch.cat([features for features, _ in parts]), join_graphs([graph for _, graph in parts]))
    torch.testing.assert_close(joined, torch.cat([made(*part) for part in parts]))


@pytest.mark.parametrize("count", [1, 3])
def test_particles_on_their_own_are_a_network_without_edges(count):
    made, positions = network(), torch.arange(count)[:, None] * torch.ones(3)
    graph = edge_graph(positions, find_neighbors(positions, 0.5), 0.5)
    out = made(torch.randn(count, 5), graph)
    assert torch.isfinite(out).all()
    out.sum().backward()


def test_bf16_is_near_and_gives_full_precision_gradients():
    made = network(width=64, layers=5)
    features, graph = water(200)
    exact = made(features, graph)
    with torch.autocast("cpu", torch.bfloat16):
        rough = made(features, graph)
    assert rough.dtype == torch.float32
    assert 0 < (rough - exact).square().mean().sqrt() < 0.03 * exact.std()
    rough.square().sum().backward()
    assert all(parameter.grad.dtype == torch.float32 for parameter in made.decoder.parameters())


def test_edges_are_told_displacement_and_length_relative_to_the_radius():
    near = NeighborList(torch.tensor([0, 1, 2]), torch.tensor([0, 1]), torch.tensor([1, 0]))
    graph = edge_graph(torch.tensor([[0.0, 0.0, 0.0], [0.03, 0.04, 0.0]]), near, 0.1)
    torch.testing.assert_close(graph.features, torch.tensor([[0.3, 0.4, 0.0, 0.5], [-0.3, -0.4, 0.0, 0.5]]))


def test_sums_go_to_the_receiver_and_in_the_other_order_to_the_sender():
    _, graph = water(30)
    values = torch.randn(len(graph.features), 2)
    near = graph.neighborhood
    for order, ends in ((graph.order, near.receivers), (graph.order_by_sender, near.senders)):
        torch.testing.assert_close(graph.sums(values, order), torch.zeros(30, 2).index_add(0, ends, values))
