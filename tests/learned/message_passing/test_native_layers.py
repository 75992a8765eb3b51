"""The network in C++ equals plain torch in double precision, for every instruction set of this processor."""

import numpy as np
import pytest
import torch

from surfsup import native
from surfsup.learned.message_passing.graph import EdgeGraph, build_graph
from surfsup.learned.message_passing.native_layers import Weights, apply_to_edges, native_precision
from surfsup.learned.message_passing.network import MessagePassingNetwork
from surfsup.sph.neighbor_search import NeighborList, find_neighbors
from tests.learned.message_passing.plain import plain_network

pytestmark = pytest.mark.skipif(not native.instruction_sets(), reason="the package was built without a compiler")
INPUTS = 5
with_bfloat16 = [isa for isa in native.instruction_sets() if native.has_bfloat16(isa)]
without_bfloat16 = [isa for isa in native.instruction_sets() if not native.has_bfloat16(isa)]


def network(width: int, layers: int = 2) -> MessagePassingNetwork:
    torch.manual_seed(width)
    model = MessagePassingNetwork(INPUTS, 3, width, layers)
    for name, parameter in model.named_parameters():
        if "norm" in name:  # the initial ones and zeros would hide most faults
            torch.nn.init.normal_(parameter, mean=1.0)
    return model


