"""Inputs of a SIREN's fit: a mesh, an oriented point cloud, the surface of a scene, or a procedural mesh."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from surfsup.datasets.procedural.room import room
from surfsup.datasets.recipes.complex_scenes import PROCEDURAL_MESHES
from surfsup.errors import InputError
from surfsup.fitting.exact_shape import ExactMesh, ExactShape
from surfsup.fitting.point_cloud import CLOUD_SUFFIXES, PointCloud, is_cloud, load_cloud
from surfsup.fitting.siren_fit import SirenTarget
from surfsup.scene import Scene
from surfsup.sdf import load_mesh
from surfsup.sdf.mesh.mesh_file import FORMATS

if TYPE_CHECKING:
    import trimesh

SCENE_SUFFIXES = (".yaml", ".yml")
SCENE_RESOLUTION = 256  # cells of the mesh of a scene's surface


def load_target(
    path: Path, up: Literal["y", "z"] | None, samples: int, seed: int
) -> tuple[SirenTarget, ExactShape | None]:
    """Samples of the input at ``path`` and its exact shape, which a point cloud does not have.

    Args:
        path: a mesh, a point cloud or a scene file, or the name of a procedural mesh.
        up: the input's own upward axis, "y" or "z"; None takes the default of the file format.
        samples: points to draw on the surface of a mesh.
        seed: seed of the samples.

    Raises:
        InputError: the file is missing or cannot be used.
    """
    if up not in (None, "y", "z"):
        raise InputError(f"--up is '{up}', but must be y or z")
    suffix = path.suffix.lower()
    if path.name not in PROCEDURAL or path.exists():
        if suffix[1:] not in FORMATS and suffix not in (*CLOUD_SUFFIXES, *SCENE_SUFFIXES):
            known = ", ".join([*(f".{name}" for name in FORMATS), ".xyz", ".yaml"])
            raise InputError(
                f"{path}: a SIREN cannot be fitted to this; give a file that ends in one of {known}, "
                f"or one of {', '.join(PROCEDURAL)}"
            )
        if is_cloud(path):
            return SirenTarget.of_cloud(load_upright_cloud(path, up), seed), None
        mesh = scene_mesh(path) if suffix in SCENE_SUFFIXES else load_mesh(path, up=up)
    else:
        mesh = PROCEDURAL[path.name]()
    shape = ExactMesh(mesh)
    return SirenTarget.of_shape(shape, samples, seed), shape


def load_upright_cloud(path: Path, up: Literal["y", "z"] | None) -> PointCloud:
    """The point cloud at ``path``, with z up.

    Raises:
        InputError: the file cannot be used.
    """
    cloud = load_cloud(path)
    if up != "y":
        return cloud
    points, normals = (np.stack([v[:, 0], -v[:, 2], v[:, 1]], axis=1) for v in (cloud.points, cloud.normals))
    return PointCloud(points, normals)


def room_mesh() -> trimesh.Trimesh:
    """The mesh of the furnished room, meters."""
    return room().surface().to_mesh(SCENE_RESOLUTION)


PROCEDURAL: dict[str, Callable[[], trimesh.Trimesh]] = {
    **{name.removesuffix(".ply"): make for name, make in PROCEDURAL_MESHES.items()},
    "room": room_mesh,
}


def scene_mesh(path: Path) -> trimesh.Trimesh:
    """The mesh of the surface in the scene file ``path``, meters.

    Raises:
        InputError: the file is not a scene, or its container is empty.
    """
    surface = Scene.load(path).build_surface()
    if surface is None:
        raise InputError(f"{path}: its container is empty; give a scene with a surface")
    return surface.to_mesh(SCENE_RESOLUTION)
