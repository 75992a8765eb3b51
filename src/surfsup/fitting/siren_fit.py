"""Fitting a SIREN to a mesh or an oriented point cloud."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from pydantic import Field
from torch import Tensor, nn

from surfsup.fitting.exact_shape import DistanceSamples, ExactShape, concatenate, normalize_extent, to_cube
from surfsup.fitting.fit import Fit, FitConfig
from surfsup.fitting.point_cloud import PointCloud
from surfsup.optim.config import NonNegative, Positive
from surfsup.sdf.neural.sine_network import SineNetwork
from surfsup.sdf.neural.siren import Normalization, SirenSizes

OFF_SURFACE_DECAY = 100.0  # α of exp(-α|F|) in the paper
SPREADS = (0.01, 0.03, 0.08)  # standard deviations of points around the surface
REACH = 1.1  # half side of the cube of points off the surface
AROUND_SHARE, CUBE_SHARE = 0.6, 0.15  # points around the surface and in the cube, for each on the surface
HELD_OUT = 8_000  # points near the surface that measure the error of a mesh
HELD_OUT_SHARE = 0.05  # of the points of a cloud


class SirenConfig(FitConfig):
    """The options of a SIREN's fit; the defaults of the first four weights are those of Sitzmann et al. (2020).

    Attributes:
        width, layers, frequency: sizes of the network.
        samples: points drawn once on the surface of a mesh, and three quarters as many off it.
        batch: points on the surface a step; as many around it, and half as many in the whole cube.
        surface: weight of |F| on the surface.
        normal: weight of 1 - cos between ∇F and the normal on the surface.
        eikonal: weight of | |∇F| - 1 | everywhere.
        off_surface: weight of exp(-100 |F|) off the surface.
        distance: weight of |F - d| where the exact distance d is known, as for meshes; ours.
        direction: weight of 1 - cos between ∇F and the exact gradient there; ours.
    """

    clip: Positive = 2e4
    width: int = Field(default=128, ge=1, le=1024)
    layers: int = Field(default=3, ge=1, le=16)
    frequency: Positive = 30.0
    samples: int = Field(default=200_000, ge=1000)
    batch: int = Field(default=2048, ge=16)
    surface: NonNegative = 3e3
    normal: NonNegative = 1e2
    eikonal: NonNegative = 5e1
    off_surface: NonNegative = 1e2
    distance: NonNegative = 3e3
    direction: NonNegative = 1e2

    @property
    def sizes(self) -> SirenSizes:
        """The sizes of the network."""
        return SirenSizes(self.width, self.layers, self.frequency)


@dataclass(frozen=True)
class SampleTensors:
    """:class:`DistanceSamples` as single-precision tensors.

    Attributes:
        points: (N, 3) in the cube.
        distance: (N,) signed.
        normals: (N, 3) of length one.
    """

    points: Tensor
    distance: Tensor
    normals: Tensor

    @classmethod
    def of(cls, samples: DistanceSamples) -> SampleTensors:
        """Convert ``samples``."""
        arrays = (samples.points, samples.distance, samples.normals)
        return cls(*(torch.from_numpy(np.asarray(array, dtype=np.float32)) for array in arrays))

    def draw(self, count: int, random: torch.Generator) -> SampleTensors:
        """``count`` random samples, with replacement."""
        pick = torch.randint(len(self.points), (count,), generator=random)
        return SampleTensors(*(values.index_select(0, pick) for values in (self.points, self.distance, self.normals)))


@dataclass(frozen=True)
class SirenTarget:
    """The samples that a SIREN is fitted to.

    Attributes:
        normalization: the map of the input into the cube.
        surface: points on the surface.
        around: points around it and in the cube with exact distances; None for a cloud, whose distances are not known.
        held_out: points that measure the error: near the surface of a mesh, on that of a cloud.
    """

    normalization: Normalization
    surface: SampleTensors
    around: SampleTensors | None
    held_out: SampleTensors

    @classmethod
    def of_shape(cls, shape: ExactShape, samples: int, seed: int) -> SirenTarget:
        """Samples of a shape with exact distances, ``samples`` of them on its surface."""
        random = np.random.default_rng(seed)
        surface = SampleTensors.of(shape.sample_surface(samples, random))
        around = shape.sample_around(int(AROUND_SHARE * samples), SPREADS, random)
        in_cube = shape.sample_cube(int(CUBE_SHARE * samples), REACH, random)
        held_out = SampleTensors.of(shape.sample_near(min(HELD_OUT, samples), random))
        return cls(shape.normalization, surface, SampleTensors.of(concatenate([around, in_cube])), held_out)

    @classmethod
    def of_cloud(cls, cloud: PointCloud, seed: int) -> SirenTarget:
        """The points of a cloud; a random share of them is held out."""
        normalization = normalize_extent(cloud.points)
        order = np.random.default_rng(seed).permutation(len(cloud.points))
        samples = DistanceSamples(to_cube(cloud.points, normalization), np.zeros(len(order)), cloud.normals)
        held_out = max(1, int(HELD_OUT_SHARE * len(order)))
        surface = SampleTensors.of(samples.select(order[held_out:]))
        return cls(normalization, surface, None, SampleTensors.of(samples.select(order[:held_out])))


class SirenFit(Fit[SirenConfig, SineNetwork]):
    """The fit of a sine network to ``target``."""

    def __init__(self, config: SirenConfig, target: SirenTarget, folder: Path) -> None:
        torch.manual_seed(config.seed)
        super().__init__(config, config.sizes.network(), folder)
        self.target = target

    def loss(self, batch: torch.Generator) -> Tensor:
        """The loss of Sitzmann et al. (2020), plus errors of the distance and its gradient where they are known."""
        config, target = self.config, self.target
        surface = target.surface.draw(config.batch, batch)
        in_cube = REACH * (2 * torch.rand(config.batch // 2, 3, generator=batch) - 1)
        parts = [surface.points, in_cube]
        around = None if target.around is None else target.around.draw(config.batch, batch)
        if around is not None:
            parts.append(around.points)
        value, gradient = self.model.value_and_gradient(torch.cat(parts))
        sizes = [len(points) for points in parts]
        values, gradients = value.split(sizes), gradient.split(sizes)
        total = config.surface * values[0].abs().mean()
        total = total + config.normal * mean_cosine_error(gradients[0], surface.normals)
        total = total + config.eikonal * (torch.linalg.vector_norm(gradient, dim=-1) - 1).abs().mean()
        total = total + config.off_surface * torch.exp(-OFF_SURFACE_DECAY * values[1].abs()).mean()
        if around is not None:
            total = total + config.distance * (values[2] - around.distance).abs().mean()
            total = total + config.direction * mean_cosine_error(gradients[2], around.normals)
        return total

    def error(self, model: SineNetwork) -> float:
        """Mean |F - d| on the points held out, in units of the cube."""
        held_out = self.target.held_out
        with torch.no_grad():
            value = torch.cat([model.value(points) for points in held_out.points.split(4096)])
        return float((value - held_out.distance).abs().mean())


def mean_cosine_error(gradient: Tensor, normals: Tensor) -> Tensor:
    """Mean 1 - cos of the angle between two sets of vectors (N, 3)."""
    return (1 - nn.functional.cosine_similarity(gradient, normals, dim=-1)).mean()
