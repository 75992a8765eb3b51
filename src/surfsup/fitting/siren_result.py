"""What a fit of a SIREN leaves: the surface, and how far it is off."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
import trimesh
from scipy.spatial import cKDTree

from surfsup import __version__
from surfsup.errors import InputError
from surfsup.fitting.exact import Exact
from surfsup.fitting.siren_fit import SirenFit
from surfsup.sdf.grid import Lattice
from surfsup.sdf.marching_cubes import polygonize
from surfsup.sdf.mesh.query import unit
from surfsup.sdf.neural.siren import SirenSurface
from surfsup.sdf.neural.surface import CELL, MARGIN

SEARCHED = 1.1  # of the cube [-1, 1]³: where the zero set is looked for
RESOLUTION = 128  # cells of the mesh that the lattice and the Chamfer distance are taken of
CHECKED = 10_000  # points near the surface
COMPARED = 50_000  # points on each of two surfaces for the Chamfer distance


class NothingInside(InputError):
    """A fit in its first steps, whose network is negative nowhere."""


@dataclass(frozen=True)
class Errors:
    """How far a fitted surface is off, in units of the cube, whose side is 2.

    Attributes:
        distance: mean |F - d| where |d| < 0.1.
        angle: mean angle between ∇F and the exact gradient there, degrees.
        angle_on_surface: the same on the surface itself.
        chamfer: plain (m + m, not squared) Chamfer distance of points on the extracted mesh and on the true surface.
        parts: connected parts of the extracted mesh.
    """

    distance: float
    angle: float
    angle_on_surface: float
    chamfer: float
    parts: int

    def text(self) -> str:
        """The numbers, for a terminal."""
        return (
            f"error of the distance near the surface (|d| < 0.1) {self.distance:.2e}, of the normal {self.angle:.1f} "
            f"degrees there and {self.angle_on_surface:.1f} on the surface; Chamfer of the extracted mesh "
            f"{self.chamfer:.2e}; in units of a cube of side 2"
        )


def surface_of(
    fit: SirenFit, about: dict[str, Any], resolution: int = RESOLUTION
) -> tuple[SirenSurface, trimesh.Trimesh]:
    """The best surface of ``fit`` with its lattice, and its mesh of ``resolution`` cells along the cube.

    Raises:
        NothingInside: it is positive everywhere.
    """
    network = fit.options.sizes.network()
    network.load_state_dict(fit.best or fit.network.state_dict())
    network.eval().requires_grad_(False)
    everywhere = torch.tensor([[-SEARCHED] * 3, [SEARCHED] * 3])
    bare = SirenSurface(network, everywhere)
    try:
        mesh = polygonize(bare, resolution)
    except InputError:
        raise NothingInside("the fit has no inside yet; go on with --resume and more --time") from None
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    box = torch.tensor(np.stack([vertices.min(axis=0), vertices.max(axis=0)]))
    lattice = Lattice.around(vertices, faces, CELL, MARGIN)
    made = {
        "version": __version__,
        "steps": fit.step,
        "seconds": round(fit.seconds, 1),
        "processor_seconds": round(fit.processor_seconds, 1),
        "options": fit.options.model_dump(),
    }
    return SirenSurface(network, box, lattice, fit.target.cube, {**about, **made}), mesh


def errors_of(surface: SirenSurface, mesh: trimesh.Trimesh, shape: Exact, seed: int) -> Errors:
    """How far ``surface``, whose extracted mesh is ``mesh``, is from the exact ``shape``."""
    random = np.random.default_rng([seed, 1])
    near, on = shape.near(CHECKED, random), shape.on_surface(COMPARED, random)
    value, gradient = (answer.numpy() for answer in surface.field(torch.from_numpy(near.points).float()))
    _, slope = surface.field(torch.from_numpy(on.points[:CHECKED]).float())
    extracted = np.asarray(mesh.sample(COMPARED, seed=seed))
    return Errors(
        distance=float(np.abs(value - near.distance).mean()),
        angle=mean_angle(gradient, near.normals),
        angle_on_surface=mean_angle(slope.numpy(), on.normals[:CHECKED]),
        chamfer=chamfer(extracted, on.points),
        parts=int(mesh.body_count),
    )


def mean_angle(first: np.ndarray, second: np.ndarray) -> float:
    """Mean angle in degrees between two sets of vectors (N, 3)."""
    cosine = (unit(first) * unit(second)).sum(axis=1)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())


def chamfer(first: np.ndarray, second: np.ndarray) -> float:
    """Mean distance from each of ``first`` (N, 3) to the nearest of ``second`` (M, 3), and back, added."""
    there, _ = cKDTree(second).query(first)
    back, _ = cKDTree(first).query(second)
    return float(there.mean() + back.mean())


def as_text(errors: Errors) -> dict[str, float]:
    """The errors by name, for the header of a file."""
    return {name: float(f"{value:.4g}") for name, value in asdict(errors).items()}
