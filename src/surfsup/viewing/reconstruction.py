"""Surfaces of water: a closed mesh around particles, by splashsurf."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from surfsup.errors import InputError, SimulationError

if TYPE_CHECKING:
    import pysplashsurf

# For some particles pysplashsurf loses a vertex and fails ("This is a bug"); another cell size avoids that.
RETRIES = (1.0, 1.007, 1.014)


@dataclass(frozen=True)
class Reconstruction:
    """The parameters of splashsurf; lengths are in particle radii.

    Attributes:
        smoothing_length: half the support radius of the kernel around a particle.
        cube_size: side of the cells of marching cubes. The number of triangles grows with its inverse square.
        iso: density of the surface, relative to that of water.
        mesh_smoothing: number of smoothing iterations of the vertices.
        normal_smoothing: number of smoothing iterations of the normals.

    Raises:
        InputError: a value is out of range.
    """

    smoothing_length: float = 2.0
    cube_size: float = 0.7
    iso: float = 0.6
    mesh_smoothing: int = 20
    normal_smoothing: int = 8

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            lower = 0 if isinstance(field.default, int) else 1e-3
            if not lower <= value <= 1000:
                raise InputError(f"{field.name.replace('_', ' ')}: {value} is not between {lower} and 1000")

    def mesh(
        self, positions: np.ndarray, particle_radius: float, **attributes: np.ndarray
    ) -> pysplashsurf.MeshWithData:
        """The mesh around particles (N, 3) with ``normals``, and attributes (N, K) interpolated to its vertices.

        Raises:
            SimulationError: pysplashsurf finds no surface around these particles.
        """
        import pysplashsurf

        for factor in RETRIES:
            try:
                mesh, _ = pysplashsurf.reconstruction_pipeline(
                    np.ascontiguousarray(positions, np.float32),
                    attributes_to_interpolate=attributes or None,
                    particle_radius=particle_radius,
                    smoothing_length=self.smoothing_length,
                    cube_size=self.cube_size * factor,
                    iso_surface_threshold=self.iso,
                    mesh_smoothing_iters=self.mesh_smoothing,
                    mesh_smoothing_weights=True,
                    compute_normals=True,
                    normals_smoothing_iters=self.normal_smoothing,
                )
            except RuntimeError:
                continue
            return mesh
        raise SimulationError(f"pysplashsurf finds no surface around the {len(positions)} particles")
