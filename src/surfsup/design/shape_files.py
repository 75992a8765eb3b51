"""Export of a designed surface: for a printer, a viewer and a scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from surfsup.errors import InputError
from surfsup.scene import PARTICLE_RADIUS
from surfsup.sdf import Surface

RESOLUTION = 128  # cells along the longest side
MERGE_DIGITS = (6, 5, 7)  # decimals, in meters, to which vertices are merged; an STL's floats hold seven digits
MIN_VOLUME = 4 / 3 * np.pi * PARTICLE_RADIUS**3  # m³, of a particle
MILLIMETERS = 1000.0  # per meter; STL has no unit, and printers assume millimeters
# glTF has y up: (x, y, z) -> (x, z, -y).
Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def write_shape(surface: Surface, folder: Path, name: str) -> list[Path]:
    """Write ``name.stl`` in millimeters, z up; ``name.glb`` in meters, y up; ``name.obj`` in meters, z up.

    Raises:
        InputError: the mesh is not watertight, or the surface is too thin for the grid.
    """
    mesh = make_watertight(surface.to_mesh(RESOLUTION), name)
    paths = [folder / f"{name}.{kind}" for kind in ("stl", "glb", "obj")]
    in_millimeters, y_up = mesh.copy(), mesh.copy()
    in_millimeters.apply_scale(MILLIMETERS)
    y_up.apply_transform(Y_UP)
    for path, exported in zip(paths, (in_millimeters, y_up, mesh), strict=True):
        partial = path.with_name(f".{path.stem}.partial{path.suffix}")
        exported.export(partial)
        partial.replace(path)
    return paths


def make_watertight(mesh: trimesh.Trimesh, name: str) -> trimesh.Trimesh:
    """The mesh without degenerate triangles, verified to enclose a volume.

    Vertices nearer than about a micrometer are merged: readers of STL do the same, and would find holes at slivers.
    Merging can join two sheets that meet in a crease, so other distances are tried next.

    Raises:
        InputError: no distance gives a watertight mesh.
    """
    for digits in MERGE_DIGITS:
        merged = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        merged.merge_vertices(digits_vertex=digits)
        corners = merged.faces
        merged.update_faces((corners != np.roll(corners, 1, axis=1)).all(axis=1))
        if merged.is_watertight and merged.is_winding_consistent and merged.volume > 0:
            return remove_small_bodies(merged)
    raise InputError(
        f"{name}: the surface has a hole or is thinner than a cell at {RESOLUTION} cells, so it cannot be printed"
    )


def remove_small_bodies(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh without bodies and cavities smaller than a particle, which neural surfaces have."""
    bodies = mesh.split(only_watertight=False)
    large = [body for body in bodies if abs(body.volume) >= MIN_VOLUME]
    if not 0 < len(large) < len(bodies):
        return mesh
    kept = trimesh.util.concatenate(large)
    assert isinstance(kept, trimesh.Trimesh)
    return kept
