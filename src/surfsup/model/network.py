"""The network: particles' features in, a correction for each particle out."""

from __future__ import annotations

from torch import Tensor, nn

from surfsup.model.convolution import KERNELS, Gather, Graph


class Layer(nn.Module):
    """One step of message passing: a convolution over neighbours, then a small perceptron, then a skip."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.mix = nn.Linear(width, KERNELS * width, bias=False)
        self.own = nn.Linear(width, width)
        self.out = nn.Linear(width, width)

    def forward(self, hidden: Tensor, graph: Graph) -> Tensor:
        """(N, width) -> (N, width)."""
        count, width = hidden.shape
        mixed = self.mix(hidden).reshape(count, KERNELS, width)
        received = Gather.apply(mixed, graph.kernels, graph)
        return hidden + self.out(nn.functional.silu(received + self.own(hidden)))


class ConvolutionNetwork(nn.Module):
    """Encoder, ``layers`` steps of message passing of ``width`` channels, decoder."""

    def __init__(self, inputs: int, outputs: int, width: int, layers: int) -> None:
        super().__init__()
        self.encoder = nn.Sequential(nn.Linear(inputs, width), nn.SiLU(), nn.Linear(width, width))
        self.layers = nn.ModuleList(Layer(width) for _ in range(layers))
        self.decoder = nn.Sequential(nn.Linear(width, width), nn.SiLU(), nn.Linear(width, outputs))
        # The decoder starts small: an untrained model is close to ballistic motion.
        nn.init.normal_(self.decoder[-1].weight, std=1e-3)

    def forward(self, features: Tensor, graph: Graph) -> Tensor:
        """(N, inputs) -> (N, outputs)."""
        hidden = self.encoder(features)
        for layer in self.layers:
            hidden = layer(hidden, graph)
        return self.decoder(hidden)
