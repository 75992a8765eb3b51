"""DeepSDF: many shapes as one network and a latent code each."""

from __future__ import annotations

import difflib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from surfsup.checked.tensors import load_weights, whole_number
from surfsup.errors import InputError
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.deepsdf_decoder import DecoderSizes, DeepSdfDecoder
from surfsup.sdf.neural.native_layers import NativeLayers
from surfsup.sdf.neural.shipped_surfaces import surface_path
from surfsup.sdf.neural.surface import NeuralSurface

REACH = 1.06  # half the side of the cube in which the zero set of any code is extracted
CHUNK = 8192  # points per evaluation
MAX_SIZE = 1 << 14
MAX_OCTAVES = 16  # beyond it, single precision hardly resolves the sine of a position


class DeepSdfSurface(NeuralSurface):
    """The solid of one latent ``code``, in a cube of side 2 around the origin; differentiable in points and code.

    The layers are piecewise linear. Hence the normal is treated as constant in the code. The network knows distances
    up to 0.1; beyond, its value only says that the surface is not near. Where such distances matter, add a grid
    with :meth:`with_grid`. A grid belongs to the code that it was built from.

    Args:
        network: The decoder of all shapes.
        code: (C,) latent code; one that requires a gradient receives it.
    """

    code: Tensor

    def __init__(self, network: DeepSdfDecoder, code: Tensor) -> None:
        super().__init__(torch.tensor([[-REACH] * 3, [REACH] * 3]), None)
        self.network = network
        if isinstance(code, nn.Parameter):
            self.code = code
        else:
            self.register_buffer("code", code)

    def value_and_gradient(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """The network's value (N,) and gradient (N, 3)."""
        parts = [self.network.value_and_gradient(part, self.code) for part in points.split(CHUNK)]
        values, gradients = zip(*parts, strict=True)
        return torch.cat(values), torch.cat(gradients)

    def value(self, points: Tensor) -> Tensor:
        """The network's value (N,)."""
        code = self.code[None]
        return torch.cat([self.network.value(part[None], code)[0] for part in points.split(CHUNK)])

    def native_layers(self) -> NativeLayers | None:
        """The layers for the native code; None with more octaves than single precision resolves."""
        return self.network.native_layers(self.code) if self.network.sizes.octaves <= MAX_OCTAVES else None


class DeepSdf(nn.Module):
    """A decoder and the latent codes of the shapes that it was fitted to.

    Args:
        network: The decoder of all shapes.
        codes: (S, C) latent codes.
        names: Names of the S shapes.
        about: Data, command, time and errors of the fit, as text by name.
        source: Name for error messages, usually that of the file.
    """

    codes: Tensor

    def __init__(
        self,
        network: DeepSdfDecoder,
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
        """The code (C,) of the shape ``name``, which may be left out if there is only one shape.

        Raises:
            InputError: There is no such shape, or several and no name.
        """
        if name is None and len(self.names) == 1:
            return self.codes[0]
        if name is None:
            raise InputError(
                f"{self.source}: holds {len(self.names)} shapes; choose one by its name, as in --shape {self.names[0]}"
            )
        if name not in self.names:
            near = difflib.get_close_matches(name, self.names, n=1) or self.names[:1]
            raise InputError(f"{self.source}: has no shape '{name}'; did you mean '{near[0]}'?")
        return self.codes[self.names.index(name)]

    def surface(self, code: Tensor) -> DeepSdfSurface:
        """The solid of ``code`` (C,).

        Raises:
            InputError: The code has another length, or is not finite.
        """
        length = self.network.sizes.code
        if tuple(code.shape) != (length,):
            raise InputError(f"{self.source}: a code has {length} numbers, but {tuple(code.shape)} were given")
        if not bool(torch.isfinite(code.detach()).all()):
            raise InputError(f"{self.source}: the code has numbers that are not finite")
        return DeepSdfSurface(self.network, code)


def save_deepsdf(path: Path, shapes: DeepSdf) -> None:
    """Write network, codes and names to ``path``.

    Raises:
        InputError: The disk is full or not writable.
    """
    tensors = {f"network.{name}": value for name, value in shapes.network.state_dict().items()}
    header = {"sizes": asdict(shapes.network.sizes), "names": shapes.names, "about": shapes.about}
    surface_file.write(path, surface_file.DEEPSDF, header, {**tensors, "codes": shapes.codes})


def load_deepsdf(path: Path) -> DeepSdf:
    """The shapes in ``path``, a file or the name of a shipped family; no tensor of them requires a gradient.

    Raises:
        InputError: The file is missing, truncated, not a DeepSDF, or its tensors do not fit its architecture.
    """
    header, tensors = surface_file.read(surface_path(path), surface_file.DEEPSDF)
    try:
        sizes, codes = DecoderSizes(**header["sizes"]), tensors["codes"]
        weights = present_names(surface_file.with_prefix(tensors, "network."))
        for name in ("width", "layers", "code", "octaves"):
            whole_number(name, getattr(sizes, name), 0, MAX_SIZE)
        if not codes.is_floating_point() or codes.ndim != 2:
            raise ValueError("its codes are no table of numbers")
        consistent = (sizes.width, sizes.code) == (weights["last.weight"].shape[1], codes.shape[1])
        if not consistent or sizes.layers > len(weights) or sizes.octaves > MAX_OCTAVES:
            raise ValueError(f"the header gives {sizes}")
        names = [str(name) for name in header["names"]]
        if len(names) != len(codes) or not names:
            raise ValueError(f"{len(names)} names for {len(codes)} codes")
        network = DeepSdfDecoder(sizes)
        load_weights(network, weights)
        shapes = DeepSdf(network, codes.float(), names, header["about"], str(path))
    except (KeyError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise surface_file.architecture_error(path, error) from None
    return shapes.eval().requires_grad_(False)


def present_names(weights: dict[str, Tensor]) -> dict[str, Tensor]:
    """Weights of the decoder by their present names; version 0.1 wrote ``of_place`` and ``of_code``."""
    return {
        name.replace("of_place.", "from_position.").replace("of_code.", "from_code."): value
        for name, value in weights.items()
    }
