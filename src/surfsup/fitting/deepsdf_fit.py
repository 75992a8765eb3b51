"""A DeepSDF fitted to many shapes: one network, and a latent code for each (an auto-decoder)."""

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

from surfsup import __version__
from surfsup.errors import InputError
from surfsup.fitting.exact import Exact, joined_of
from surfsup.fitting.fit import Fit, FitConfig
from surfsup.fitting.shape_set import ShapeSet
from surfsup.sdf.neural.code_network import CodeNetwork, CodeSizes
from surfsup.sdf.neural.deepsdf import DeepSdf

CLAMP = 0.1  # of the cube: distances beyond are all alike to the loss (DeepSDF's δ)
SPREADS = (0.02, 0.07)  # noise of the samples about the surface; DeepSDF's variances are 0.0005 and 0.005
CROWDED, ELSEWHERE = 12_000, 1_500  # samples of each shape
REACH = 1.1  # of the cube [-1, 1]³: where the samples elsewhere lie
HELD_OUT = 500  # of each shape's samples, by which the fit is judged
JUDGED = 50  # shapes


class DeepSdfConfig(FitConfig):
    """How a DeepSDF is fitted.

    Attributes:
        width, layers, code, octaves: of the network.
        shapes: in a step.
        points: of each of these.
        prior: weight of |z|², which keeps the codes near the origin (a Gaussian prior).
    """

    steps: int = Field(default=20_000, ge=1)
    learning_rate: float = Field(default=2e-3, gt=0, allow_inf_nan=False)
    width: int = Field(default=128, ge=1, le=1024)
    layers: int = Field(default=5, ge=2, le=16)
    code: int = Field(default=32, ge=1, le=1024)
    octaves: int = Field(default=3, ge=0, le=8)
    shapes: int = Field(default=64, ge=1)
    points: int = Field(default=64, ge=1)
    prior: float = Field(default=1e-4, ge=0, allow_inf_nan=False)

    @property
    def sizes(self) -> CodeSizes:
        """The network's."""
        return CodeSizes(self.width, self.layers, self.code, self.octaves)


@dataclass(frozen=True)
class ShapeSamples:
    """Points about many shapes and their distances.

    Attributes:
        names: of the S shapes.
        points: (S, K, 3) in the cube.
        distance: (S, K) signed.
    """

    names: list[str]
    points: Tensor
    distance: Tensor


def samples_of(exact: Exact, random: np.random.Generator) -> tuple[Tensor, Tensor]:
    """Points (K, 3) crowded about the surface of a shape, some anywhere, in random order, and distances (K,).

    Raises:
        InputError: too few of them are known.
    """
    known = joined_of([exact.around(CROWDED, SPREADS, random), exact.in_cube(ELSEWHERE, REACH, random)])
    total = CROWDED + ELSEWHERE
    if len(known.points) < total // 10:
        raise InputError("hardly a point about it is known to be inside or outside; close its holes")
    order = random.permutation(np.resize(np.arange(len(known.points)), total))
    return torch.from_numpy(known.points[order]).float(), torch.from_numpy(known.distance[order]).float()


def draw_samples(shapes: ShapeSet, seed: int, tell: Callable[[int, int], None]) -> ShapeSamples:
    """Samples of all ``shapes`` that can be used, drawn by ``seed``; ``tell`` is told how many are done.

    Raises:
        InputError: none can be used.
    """
    names, points, distances, reason = [], [], [], ""
    for number, name in enumerate(shapes.names):
        try:
            of_one = samples_of(shapes.exact(name), np.random.default_rng([seed, number]))
        except InputError as error:
            reason = str(error)
            warnings.warn(f"{name}: left out, {reason}", stacklevel=1)
            continue
        finally:
            tell(number + 1, len(shapes.names))
        names.append(name)
        points.append(of_one[0])
        distances.append(of_one[1])
    if not names:
        raise InputError(f"none of the {len(shapes.names)} shapes can be used; the last: {reason}")
    return ShapeSamples(names, torch.stack(points), torch.stack(distances))


class AutoDecoder(nn.Module):
    """The network and the codes (S, C) of the shapes that it is fitted to.

    Codes start from a normal distribution of norm 1, as DeepSDF's.
    """

    def __init__(self, sizes: CodeSizes, shapes: int) -> None:
        super().__init__()
        self.decoder = CodeNetwork(sizes)
        self.codes = nn.Parameter(torch.randn(shapes, sizes.code) / math.sqrt(sizes.code))


class DeepSdfFit(Fit):
    """Network and codes on their way to ``samples``."""

    network: AutoDecoder

    def __init__(self, config: DeepSdfConfig, samples: ShapeSamples, folder: Path) -> None:
        torch.manual_seed(config.seed)
        super().__init__(config, AutoDecoder(config.sizes, len(samples.names)), folder)
        self.options, self.samples = config, samples

    def loss(self, random: torch.Generator) -> Tensor:
        """Mean difference of the clamped distances, and the prior on the codes (Park et al., 2019, equation 9)."""
        count, total = len(self.samples.names), self.samples.points.shape[1]
        which = torch.randint(count, (self.options.shapes,), generator=random)
        of_each = torch.randint(HELD_OUT, total, (self.options.shapes, self.options.points), generator=random)
        points = self.samples.points[which[:, None], of_each]
        distance = self.samples.distance[which[:, None], of_each]
        codes = self.network.codes[which]
        off = clamped_error(self.network.decoder.value(points, codes), distance)
        return off + self.options.prior * codes.square().sum(dim=-1).mean()

    def error(self) -> float:
        """The same difference on the samples held out, of some of the shapes."""
        pick = torch.linspace(0, len(self.samples.names) - 1, min(JUDGED, len(self.samples.names))).long()
        with torch.no_grad():
            value = self.network.decoder.value(self.samples.points[pick, :HELD_OUT], self.network.codes[pick])
            return float(clamped_error(value, self.samples.distance[pick, :HELD_OUT]))


def shapes_of(fit: DeepSdfFit, about: dict[str, Any]) -> DeepSdf:
    """The best network and codes of ``fit``."""
    best = AutoDecoder(fit.options.sizes, len(fit.samples.names))
    best.load_state_dict(fit.best or fit.network.state_dict())
    made = {
        "version": __version__,
        "steps": fit.step,
        "seconds": round(fit.seconds, 1),
        "processor_seconds": round(fit.processor_seconds, 1),
        "options": fit.options.model_dump(),
        "error": fit.least,
    }
    return DeepSdf(best.decoder.requires_grad_(False), best.codes.detach(), fit.samples.names, {**about, **made})


def clamped_error(value: Tensor, distance: Tensor) -> Tensor:
    """Mean difference of two distances, both clamped."""
    return (value.clamp(-CLAMP, CLAMP) - distance.clamp(-CLAMP, CLAMP)).abs().mean()
