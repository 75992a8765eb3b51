"""The network in torch; test_native_layers.py has the same in C++."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup import native
from surfsup.learned.message_passing.graph import EdgeGraph, batch_graphs, build_graph
from surfsup.learned.message_passing.network import MessagePassingNetwork
from surfsup.sph.neighbor_search import NeighborList, find_neighbors
from tests.learned.message_passing.plain import plain_network


def network(inputs=5, outputs=3, width=16, layers=3, seed=0, dtype=torch.float32) -> MessagePassingNetwork:
    torch.manual_seed(seed)
    model = MessagePassingNetwork(inputs, outputs, width, layers).to(dtype)
    for name, parameter in model.named_parameters():
        if "norm" in name:  # the initial ones and zeros would hide most faults
            torch.nn.init.normal_(parameter)
    return model


def water(count: int, seed: int = 0, dtype=torch.float32) -> tuple[torch.Tensor, EdgeGraph]:
    random = torch.Generator().manual_seed(seed)
    positions = torch.rand(count, 3, generator=random, dtype=dtype)
    features = torch.randn(count, 5, generator=random, dtype=dtype)
    return features, build_graph(positions, find_neighbors(positions, 0.4), 0.4)


def test_the_network_equals_plain_torch_at_the_size_of_the_paper(monkeypatch):
    monkeypatch.setattr(native, "instruction_sets", list)
    model = network(width=128, layers=10)
    features, graph = water(300)
    with torch.no_grad():
        torch.testing.assert_close(model(features, graph), plain_network(model, features, graph), atol=1e-5, rtol=1e-5)


@settings(max_examples=20)
@given(st.integers(1, 40), st.integers(1, 24), st.integers(1, 3), st.integers(0, 2**31))
def test_the_network_equals_plain_torch_at_any_size(count, width, layers, seed):
    model = network(width=width, layers=layers, seed=seed, dtype=torch.float64)
    features, graph = water(count, seed, torch.float64)
    torch.testing.assert_close(model(features, graph), plain_network(model, features, graph))


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float64, 1e-9), (torch.float32, 1e-3)])
def test_gradients_equal_those_of_plain_torch(monkeypatch, dtype, tolerance):
    monkeypatch.setattr(native, "instruction_sets", list)
    model = network(dtype=dtype)
    features, graph = water(50, dtype=dtype)
    features.requires_grad_()
    inputs = [features, *model.parameters()]
    losses = [run(features, graph).square().sum() for run in (model, lambda *given: plain_network(model, *given))]
    ours, plain = (torch.autograd.grad(loss, inputs, allow_unused=True) for loss in losses)
    for one, other in zip(ours, plain, strict=True):
        torch.testing.assert_close(one, other, atol=tolerance * float(other.abs().max()), rtol=tolerance)


def test_gradients_in_features_positions_and_weights_equal_finite_differences():
    model = network(width=6, layers=2, dtype=torch.float64)
    features, graph = water(7, dtype=torch.float64)
    positions = torch.rand(7, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    names, weights = zip(*model.named_parameters(), strict=True)

    def run(features, positions, *weights):
        moved = build_graph(positions, graph.neighbors, 0.4)
        return torch.func.functional_call(model, dict(zip(names, weights, strict=True)), (features, moved))

    inputs = [value.detach().requires_grad_() for value in (features, positions, *weights)]
    assert torch.autograd.gradcheck(run, inputs, fast_mode=True)


def test_the_order_of_particles_does_not_matter():
    model = network(dtype=torch.float64)
    positions = torch.rand(60, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(4))
    features, order = torch.randn(60, 5, dtype=torch.float64), torch.randperm(60)

    def run(positions, features):
        return model(features, build_graph(positions, find_neighbors(positions, 0.3), 0.3))

    torch.testing.assert_close(run(positions[order], features[order]), run(positions, features)[order])


def test_a_batch_of_graphs_gives_the_outputs_of_each_graph_alone():
    model = network(dtype=torch.float64)
    parts = [water(count, count, torch.float64) for count in (12, 1, 30)]
    batched = model(torch.cat([features for features, _ in parts]), batch_graphs([graph for _, graph in parts]))
    torch.testing.assert_close(batched, torch.cat([model(*part) for part in parts]))


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("instruction_sets", [native.instruction_sets, list])
def test_isolated_particles_have_no_edges(monkeypatch, instruction_sets, count):
    monkeypatch.setattr(native, "instruction_sets", instruction_sets)
    model, positions = network(), torch.arange(count)[:, None] * torch.ones(3)
    graph = build_graph(positions, find_neighbors(positions, 0.5), 0.5)
    out = model(torch.randn(count, 5), graph)
    assert torch.isfinite(out).all()
    out.sum().backward()


def test_bf16_is_close_and_gives_full_precision_gradients(monkeypatch):
    monkeypatch.setattr(native, "instruction_sets", list)
    model = network(width=64, layers=5)
    features, graph = water(200)
    exact = model(features, graph)
    with torch.autocast("cpu", torch.bfloat16):
        rounded = model(features, graph)
    assert rounded.dtype == torch.float32
    assert 0 < (rounded - exact).square().mean().sqrt() < 0.03 * exact.std()
    rounded.square().sum().backward()
    assert all(parameter.grad.dtype == torch.float32 for parameter in model.decoder.parameters())


def test_edge_features_are_displacement_and_length_in_units_of_the_radius():
    near = NeighborList(torch.tensor([0, 1, 2]), torch.tensor([0, 1]), torch.tensor([1, 0]))
    graph = build_graph(torch.tensor([[0.0, 0.0, 0.0], [0.03, 0.04, 0.0]]), near, 0.1)
    torch.testing.assert_close(graph.edge_features, torch.tensor([[0.3, 0.4, 0.0, 0.5], [-0.3, -0.4, 0.0, 0.5]]))


def test_edges_are_summed_by_receiver_or_by_sender():
    _, graph = water(30)
    values = torch.randn(len(graph.edge_features), 2)
    near = graph.neighbors
    for order, ends in ((graph.order_by_receiver, near.receivers), (graph.order_by_sender, near.senders)):
        torch.testing.assert_close(graph.sum_edges(values, order), torch.zeros(30, 2).index_add(0, ends, values))
