"""A SIREN fitted to a mesh or to an oriented point cloud."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from pydantic import Field
from torch import Tensor, nn

from surfsup.fitting.exact import Exact, Known, cube_of, into_cube, joined_of
from surfsup.fitting.fit import Fit, FitConfig
from surfsup.fitting.point_cloud import PointCloud
from surfsup.sdf.neural.siren import Cube, SirenSizes

OFF_SURFACE = 100.0  # the published α of exp(-α|F|)
SPREADS = (0.01, 0.03, 0.08)  # of the cube: noise of the points about the surface
REACH = 1.1  # of the cube [-1, 1]³: where points off the surface lie
AROUND, FAR = 0.6, 0.15  # points about the surface and elsewhere in the cube, for each on it
HELD_OUT = 8_000  # points near the surface by which a fit is judged
HELD_OUT_SHARE = 0.05  # of a cloud's points


class SirenConfig(FitConfig):
    """How a SIREN is fitted; the defaults of the first four weights are those of Sitzmann et al. (2020).

    Attributes:
        width, layers, frequency: of the network.
        samples: points on the surface of a mesh that are drawn once, and three quarters as many off it.
        batch: points on the surface in a step; as many about it, half as many elsewhere in the cube.
        surface: weight of |F| on the surface.
        normal: weight of 1 - cos between ∇F and the normal on the surface.
        eikonal: weight of | |∇F| - 1 | everywhere.
        off_surface: weight of exp(-100 |F|) away from the surface.
        distance: weight of |F - d| where the distance d is known exactly, which it is of meshes; ours.
        direction: weight of 1 - cos between ∇F and the exact gradient there; ours.
    """

    clip: float = Field(default=2e4, gt=0)
    width: int = Field(default=128, ge=1, le=1024)
    layers: int = Field(default=3, ge=1, le=16)
    frequency: float = Field(default=30.0, gt=0, allow_inf_nan=False)
    samples: int = Field(default=200_000, ge=1000)
    batch: int = Field(default=2048, ge=16)
    surface: float = Field(default=3e3, ge=0, allow_inf_nan=False)
    normal: float = Field(default=1e2, ge=0, allow_inf_nan=False)
    eikonal: float = Field(default=5e1, ge=0, allow_inf_nan=False)
    off_surface: float = Field(default=1e2, ge=0, allow_inf_nan=False)
    distance: float = Field(default=3e3, ge=0, allow_inf_nan=False)
    direction: float = Field(default=1e2, ge=0, allow_inf_nan=False)

    @property
    def sizes(self) -> SirenSizes:
        """The network's."""
        return SirenSizes(self.width, self.layers, self.frequency)


@dataclass(frozen=True)
class Places:
    """Points in the cube, as tensors, and what is known of them.

    Attributes:
        points: (N, 3).
        distance: (N,) signed.
        normals: (N, 3) of length one.
    """

    points: Tensor
    distance: Tensor
    normals: Tensor

    @classmethod
    def of(cls, known: Known) -> Places:
        """The same as tensors of single precision."""
        arrays = (known.points, known.distance, known.normals)
        return cls(*(torch.from_numpy(np.asarray(array, dtype=np.float32)) for array in arrays))

    def draw(self, count: int, random: torch.Generator) -> Places:
        """``count`` of them, each as likely as any other."""
        pick = torch.randint(len(self.points), (count,), generator=random)
        return Places(*(values.index_select(0, pick) for values in (self.points, self.distance, self.normals)))


@dataclass(frozen=True)
class SirenTarget:
    """What a SIREN is fitted to.

    Attributes:
        cube: how the input was moved and scaled.
        surface: points on the surface.
        around: points about it and elsewhere, with exact distances; None of a cloud, whose distances nobody knows.
        held_out: points that it is judged by: near the surface of a mesh, on that of a cloud.
    """

    cube: Cube
    surface: Places
    around: Places | None
    held_out: Places

    @classmethod
    def of_solid(cls, shape: Exact, samples: int, seed: int) -> SirenTarget:
        """Points of a solid whose distance is known, ``samples`` of them on its surface, drawn by ``seed``."""
        random = np.random.default_rng(seed)
        surface = Places.of(shape.on_surface(samples, random))
        near, far = (
            shape.around(int(AROUND * samples), SPREADS, random),
            shape.in_cube(int(FAR * samples), REACH, random),
        )
        around = Places.of(joined_of([near, far]))
        return cls(shape.cube, surface, around, Places.of(shape.near(min(HELD_OUT, samples), random)))

    @classmethod
    def of_cloud(cls, cloud: PointCloud, seed: int) -> SirenTarget:
        """The points of a cloud, some of them, drawn by ``seed``, put aside."""
        cube = cube_of(cloud.points)
        order = np.random.default_rng(seed).permutation(len(cloud.points))
        known = Known(into_cube(cloud.points, cube), np.zeros(len(order)), cloud.normals)
        aside = max(1, int(HELD_OUT_SHARE * len(order)))
        return cls(cube, Places.of(known.only(order[aside:])), None, Places.of(known.only(order[:aside])))


class SirenFit(Fit):
    """A sine network on its way to ``target``."""

    def __init__(self, config: SirenConfig, target: SirenTarget, folder: Path) -> None:
        torch.manual_seed(config.seed)
        super().__init__(config, config.sizes.network(), folder)
        self.options, self.target = config, target

    def loss(self, random: torch.Generator) -> Tensor:
        """The published loss, and where distances are known their error and that of the gradient."""
        options, target = self.options, self.target
        surface = target.surface.draw(options.batch, random)
        anywhere = REACH * (2 * torch.rand(options.batch // 2, 3, generator=random) - 1)
        parts = [surface.points, anywhere]
        around = None if target.around is None else target.around.draw(options.batch, random)
        if around is not None:
            parts.append(around.points)
        value, gradient = self.network.value_and_gradient(torch.cat(parts))
        sizes = [len(points) for points in parts]
        on, off, *known = zip(value.split(sizes), gradient.split(sizes), strict=True)
        total = options.surface * on[0].abs().mean()
        total = total + options.normal * disagreement(on[1], surface.normals)
        total = total + options.eikonal * (torch.linalg.vector_norm(gradient, dim=-1) - 1).abs().mean()
        total = total + options.off_surface * torch.exp(-OFF_SURFACE * off[0].abs()).mean()
        if around is not None:
            total = total + options.distance * (known[0][0] - around.distance).abs().mean()
            total = total + options.direction * disagreement(known[0][1], around.normals)
        return total

    def error(self) -> float:
        """Mean |F - d| on the points held out, in units of the cube."""
        held_out = self.target.held_out
        with torch.no_grad():
            value = torch.cat([self.network.value(points) for points in held_out.points.split(4096)])
        return float((value - held_out.distance).abs().mean())


def disagreement(gradient: Tensor, normals: Tensor) -> Tensor:
    """Mean 1 - cos of the angle between two sets of vectors (N, 3)."""
    return (1 - nn.functional.cosine_similarity(gradient, normals, dim=-1)).mean()