def water(count: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Features and positions; about nine neighbors within a radius of 1."""
    random = torch.Generator().manual_seed(count)
    positions = torch.rand(count, 3, generator=random) * (count / 2.15) ** (1 / 3)
    return torch.randn(count, INPUTS, generator=random), positions


def graph_of(positions: torch.Tensor) -> EdgeGraph:
    return build_graph(positions, find_neighbors(positions, 1.0), 1.0)


def results(run, model, features, positions) -> list[torch.Tensor]:
    """Outputs, and the gradients of a function of them in features, positions and weights."""
    inputs = [features.requires_grad_(), positions.requires_grad_(), *model.parameters()]
    out = run(features, graph_of(positions))
    return [
        out.detach(),
        *torch.autograd.grad((out * torch.linspace(-1, 1, 3, dtype=out.dtype)).square().sum(), inputs),
    ]


def exact_results(model: MessagePassingNetwork, count: int) -> list[torch.Tensor]:
    features, positions = (values.double() for values in water(count))
    precise = network(model.width, len(model.processor)).double()
    return results(lambda *given: plain_network(precise, *given), precise, features, positions)


def assert_close(ours: list[torch.Tensor], exact: list[torch.Tensor], error: float) -> None:
    """The root mean square error of every tensor is at most ``error`` times its root mean square."""
    for one, other in zip(ours, exact, strict=True):
        assert one.dtype == torch.float32
        scale = other.square().mean().sqrt() + 1e-6
        assert (one - other).square().mean().sqrt() < error * scale


@pytest.mark.parametrize("isa", native.instruction_sets())
@pytest.mark.parametrize(("width", "count"), [(16, 1), (16, 2), (48, 30), (64, 400), (128, 150)])
def test_outputs_and_all_gradients_equal_plain_torch(monkeypatch, isa, width, count):
    monkeypatch.setattr(native, "instruction_sets", lambda: [isa])
    model = network(width)
    assert_close(results(model, model, *water(count)), exact_results(model, count), 2e-5)


@pytest.mark.parametrize("isa", with_bfloat16)
@pytest.mark.parametrize(("width", "count"), [(16, 2), (64, 400), (128, 150)])
def test_bfloat16_is_close(monkeypatch, isa, width, count):
    monkeypatch.setattr(native, "instruction_sets", lambda: [isa])
    model = network(width)
    with torch.autocast("cpu", torch.bfloat16):
        ours = results(model, model, *water(count))
    exact = exact_results(model, count)
    assert_close(ours[:1], exact[:1], 0.01)
    assert_close(ours[1:3], exact[1:3], 0.2)  # features and positions: a ReLU that flips counts much
    assert_close(ours[3:], exact[3:], 0.03)


@pytest.mark.parametrize("isa", without_bfloat16)
def test_without_a_dot_product_of_bfloat16_autocast_computes_in_single_precision(monkeypatch, isa):
    monkeypatch.setattr(native, "instruction_sets", lambda: [isa])
    model, (features, positions) = network(16), water(40)
    with torch.no_grad():
        plain = model(features, graph_of(positions))
        with torch.autocast("cpu", torch.bfloat16):
            assert torch.equal(model(features, graph_of(positions)), plain)


@pytest.mark.parametrize("isa", native.instruction_sets())
def test_nothing_depends_on_recording_gradients(monkeypatch, isa):
    monkeypatch.setattr(native, "instruction_sets", lambda: [isa])
    model, (features, positions) = network(64), water(100)
    with torch.no_grad():
        alone = model(features, graph_of(positions))
    assert torch.equal(model(features, graph_of(positions)), alone)


@pytest.mark.parametrize("precision", [torch.float32, torch.bfloat16])
def test_results_do_not_depend_on_the_number_of_threads(precision):
    threads, runs = torch.get_num_threads(), []
    try:
        for number in (1, 3):
            torch.set_num_threads(number)
            runs.append(one_step(precision))
    finally:
        torch.set_num_threads(threads)
    assert all(torch.equal(one, other) for one, other in zip(*runs, strict=True))


def one_step(precision: torch.dtype) -> list[torch.Tensor]:
    """The edges of a step and their gradients. What torch computes may depend on the number of threads."""
    model, (features, positions) = network(64, layers=1), water(1000)
    mlp, graph = model.processor[0].edge_mlp, graph_of(positions)
    precision = native_precision(features, 64, precision)
    edges = model.edge_encoder.forward_native(graph.edge_features, torch.float32, precision, precision)
    endpoints = torch.linspace(-1, 1, 128 * len(features)).reshape(-1, 128).to(precision).requires_grad_()
    weights = mlp.native_weights(mlp.hidden_2.weight, None)
    received, new_edges = apply_to_edges(endpoints, edges, weights, 1e-5, graph, True)
    loss = received.square().sum() + new_edges.float().square().sum()
    inputs = [endpoints, mlp.hidden_2.weight, mlp.norm.weight, *model.edge_encoder.parameters()]
    return [received, new_edges, *torch.autograd.grad(loss, inputs)]


@pytest.mark.parametrize(
    ("features", "width", "precision"),
    [
        (torch.zeros(2, 5, dtype=torch.float64), 64, torch.float64),
        (torch.zeros(2, 5, device="meta"), 64, torch.float32),
        (torch.zeros(2, 5), 24, torch.float32),
        (torch.zeros(2, 5), 64, torch.float16),
    ],
)
def test_torch_computes_what_the_native_code_does_not(features, width, precision):
    assert native_precision(features, width, precision) is None


def arguments(width=16, nodes=2) -> dict:
    """Those of ``native.edges_forward`` for two nodes that are neighbors."""
    square, vector = np.zeros((width, width), np.float32), np.zeros(width, np.float32)
    return {
        "starts": np.array([0, 1, 2]),
        "senders": np.array([1, 0]),
        "endpoints": np.zeros((nodes, 2 * width), np.float32),
        "edges": np.zeros((2, width), np.float32),
        "weights": (square, None, square, vector, square, vector, vector, vector),
        "epsilon": 1e-5,
        "kept": None,
        "received": np.zeros((2, width), np.float32),
        "new_edges": None,
        "isa": next(iter(native.instruction_sets()), "none"),
        "threads": 1,
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (arguments(width=24), "multiple of 16"),
        (arguments(nodes=3), "endpoints"),
        ({"edges": np.zeros((2, 32), np.float32)}, "edges"),
        ({"edges": np.zeros((2, 16), np.float64)}, "float32"),
        ({"starts": np.array([0, 1, 3])}, "number of edges"),
        ({"isa": "cray"}, "does not support"),
    ],
)
def test_sizes_that_do_not_fit_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        native.edges_forward(**{**arguments(), **change})


@pytest.mark.parametrize("isa", without_bfloat16)
def test_bfloat16_is_refused_where_there_is_none(isa):
    bits = {name: arguments()[name].astype(np.uint16) for name in ("endpoints", "edges")}
    with pytest.raises(ValueError, match="no bfloat16"):
        native.edges_forward(**{**arguments(), **bits, "isa": isa})


def test_a_backward_pass_needs_the_reverse_of_every_edge():
    graph = EdgeGraph(
        NeighborList(torch.tensor([0, 1, 2]), torch.tensor([0, 1]), torch.tensor([1, 1])), torch.zeros(2, 4)
    )
    weights = Weights(*(None if value is None else torch.from_numpy(value) for value in arguments()["weights"]))
    endpoints = torch.zeros(2, 32, requires_grad=True)
    received, _ = apply_to_edges(endpoints, torch.zeros(2, 16), weights, 1e-5, graph, False)
    with pytest.raises(ValueError, match="no reverse"):
        received.sum().backward()
