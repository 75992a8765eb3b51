"""The network: what acts on the particles in, a number for each particle out, from which its pressure is made.

It has no biases, and SiLU is zero at zero: where nothing acts, within as many hops as there are layers, the
correction is exactly zero, and a free fall stays one. How the neighbors lie is told by factors, not by terms.
"""

from __future__ import annotations

from torch import Tensor, nn

from surfsup.sph.kernel_sums import KERNELS, Graph, convolve

FACTORS_WIDTH = 16  # channels between how neighbors lie and the factors: six numbers need no more (measured)


class Layer(nn.Module):
    """One step of message passing: a convolution over neighbors, then a small perceptron, then a skip."""

    def __init__(self, width: int, messages: int) -> None:
        super().__init__()
        self.mix = nn.Linear(messages, KERNELS * width, bias=False)
        self.own = nn.Linear(width, width, bias=False)
        self.out = nn.Linear(width, width, bias=False)

    def forward(self, hidden: Tensor, graph: Graph) -> Tensor:
        """(N, width) -> (N, width)."""
        received = convolve(hidden, self.mix.weight, self.own.weight, graph)
        return hidden + self.out(nn.functional.silu(received))


class ConvolutionNetwork(nn.Module):
    """Encoder, ``layers`` steps of message passing of ``width`` channels, decoder.

    A particle's neighbors are told of its first ``messages`` channels only: what is told costs four times as much as
    what is kept.
    """

    def __init__(self, actions: int, surroundings: int, outputs: int, width: int, layers: int, messages: int) -> None:
        super().__init__()
        self.encoder = nn.Sequential(nn.Linear(actions, width, bias=False), nn.SiLU())
        self.factors = nn.Sequential(
            nn.Linear(surroundings, FACTORS_WIDTH), nn.SiLU(), nn.Linear(FACTORS_WIDTH, 2 * width)
        )
        self.layers = nn.ModuleList(Layer(width, messages) for _ in range(layers))
        self.decoder = nn.Sequential(
            nn.Linear(width, width, bias=False), nn.SiLU(), nn.Linear(width, outputs, bias=False)
        )
        # The decoder starts small: an untrained model is close to the rule alone.
        nn.init.normal_(self.decoder[-1].weight, std=1e-2)

    def forward(self, actions: Tensor, surroundings: Tensor, graph: Graph) -> Tensor:
        """What acts (N, actions) and how the neighbors lie (N, surroundings) -> (N, outputs)."""
        first, last = (1 + self.factors(surroundings)).chunk(2, dim=-1)
        hidden = self.encoder(actions) * first
        for layer in self.layers:
            hidden = layer(hidden, graph)
        return self.decoder(hidden * last)
