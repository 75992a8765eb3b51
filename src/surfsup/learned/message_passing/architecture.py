"""The sizes of a message-passing network."""

from __future__ import annotations

from dataclasses import dataclass

MAX_RADIUS = 0.15  # meters: some 500 neighbors a particle; beyond it, the edges of a few thousand fill a memory


@dataclass(frozen=True)
class MessagePassingArchitecture:
    """The sizes of a message-passing simulator. They are saved with its weights; the defaults are the paper's.

    The paper does not give the radius. With 0.045 a particle in a lattice of spacing 0.03 has about nine neighbors, and
    the radius keeps clear of the lattice distances 0.0424 and 0.052, where rounding would decide.

    Attributes:
        width: channels of the latent vectors on nodes and edges.
        layers: message-passing steps of the processor, each with its own weights.
        radius: connectivity radius in meters.
        features: version of the node features. In version 1, that of weights of format 5, distances to walls are
            clipped to the radius, and the gradient of the signed distance does not fade.

    Raises:
        ValueError: a size is out of range; the message names it.
    """

    width: int = 128
    layers: int = 10
    radius: float = 0.045
    features: int = 2

    def __post_init__(self) -> None:
        require_count("width", self.width, 4096)
        require_count("layers", self.layers, 100)
        if not isinstance(self.radius, float) or not 0 < self.radius <= MAX_RADIUS:
            raise ValueError(f"radius is {self.radius!r}, which is not from 0 to {MAX_RADIUS:g} m")
        require_count("features", self.features, 2)


def require_count(name: str, value: object, maximum: int) -> None:
    """Check that ``value`` is an integer from 1 to ``maximum``.

    Raises:
        ValueError: it is not; the message names it.
    """
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= maximum:
        raise ValueError(f"{name} is {value!r}")


SIZES = {
    "paper": {"width": 128, "layers": 10},
    "small": {"width": 64, "layers": 5},
}
