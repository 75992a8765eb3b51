"""SIREN: one shape as a network of sine layers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from surfsup.sdf.grid import Lattice
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.native_layers import NativeLayers
from surfsup.sdf.neural.shipped_surfaces import resolve
from surfsup.sdf.neural.sine_network import SineNetwork
from surfsup.sdf.neural.surface import NeuralSurface
from surfsup.sdf.surface import Surface
from surfsup.sdf.transform import Transformed

CHUNK = 4096  # points at once: what a layer writes stays in the processor's cache


@dataclass(frozen=True)
class SirenSizes:
    """What the network is made of.

    Attributes:
        width, layers, frequency: see :class:`SineNetwork`.
    """

    width: int = 128
    layers: int = 3
    frequency: float = 30.0

    def network(self) -> SineNetwork:
        """A network of these sizes, with random weights."""
        return SineNetwork(self.width, self.layers, self.frequency)


@dataclass(frozen=True)
class Cube:
    """How a shape was moved and scaled into the cube of side 2: x -> (x - center) · scale.

    Attributes:
        center: of its box, in its own unit.
        scale: 2 over its largest extent.
    """

    center: tuple[float, float, float]
    scale: float


class SirenSurface(NeuralSurface):
    """A solid fitted by ``network``, in a cube of side 2 around the origin.

    Put it at any size with :class:`Transformed`: F_s(p) = s · F(p / s) (supplement, section 5.5).

    Args:
        network: negative inside.
        bounds: (2, 3) a box that holds the solid.
        lattice: distances far from it; None leaves all to the network.
        cube: where it came from.
        about: data, command, time and errors, as text by name.
    """

    def __init__(
        self,
        network: SineNetwork,
        bounds: Tensor,
        lattice: Lattice | None = None,
        cube: Cube | None = None,
        about: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(bounds, lattice)
        self.network = network
        self.cube = cube or Cube((0.0, 0.0, 0.0), 1.0)
        self.about = about or {}

    def field(self, points: Tensor) -> tuple[Tensor, Tensor]:
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

    def in_own_unit(self) -> Surface:
        """The solid where the mesh or the cloud was that it was fitted to, in that one's unit."""
        return Transformed(self, None, self.cube.center, 1 / self.cube.scale)


def save_siren(path: Path, surface: SirenSurface) -> None:
    """Write ``surface`` to ``path``; the lattice's distances in half precision.

    Raises:
        InputError: the disk is full or not writable.
    """
    network, lattice = surface.network, surface.lattice
    sizes = SirenSizes(network.width, network.layers, network.frequency)
    tensors = {f"network.{name}": value for name, value in network.state_dict().items()}
    tensors["bounds"] = surface.box
    header = {"sizes": asdict(sizes), "cube": asdict(surface.cube), "about": surface.about}
    if lattice is not None:
        tensors |= {"lattice.values": lattice.values().half(), "lattice.lower": lattice.lower}
        header["cell"] = lattice.cell
    surface_file.write(path, surface_file.SIREN, header, tensors)


def load_siren(path: Path) -> SirenSurface:
    """The surface in ``path``, a file or the name of a shipped one, ready to be asked.

    Raises:
        InputError: the file is missing, cut off, not one of a SIREN, or its tensors are those of another architecture.
    """
    header, tensors = surface_file.read(resolve(path), surface_file.SIREN)
    try:
        sizes = SirenSizes(**header["sizes"])
        weights = surface_file.part(tensors, "network.")
        if sizes.width != len(weights["last"]) or sizes.layers >= len(weights):
            raise ValueError(f"the header says {sizes}")
        network = sizes.network()
        network.load_state_dict(weights)
        lattice = None
        if "lattice.values" in tensors:
            lattice = Lattice(tensors["lattice.values"], tensors["lattice.lower"], float(header["cell"]))
        cube = Cube(tuple(header["cube"].get("center") or header["cube"]["centre"]), float(header["cube"]["scale"]))
        surface = SirenSurface(network, tensors["bounds"].reshape(2, 3), lattice, cube, header["about"])
    except (KeyError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise surface_file.misfit(path, error) from None
    return surface.eval().requires_grad_(False)
