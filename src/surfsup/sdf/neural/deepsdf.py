"""DeepSDF: many shapes as one network and a latent code each."""

from __future__ import annotations

import difflib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from surfsup.errors import InputError
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.code_network import CodeNetwork, CodeSizes
from surfsup.sdf.neural.native_layers import NativeLayers
from surfsup.sdf.neural.shipped_surfaces import resolve
from surfsup.sdf.neural.surface import NeuralSurface

REACH = 1.06  # of the cube [-1, 1]³: where the zero set of any code is looked for
CHUNK = 8192  # points at once
MOST_OCTAVES = 16  # beyond, single precision hardly tells a place's sine from its neighbor's


class DeepSdfSurface(NeuralSurface):
    """The solid of one latent ``code``, in a cube of side 2 around the origin; differentiable in points and code.

    Its layers are linear between kinks, so that the normal counts as constant in the code, as beside a flat face.
    The network knows distances up to 0.1; beyond, its value only says that the surface is farther. Give it a lattice
    (:meth:`with_lattice`) where distances matter there. A lattice belongs to the code that it was made of.

    Args:
        network: of all shapes.
        code: (C,); one that requires a gradient gets it.
    """

    def __init__(self, network: CodeNetwork, code: Tensor) -> None:
        super().__init__(torch.tensor([[-REACH] * 3, [REACH] * 3]), None)
        self.network = network
        self.code: Tensor
        if isinstance(code, nn.Parameter):
            self.code = code
        else:
            self.register_buffer("code", code)

    def field(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """The network's value (N,) and gradient (N, 3)."""
        parts = [self.network.value_and_gradient(part, self.code) for part in points.split(CHUNK)]
        values, gradients = zip(*parts, strict=True)
        return torch.cat(values), torch.cat(gradients)

    def value(self, points: Tensor) -> Tensor:
        """The network's value (N,)."""
        code = self.code[None]
        return torch.cat([self.network.value(part[None], code)[0] for part in points.split(CHUNK)])

    def native_layers(self) -> NativeLayers | None:
        """The layers for the native code, unless it would not tell the fastest sines."""
        return self.network.native_layers(self.code) if self.network.sizes.octaves <= MOST_OCTAVES else None


class DeepSdf(nn.Module):
    """A network and the codes of the shapes that it was fitted to.

    Args:
        network: of all shapes.
        codes: (S, C).
        names: of the S shapes.
        about: data, command, time and errors, as text by name.
        source: what to call it in a complaint, usually the file's name.
    """

    def __init__(
        self,
        network: CodeNetwork,
        codes: Tensor,
        names: list[str],
        about: dict[str, Any] | None = None,
        source: str = "deepsdf",
    ) -> None:
        super().__init__()
        self.network, self.names = network, names
        self.register_buffer("codes", codes)
        self.about, self.source = about or {}, source

    def code(self, name: str | None = None) -> Tensor:
        """The code (C,) of the shape ``name``; of the only one where there is but one.

        Raises:
            InputError: there is no such shape, or several and no name is given.
        """
        if name is None and len(self.names) == 1:
            return self.codes[0]
        if name is None:
            raise InputError(
                f"{self.source}: holds {len(self.names)} shapes; choose one by its name, as '{self.names[0]}'"
            )
        if name not in self.names:
            near = difflib.get_close_matches(name, self.names, n=1) or self.names[:1]
            raise InputError(f"{self.source}: has no shape '{name}'; did you mean '{near[0]}'?")
        return self.codes[self.names.index(name)]

    def surface(self, code: Tensor) -> DeepSdfSurface:
        """The solid of ``code`` (C,).

        Raises:
            InputError: it is of another length, or not finite.
        """
        length = self.network.sizes.code
        if tuple(code.shape) != (length,):
            raise InputError(f"{self.source}: a code of it is {length} numbers, but {tuple(code.shape)} were given")
        if not bool(torch.isfinite(code.detach()).all()):
            raise InputError(f"{self.source}: the code has numbers that are not finite")
        return DeepSdfSurface(self.network, code)


def save_deepsdf(path: Path, shapes: DeepSdf) -> None:
    """Write network, codes and names to ``path``.

    Raises:
        InputError: the disk is full or not writable.
    """
    tensors = {f"network.{name}": value for name, value in shapes.network.state_dict().items()}
    header = {"sizes": asdict(shapes.network.sizes), "names": shapes.names, "about": shapes.about}
    surface_file.write(path, surface_file.DEEPSDF, header, {**tensors, "codes": shapes.codes})


def load_deepsdf(path: Path) -> DeepSdf:
    """The shapes in ``path``, a file or the name of a shipped one.

    Raises:
        InputError: the file is missing, cut off, not one of a DeepSDF, or its tensors are those of another
            architecture.
    """
    header, tensors = surface_file.read(resolve(path), surface_file.DEEPSDF)
    try:
        sizes, weights, codes = CodeSizes(**header["sizes"]), surface_file.part(tensors, "network."), tensors["codes"]
        fitting = (sizes.width, sizes.code) == (weights["last.weight"].shape[1], codes.shape[1])
        if not fitting or sizes.layers > len(weights) or sizes.octaves > MOST_OCTAVES:
            raise ValueError(f"the header says {sizes}")
        names = [str(name) for name in header["names"]]
        if len(names) != len(codes) or not names:
            raise ValueError(f"{len(names)} names for {len(codes)} codes")
        network = CodeNetwork(sizes)
        network.load_state_dict(weights)
        shapes = DeepSdf(network, codes, names, header["about"], str(path))
    except (KeyError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise surface_file.misfit(path, error) from None
    return shapes.eval().requires_grad_(False)
