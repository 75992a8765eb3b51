"""A designed surface as files: for a printer, for a viewer, for a scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from surfsup.errors import InputError
from surfsup.scene import PARTICLE_RADIUS
from surfsup.sdf import Surface

RESOLUTION = 128  # cells along the longest side
DIGITS = (6, 5, 7)  # of a corner's place in meters; a float of an STL in millimeters holds seven
SPECK = 4 / 3 * np.pi * PARTICLE_RADIUS**3  # m³
MILLIMETERS = 1000.0  # a meter; STL knows no units, and printers take millimeters
# glTF has y up: (x, y, z) -> (x, z, -y).
Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def write_shape(surface: Surface, folder: Path, name: str) -> list[Path]:
    """Write ``name.stl`` in millimeters, z up; ``name.glb`` in meters, y up; ``name.obj`` in meters, z up.

    Raises:
        InputError: the surface is not closed, so that no printer could fill it, or cannot be seen on the grid.
    """
    mesh = closed(surface.to_mesh(RESOLUTION), name)
    paths = [folder / f"{name}.{kind}" for kind in ("stl", "glb", "obj")]
    scaled = mesh.copy()
    scaled.apply_scale(MILLIMETERS)
    turned = mesh.copy()
    turned.apply_transform(Y_UP)
    for path, form in zip(paths, (scaled, turned, mesh), strict=True):
        partial = path.with_name(f".{path.stem}.partial{path.suffix}")
        form.export(partial)
        partial.replace(path)
    return paths


def closed(mesh: trimesh.Trimesh, name: str) -> trimesh.Trimesh:
    """The mesh without slivers, once it is known to hold a volume.

    Corners nearer than about a micrometer become one: whoever reads an STL does the same, and would find holes where
    slivers were. Where two sheets meet in a crease that may join them, and another distance may not.

    Raises:
        InputError: it holds none.
    """
    for digits in DIGITS:
        merged = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        merged.merge_vertices(digits_vertex=digits)
        corners = merged.faces
        merged.update_faces((corners != np.roll(corners, 1, axis=1)).all(axis=1))
        if merged.is_watertight and merged.is_winding_consistent and merged.volume > 0:
            return without_specks(merged)
    raise InputError(
        f"{name}: the surface has a hole at {RESOLUTION} cells, or parts thinner than one; "
        "it cannot be printed as it is"
    )


def without_specks(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh without bodies and hollows smaller than a particle, which neural surfaces have and no water feels."""
    bodies = mesh.split(only_watertight=False)
    large = [body for body in bodies if abs(body.volume) >= SPECK]
    return trimesh.util.concatenate(large) if 0 < len(large) < len(bodies) else mesh
