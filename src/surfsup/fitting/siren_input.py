"""What a SIREN can be fitted to: a mesh, an oriented point cloud, the solid of a scene file, or our own sculptures."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surfsup.datasets.procedural.room import room
from surfsup.datasets.recipes.complex_scenes import SCULPTED
from surfsup.errors import InputError
from surfsup.fitting.exact import Exact, ExactMesh
from surfsup.fitting.point_cloud import CLOUD_ENDINGS, is_cloud, load_cloud
from surfsup.fitting.siren_fit import SirenTarget
from surfsup.scene import Scene
from surfsup.sdf import load_mesh
from surfsup.sdf.mesh.mesh_file import FORMATS

if TYPE_CHECKING:
    import trimesh

SCENES = (".yaml", ".yml")
SCENE_RESOLUTION = 256  # cells of the triangles of a solid that has none of its own


def read_input(path: Path, up: str | None, samples: int, seed: int) -> tuple[SirenTarget, Exact | None]:
    """The points of the input in ``path``, and its exact shape, which a cloud does not have.

    Args:
        path: a mesh, a cloud or a scene file, or the name of one of the project's own sculptures.
        up: the input's own upward axis, "y" or "z"; None takes the file format's.
        samples: points to draw on the surface of a mesh.
        seed: where the choice of points starts.

    Raises:
        InputError: the file is missing or cannot be used.
    """
    if up not in (None, "y", "z"):
        raise InputError(f"--up is '{up}', but must be y or z")
    ending = path.suffix.lower()
    if path.name in OWN and not path.exists():
        shape = ExactMesh(OWN[path.name]())
        return SirenTarget.of_solid(shape, samples, seed), shape
    if ending[1:] not in FORMATS and ending not in (*CLOUD_ENDINGS, *SCENES):
        known = ", ".join([*(f".{name}" for name in FORMATS), ".xyz", ".yaml"])
        raise InputError(
            f"{path}: is nothing that a SIREN can be fitted to; give a file that ends in one of {known}, "
            f"or one of {', '.join(OWN)}"
        )
    if ending in SCENES:
        shape = ExactMesh(solid_of(path))
        return SirenTarget.of_solid(shape, samples, seed), shape
    if is_cloud(path):
        cloud = load_cloud(path)
        if up == "y":
            turned = (np.stack([v[:, 0], -v[:, 2], v[:, 1]], axis=1) for v in (cloud.points, cloud.normals))
            cloud = dataclasses.replace(cloud, **dict(zip(("points", "normals"), turned, strict=True)))
        return SirenTarget.of_cloud(cloud, seed), None
    shape = ExactMesh(load_mesh(path, up=up))
    return SirenTarget.of_solid(shape, samples, seed), shape


def room_mesh() -> trimesh.Trimesh:
    """The triangles of the furnished room, meters."""
    return room().surface().to_mesh(SCENE_RESOLUTION)


OWN: dict[str, Callable[[], trimesh.Trimesh]] = {
    **{name.removesuffix(".ply"): make for name, make in SCULPTED.items()},
    "room": room_mesh,
}


def solid_of(path: Path) -> trimesh.Trimesh:
    """The triangles of the solid in the scene file ``path``, meters.

    Raises:
        InputError: the file is no scene, or its container is empty.
    """
    surface = Scene.load(path).build_surface()
    if surface is None:
        raise InputError(f"{path}: its container is empty; give a scene with a surface")
    return surface.to_mesh(SCENE_RESOLUTION)
