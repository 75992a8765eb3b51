"""SIREN: one shape as a network of sine layers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from surfsup.checked.tensors import finite_number, load_weights, whole_number
from surfsup.sdf.grid import SdfGrid
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.native_layers import NativeLayers
from surfsup.sdf.neural.shipped_surfaces import surface_path
from surfsup.sdf.neural.sine_network import SineNetwork
from surfsup.sdf.neural.surface import NeuralSurface
from surfsup.sdf.surface import Surface
from surfsup.sdf.transform import Transformed

MAX_LAYERS = 100
CHUNK = 4096  # points per evaluation, so that the activations of a layer stay in the processor's cache


@dataclass(frozen=True)
class SirenSizes:
    """The architecture of a :class:`SineNetwork`, see there."""

    width: int = 128
    layers: int = 3
    frequency: float = 30.0

    def network(self) -> SineNetwork:
        """A network of these sizes, with random weights."""
        return SineNetwork(self.width, self.layers, self.frequency)


@dataclass(frozen=True)
class Normalization:
    """The map of a shape into the cube of side 2 around the origin: x -> (x - center) · scale.

    Attributes:
        center: Center of the shape's bounding box, in its original units.
        scale: 2 over the largest extent.
    """

    center: tuple[float, float, float]
    scale: float


class SirenSurface(NeuralSurface):
    """A solid fitted by ``network``, in a cube of side 2 around the origin.

    :class:`Transformed` places it at any size: F_s(p) = s · F(p / s) (supplement, section 5.5).

    Args:
        network: Negative inside the solid.
        bounds: (2, 3) a box that contains the solid.
        grid: Distances far from the solid; None to evaluate the network everywhere.
        normalization: How the input was mapped into the cube.
        about: Data, command, time and errors of the fit, as text by name.
    """

    def __init__(
        self,
        network: SineNetwork,
        bounds: Tensor,
        grid: SdfGrid | None = None,
        normalization: Normalization | None = None,
        about: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(bounds, grid)
        self.network = network
        self.normalization = normalization or Normalization((0.0, 0.0, 0.0), 1.0)
        self.about = about or {}

    def value_and_gradient(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """The network's value (N,) and gradient (N, 3)."""
        if len(points) <= CHUNK:
            return self.network.value_and_gradient(points)
        values, gradients = zip(*map(self.network.value_and_gradient, points.split(CHUNK)), strict=True)
        return torch.cat(values), torch.cat(gradients)

    def value(self, points: Tensor) -> Tensor:
        """The network's value (N,)."""
        return torch.cat([self.network.value(part) for part in points.split(CHUNK)])

    def native_layers(self) -> NativeLayers:
        """The layers for the native code."""
        return self.network.native_layers()

    def in_original_units(self) -> Surface:
        """The solid at the position and in the units of the mesh or point cloud that it was fitted to."""
        return Transformed(self, None, self.normalization.center, 1 / self.normalization.scale)


def save_siren(path: Path, surface: SirenSurface) -> None:
    """Write ``surface`` to ``path``; the distances of its grid in half precision.

    Raises:
        InputError: The disk is full or not writable.
    """
    network, grid = surface.network, surface.grid
    sizes = SirenSizes(network.width, network.layers, network.frequency)
    tensors = {f"network.{name}": value for name, value in network.state_dict().items()}
    tensors["bounds"] = surface.box
    header: dict[str, Any] = {"sizes": asdict(sizes), "cube": asdict(surface.normalization), "about": surface.about}
    if grid is not None:
        tensors |= {"lattice.values": grid.node_distance.half(), "lattice.lower": grid.lower}
        header["cell"] = grid.cell
    surface_file.write(path, surface_file.SIREN, header, tensors)


def load_siren(path: Path) -> SirenSurface:
    """The surface in ``path``, a file or the name of a shipped surface; no tensor of it requires a gradient.

    Raises:
        InputError: The file is missing, truncated, not a SIREN, or its tensors do not fit its architecture.
    """
    header, tensors = surface_file.read(surface_path(path), surface_file.SIREN)
    try:
        sizes = SirenSizes(**header["sizes"])
        whole_number("layers", sizes.layers, 1, MAX_LAYERS)
        finite_number("frequency", sizes.frequency, 1e-3, 1e4)
        weights = surface_file.with_prefix(tensors, "network.")
        if sizes.width != len(weights["last"]) or sizes.layers >= len(weights):
            raise ValueError(f"the header gives {sizes}")
        network = sizes.network()
        load_weights(network, weights)
        grid = None
        if "cell" in header or tensors.keys() & {"lattice.values", "lattice.lower"}:
            grid = surface_file.checked_grid(tensors["lattice.values"], tensors["lattice.lower"], header["cell"])
        bounds = surface_file.checked_bounds(tensors["bounds"])
        surface = SirenSurface(network, bounds, grid, normalization(header["cube"]), header["about"])
    except (KeyError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise surface_file.architecture_error(path, error) from None
    return surface.eval().requires_grad_(False)


def normalization(header: dict[str, Any]) -> Normalization:
    """The normalization in a file's header; version 0.1 wrote ``centre``."""
    x, y, z = (finite_number("the center", value) for value in header.get("center") or header["centre"])
    return Normalization((x, y, z), finite_number("the scale", header["scale"], 1e-30, 1e30))
