"""Fitting a DeepSDF to many shapes: one network and a latent code for each shape (an auto-decoder)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from pydantic import Field
from torch import Tensor, nn

from surfsup.errors import InputError
from surfsup.fitting.exact_shape import ExactShape, concatenate
from surfsup.fitting.fit import Fit, FitConfig
from surfsup.fitting.shape_set import ShapeSet
from surfsup.optim.config import Count, NonNegative, Positive
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.deepsdf import DeepSdf
from surfsup.sdf.neural.deepsdf_decoder import DecoderSizes, DeepSdfDecoder

CLAMP = 0.1  # the loss ignores differences of distances beyond; δ of DeepSDF
SPREADS = (0.02, 0.07)  # standard deviations of samples around the surface; DeepSDF's variances are 0.0005 and 0.005
AROUND_SAMPLES, CUBE_SAMPLES = 12_000, 1_500  # of each shape
REACH = 1.1  # half side of the cube of the latter
HELD_OUT = 500  # samples of each shape that measure the error
HELD_OUT_SHAPES = 50
SAMPLES_FILE = "samples.safetensors"


class DeepSdfConfig(FitConfig):
    """The options of a DeepSDF's fit.

    Attributes:
        width, layers, code, octaves: sizes of the network.
        shapes: shapes a step.
        points: points of each of these shapes.
        prior: weight of |z|², a Gaussian prior that keeps the codes near the origin.
    """

    steps: Count = 20_000
    learning_rate: Positive = 2e-3
    width: int = Field(default=128, ge=1, le=1024)
    layers: int = Field(default=5, ge=2, le=16)
    code: int = Field(default=32, ge=1, le=1024)
    octaves: int = Field(default=3, ge=0, le=8)
    shapes: Count = 64
    points: Count = 64
    prior: NonNegative = 1e-4

    @property
    def sizes(self) -> DecoderSizes:
        """The sizes of the network."""
        return DecoderSizes(self.width, self.layers, self.code, self.octaves)


@dataclass(frozen=True)
class ShapeSamples:
    """Points around many shapes and their distances.

    Attributes:
        names: of the S shapes.
        points: (S, K, 3) in the cube.
        distance: (S, K) signed.
    """

    names: list[str]
    points: Tensor
    distance: Tensor


def sample_shape(shape: ExactShape, random: np.random.Generator) -> tuple[Tensor, Tensor]:
    """Points (K, 3) of a shape, most of them around its surface, in random order, and their distances (K,).

    Raises:
        InputError: the distance of too few points is known.
    """
    around = shape.sample_around(AROUND_SAMPLES, SPREADS, random)
    samples = concatenate([around, shape.sample_cube(CUBE_SAMPLES, REACH, random)])
    total = AROUND_SAMPLES + CUBE_SAMPLES
    if len(samples.points) < total // 10:
        raise InputError("almost no point around it is known to be inside or outside; close its holes")
    order = random.permutation(np.resize(np.arange(len(samples.points)), total))
    return torch.from_numpy(samples.points[order]).float(), torch.from_numpy(samples.distance[order]).float()


def sample_shapes(shapes: ShapeSet, seed: int, progress: Callable[[int, int], None]) -> ShapeSamples:
    """Samples of all ``shapes`` that can be used; ``progress`` is called with the numbers of shapes done and in all.

    Raises:
        InputError: no shape can be used.
    """
    names, points, distances, reason = [], [], [], ""
    for number, name in enumerate(shapes.names):
        try:
            of_shape = sample_shape(shapes.shape(name), np.random.default_rng([seed, number]))
        except InputError as error:
            reason = str(error)
            warnings.warn(f"{name}: left out, {reason}", stacklevel=1)
            continue
        finally:
            progress(number + 1, len(shapes.names))
        names.append(name)
        points.append(of_shape[0])
        distances.append(of_shape[1])
    if not names:
        raise InputError(f"none of the {len(shapes.names)} shapes can be used; the last: {reason}")
    return ShapeSamples(names, torch.stack(points), torch.stack(distances))


def save_samples(folder: Path, samples: ShapeSamples) -> None:
    """Write ``samples`` into ``folder``, so that a resumed fit need not draw them again.

    Raises:
        InputError: the disk is full or not writable.
    """
    tensors = {"points": samples.points, "distance": samples.distance}
    surface_file.write(folder / SAMPLES_FILE, surface_file.SAMPLES, {"names": samples.names}, tensors)


def load_samples(folder: Path) -> ShapeSamples:
    """Read the samples in ``folder``.

    Raises:
        InputError: they are missing or damaged.
    """
    path = folder / SAMPLES_FILE
    header, tensors = surface_file.read(path, surface_file.SAMPLES)
    try:
        return ShapeSamples(header["names"], tensors["points"], tensors["distance"])
    except KeyError as error:
        raise InputError(f"{path}: is damaged ({error} is missing); start the fit again") from None


class AutoDecoder(nn.Module):
    """The network and the codes (S, C) of the shapes.

    The codes are initialized from a normal distribution with expected squared norm 1, as in DeepSDF.
    """

    def __init__(self, sizes: DecoderSizes, shapes: int) -> None:
        super().__init__()
        self.decoder = DeepSdfDecoder(sizes)
        self.codes = nn.Parameter(torch.randn(shapes, sizes.code) / math.sqrt(sizes.code))


class DeepSdfFit(Fit[DeepSdfConfig, AutoDecoder]):
    """The fit of a network and codes to ``samples``."""

    def __init__(self, config: DeepSdfConfig, samples: ShapeSamples, folder: Path) -> None:
        torch.manual_seed(config.seed)
        super().__init__(config, AutoDecoder(config.sizes, len(samples.names)), folder)
        self.samples = samples

    def loss(self, batch: torch.Generator) -> Tensor:
        """Mean error of the clamped distances, and the prior on the codes (Park et al., 2019, equation 9)."""
        config, samples = self.config, self.samples
        shapes = torch.randint(len(samples.names), (config.shapes,), generator=batch)
        numbers = torch.randint(HELD_OUT, samples.points.shape[1], (config.shapes, config.points), generator=batch)
        points, distance = samples.points[shapes[:, None], numbers], samples.distance[shapes[:, None], numbers]
        codes = self.model.codes[shapes]
        error = clamped_error(self.model.decoder.value(points, codes), distance)
        return error + config.prior * codes.square().sum(dim=-1).mean()

    def error(self, model: AutoDecoder) -> float:
        """Mean error of the clamped distances of some of the shapes on samples held out."""
        count = len(self.samples.names)
        shapes = torch.linspace(0, count - 1, min(HELD_OUT_SHAPES, count)).long()
        with torch.no_grad():
            value = model.decoder.value(self.samples.points[shapes, :HELD_OUT], model.codes[shapes])
            return float(clamped_error(value, self.samples.distance[shapes, :HELD_OUT]))


def fitted_shapes(fit: DeepSdfFit, about: dict[str, Any]) -> DeepSdf:
    """The best network and codes of ``fit``; ``about`` goes into the header of its file."""
    best = AutoDecoder(fit.config.sizes, len(fit.samples.names))
    best.load_state_dict(fit.best or fit.model.state_dict())
    about = {**about, **fit.provenance(), "error": fit.best_score}
    return DeepSdf(best.decoder.requires_grad_(False), best.codes.detach(), fit.samples.names, about)


def clamped_error(value: Tensor, distance: Tensor) -> Tensor:
    """Mean absolute difference of two distances, both clamped."""
    return (value.clamp(-CLAMP, CLAMP) - distance.clamp(-CLAMP, CLAMP)).abs().mean()
