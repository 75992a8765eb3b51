"""Triangles at one time: the water's surface or the solid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import trimesh

from surfsup.exporting.frames import ParticleFrame, selected
from surfsup.viewing.reconstruction import Reconstruction


@dataclass(frozen=True)
class MeshFrame:
    """Triangles at one time. Their number may differ from frame to frame.

    Attributes:
        time: seconds since the start of the scene.
        vertices: (V, 3) float32, meters.
        triangles: (T, 3) int32, counterclockwise from outside.
        normals: (V, 3) float32, unit, outwards.
        velocities: (V, 3) float32, m/s.
        liquid: number of the liquid whose surface it is, in a scene of several.
    """

    time: float
    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    velocities: np.ndarray
    liquid: int | None = None


def liquid_surfaces(frame: ParticleFrame, count: int, reconstruction: Reconstruction) -> list[MeshFrame]:
    """The surface of the water, or of each of ``count`` liquids by itself, empty where it has no particles.

    Raises:
        SimulationError: there is no surface around these particles.
    """
    if frame.liquids is None or count < 2:
        return [water_surface(frame, reconstruction)]
    parts = [selected(frame, np.flatnonzero(frame.liquids == number)) for number in range(count)]
    return [replace(water_surface(part, reconstruction), liquid=number) for number, part in enumerate(parts)]


def water_surface(frame: ParticleFrame, reconstruction: Reconstruction) -> MeshFrame:
    """The surface of the water, with the velocities of the particles around each vertex.

    Raises:
        SimulationError: there is no surface around these particles.
    """
    if not len(frame.positions):
        nothing = np.zeros((0, 3), np.float32)
        return MeshFrame(frame.time, nothing, nothing.astype(np.int32), nothing, nothing)
    import pysplashsurf

    result = reconstruction.mesh(frame.positions, frame.radius, velocities=frame.velocities)
    assert isinstance(result.mesh, pysplashsurf.TriMesh3d)  # quads are not requested
    normals, velocities = (np.asarray(result.point_attributes[name]) for name in ("normals", "velocities"))
    vertices, triangles = np.asarray(result.mesh.vertices), np.asarray(result.mesh.triangles)
    return MeshFrame(frame.time, vertices, triangles.astype(np.int32), normals, velocities)


def joined(parts: list[MeshFrame], time: float) -> MeshFrame:
    """Several meshes as one."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    triangles = np.concatenate([part.triangles + offset for part, offset in zip(parts, offsets, strict=True)])
    vertices, normals, velocities = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("vertices", "normals", "velocities")
    )
    return MeshFrame(time, vertices, triangles.astype(np.int32), normals, velocities)


def solid_mesh(mesh: trimesh.Trimesh) -> MeshFrame:
    """A solid at rest."""
    vertices, normals = (np.asarray(values, np.float32) for values in (mesh.vertices, mesh.vertex_normals))
    return MeshFrame(0.0, vertices, np.asarray(mesh.faces, np.int32), normals, np.zeros_like(vertices))
