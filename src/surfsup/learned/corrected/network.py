"""The network: particle features in, one pressure per particle out.

It has no biases, and SiLU is zero at zero. So the correction is exactly zero where all particle features are, within
as many hops as there are layers, and free fall remains free fall. Neighborhood features act as factors only.
"""

from __future__ import annotations

from torch import Tensor, nn

from surfsup.learned.corrected.convolution import convolve
from surfsup.learned.corrected.features import NEIGHBORHOOD_FEATURES, PARTICLE_FEATURES
from surfsup.sph.kernel_sums import KERNELS, KernelGraph

FACTORS_WIDTH = 16  # hidden channels from neighborhood features to factors; more did not help (measured)


class ConvolutionLayer(nn.Module):
    """One step of message passing: neighbor convolution, SiLU, linear map, residual connection."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.mix = nn.Linear(width, KERNELS * width, bias=False)
        self.self_weight = nn.Linear(width, width, bias=False)
        self.out = nn.Linear(width, width, bias=False)

    def forward(self, hidden: Tensor, graph: KernelGraph) -> Tensor:
        """(N, width) -> (N, width)."""
        received = convolve(hidden, self.mix.weight, self.self_weight.weight, graph)
        return hidden + self.out(nn.functional.silu(received))


class ConvolutionNetwork(nn.Module):
    """Encoder, ``layers`` neighbor convolutions of ``width`` channels, decoder to one number per particle."""

    def __init__(self, width: int, layers: int) -> None:
        super().__init__()
        self.encoder = nn.Sequential(nn.Linear(PARTICLE_FEATURES, width, bias=False), nn.SiLU())
        self.factors = nn.Sequential(
            nn.Linear(NEIGHBORHOOD_FEATURES, FACTORS_WIDTH), nn.SiLU(), nn.Linear(FACTORS_WIDTH, 2 * width)
        )
        self.layers = nn.ModuleList(ConvolutionLayer(width) for _ in range(layers))
        readout = nn.Linear(width, 1, bias=False)
        self.decoder = nn.Sequential(nn.Linear(width, width, bias=False), nn.SiLU(), readout)
        nn.init.normal_(readout.weight, std=1e-2)  # small: an untrained simulator is close to the solver

    def forward(self, particle_features: Tensor, neighborhood_features: Tensor, graph: KernelGraph) -> Tensor:
        """Features (N, 14) and (N, 6) -> (N,)."""
        first, last = (1 + self.factors(neighborhood_features)).chunk(2, dim=-1)
        hidden = self.encoder(particle_features) * first
        for layer in self.layers:
            hidden = layer(hidden, graph)
        return self.decoder(hidden * last)[:, 0]
