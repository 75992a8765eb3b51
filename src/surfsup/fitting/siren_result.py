"""The result of a SIREN's fit: the surface and its errors."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from scipy.spatial import cKDTree

from surfsup.errors import InputError
from surfsup.fitting.exact_shape import ExactShape
from surfsup.fitting.siren_fit import SirenFit
from surfsup.sdf.marching_cubes import polygonize
from surfsup.sdf.mesh.query import unit
from surfsup.sdf.neural.siren import SirenSurface
from surfsup.sdf.neural.surface import grid_around

if TYPE_CHECKING:
    import trimesh

SEARCH_REACH = 1.1  # half side of the cube in which the zero set is extracted
RESOLUTION = 128  # cells of the mesh for the grid and the Chamfer distance
NEAR_POINTS = 10_000  # points near the surface for the errors there
SURFACE_POINTS = 50_000  # points on each of two surfaces for the Chamfer distance


class NoInside(InputError):
    """The network of a fit in its first steps, which is negative nowhere."""


@dataclass(frozen=True)
class SurfaceErrors:
    """The errors of a fitted surface, in units of a cube of side 2.

    Attributes:
        distance: mean |F - d| where |d| < 0.1.
        angle: mean angle between ∇F and the exact gradient there, degrees.
        angle_on_surface: the same on the surface itself.
        chamfer: plain (m + m, not squared) Chamfer distance of points on the extracted mesh and on the true surface.
        parts: number of connected parts of the extracted mesh.
    """

    distance: float
    angle: float
    angle_on_surface: float
    chamfer: float
    parts: int

    def text(self) -> str:
        """The errors as a sentence."""
        return (
            f"error of the distance near the surface (|d| < 0.1) {self.distance:.2e}, of the normal {self.angle:.1f} "
            f"degrees there and {self.angle_on_surface:.1f} on the surface; Chamfer of the extracted mesh "
            f"{self.chamfer:.2e}; in units of a cube of side 2"
        )

    def rounded(self) -> dict[str, float]:
        """The errors by name, with four digits, for the header of a file."""
        return {name: float(f"{value:.4g}") for name, value in asdict(self).items()}


def fitted_surface(
    fit: SirenFit, about: dict[str, Any], resolution: int = RESOLUTION
) -> tuple[SirenSurface, trimesh.Trimesh]:
    """The best surface of ``fit`` with its grid, and its mesh with ``resolution`` cells along the cube.

    Raises:
        NoInside: the network is positive everywhere.
    """
    network = fit.config.sizes.network()
    network.load_state_dict(fit.best or fit.model.state_dict())
    network.eval().requires_grad_(False)
    search_box = torch.tensor([[-SEARCH_REACH] * 3, [SEARCH_REACH] * 3])
    no_inside = "the fit has no inside yet; continue it with --resume and more --time"
    try:
        mesh = polygonize(SirenSurface(network, search_box), resolution)
    except InputError:
        raise NoInside(no_inside) from None
    if not len(mesh.faces):  # of a network whose values are not finite
        raise NoInside(no_inside)
    vertices = np.asarray(mesh.vertices)
    box = torch.tensor(np.stack([vertices.min(axis=0), vertices.max(axis=0)]))
    return SirenSurface(network, box, grid_around(mesh), fit.target.normalization, {**about, **fit.provenance()}), mesh


def measure_errors(surface: SirenSurface, mesh: trimesh.Trimesh, shape: ExactShape, seed: int) -> SurfaceErrors:
    """The errors of ``surface``, whose extracted mesh is ``mesh``, relative to the exact ``shape``."""
    random = np.random.default_rng([seed, 1])
    near, on = shape.sample_near(NEAR_POINTS, random), shape.sample_surface(SURFACE_POINTS, random)
    value, gradient = (values.numpy() for values in surface.value_and_gradient(torch.from_numpy(near.points).float()))
    _, on_gradient = surface.value_and_gradient(torch.from_numpy(on.points[:NEAR_POINTS]).float())
    extracted = np.asarray(mesh.sample(SURFACE_POINTS, seed=seed))
    return SurfaceErrors(
        distance=float(np.abs(value - near.distance).mean()),
        angle=mean_angle(gradient, near.normals),
        angle_on_surface=mean_angle(on_gradient.numpy(), on.normals[:NEAR_POINTS]),
        chamfer=chamfer(extracted, on.points),
        parts=int(mesh.body_count),
    )


def mean_angle(first: np.ndarray, second: np.ndarray) -> float:
    """Mean angle in degrees between two sets of vectors (N, 3)."""
    cosine = (unit(first) * unit(second)).sum(axis=1)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())


def chamfer(first: np.ndarray, second: np.ndarray) -> float:
    """Mean distance of ``first`` (N, 3) to their nearest of ``second`` (M, 3), plus the same in reverse."""
    forward, _ = cKDTree(second).query(first)
    backward, _ = cKDTree(first).query(second)
    return float(np.mean(forward) + np.mean(backward))
