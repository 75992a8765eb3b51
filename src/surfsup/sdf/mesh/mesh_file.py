"""Mesh files: read as data, checked, repaired where that is safe and refused where it is not."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from surfsup.errors import InputError

if TYPE_CHECKING:
    import trimesh

FORMATS = ("obj", "stl", "ply", "off", "glb")
FLAT = 1e-6  # thickness over largest extent below which a mesh has no inside
OPEN_SHEET = 0.75  # |sum of the area vectors| / area: 0 for a closed mesh, 0.5 for a hemisphere, 1 for a sheet


class MeshWarning(UserWarning):
    """A mesh has a defect but can be used; the message says how the defect was handled."""


def load_mesh(path: str | Path, up: Literal["y", "z"] | None = None) -> trimesh.Trimesh:
    """The triangles of a mesh file, in the units of the file, with z up and faces oriented outward.

    Only this file is read: no textures, materials or network. The objects of a scene are placed and joined, polygons
    are triangulated, equal vertices are merged. Degenerate faces, duplicate faces and unused vertices are removed.

    Args:
        path: An OBJ, STL, PLY, OFF or GLB file.
        up: The axis that points up in the file. GLB is y-up by its specification. The other formats do not specify it
            and are z-up by default; many OBJ files (the Stanford dragon) need ``up="y"``.

    Raises:
        InputError: The file is missing, of an unknown format, damaged, without triangles, with vertices that are not
            finite, or flat, so that it has no inside.

    Warns:
        MeshWarning: The mesh has holes, and winding numbers define its inside; or faces had inconsistent or inward
            orientation and were flipped.
    """
    path = Path(path)
    kind = path.suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise InputError(f"{path}: is not a mesh file that can be read; give one that ends in {known_suffixes()}")
    if up not in ("y", "z", None):
        raise InputError(f"{path}: up is {up!r}, but must be y or z, the axis that points up in the file")
    mesh = clean(parse(path, kind), path)
    if (up or ("y" if kind == "glb" else "z")) == "y":
        mesh.vertices = np.asarray(mesh.vertices)[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    return mesh


def fit_mesh(mesh: trimesh.Trimesh, largest_extent: float) -> tuple[trimesh.Trimesh, float]:
    """A copy with a largest extent in meters, centered on x = y = 0 and standing on z = 0.

    Returns:
        The copy, and its scale relative to ``mesh``.

    Raises:
        InputError: The extent is not a positive number.
    """
    if not (np.isfinite(largest_extent) and largest_extent > 0):
        raise InputError(f"fit: the largest extent is {largest_extent}, but must be a positive number of meters")
    lower, upper = np.asarray(mesh.bounds)
    scale = float(largest_extent / (upper - lower).max())
    middle = (lower + upper) / 2
    fitted = mesh.copy()
    fitted.vertices = (np.asarray(mesh.vertices) - [middle[0], middle[1], lower[2]]) * scale
    return fitted, scale


def known_suffixes() -> str:
    """The supported file name suffixes, for messages."""
    return ", ".join(f".{known}" for known in FORMATS[:-1]) + f" or .{FORMATS[-1]}"


def parse(path: Path, kind: str) -> trimesh.Trimesh:
    """The unprocessed triangles of the file.

    Raises:
        InputError: The file cannot be read, or contains no triangles.
    """
    import trimesh

    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    if not content:
        raise InputError(f"{path}: is empty; export it again")
    try:
        # Loading from memory without a resolver keeps the loader from opening other files.
        scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False, skip_materials=True)
        mesh = scene.to_mesh()
        faces, vertices = np.asarray(mesh.faces), np.asarray(mesh.vertices, dtype=np.float64)
        broken = len(faces) > 0 and (faces.min() < 0 or faces.max() >= len(vertices))
    except Exception as error:
        # Loaders raise all kinds of exceptions on damaged files.
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{path}: is damaged or not a {kind.upper()} file ({reason}); export it again") from error
    if broken:
        raise InputError(f"{path}: is damaged: faces refer to vertices that do not exist; export it again")
    if len(faces) == 0:
        raise InputError(f"{path}: contains no triangles that can be read; is it a complete {kind.upper()} mesh?")
    return trimesh.Trimesh(vertices, faces, process=False)


def clean(mesh: trimesh.Trimesh, path: Path) -> trimesh.Trimesh:
    """The mesh without superfluous elements and with faces oriented outward.

    Raises:
        InputError: It has vertices that are not finite, or no inside.
    """
    mesh.remove_unreferenced_vertices()
    bad = int((~np.isfinite(mesh.vertices)).any(axis=1).sum())
    if bad:
        raise InputError(f"{path}: {bad} of its vertices are not finite numbers (NaN or infinity); export it again")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(distinct_corners(mesh) & mesh.unique_faces())
    mesh.remove_unreferenced_vertices()
    require_thickness(mesh, path)
    mesh = orient_consistently(mesh, path)
    if not mesh.is_watertight:
        area_vectors = np.asarray(mesh.area_faces)[:, None] * np.asarray(mesh.face_normals)
        if np.linalg.norm(area_vectors.sum(axis=0)) > OPEN_SHEET * mesh.area:
            raise InputError(f"{path}: is an open sheet, which has no inside; give it thickness or close it")
        warn(path, "has holes; its winding number defines the inside, as if they were closed")
    orient_outward(mesh, path)
    return mesh


def distinct_corners(mesh: trimesh.Trimesh) -> np.ndarray:
    """Which faces (F,) have three distinct vertices.

    Slivers with distinct vertices stay: without them the mesh would have holes.
    """
    faces = mesh.faces
    return (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])


def require_thickness(mesh: trimesh.Trimesh, path: Path) -> None:
    """Refuse a planar mesh.

    Raises:
        InputError: The mesh is planar.
    """
    if len(mesh.faces):
        centered = np.asarray(mesh.vertices) - np.asarray(mesh.vertices).mean(axis=0)
        spread = np.linalg.svd(centered, compute_uv=False, full_matrices=False)
        if spread[-1] > FLAT * spread[0] and len(mesh.faces) > 2:
            return
    raise InputError(f"{path}: is flat, so it has no inside; give a solid, or a sheet with some thickness")


def orient_consistently(mesh: trimesh.Trimesh, path: Path) -> trimesh.Trimesh:
    """The mesh with consistently oriented faces.

    In each connected patch the orientation of the larger area wins, so that a cavity stays a cavity.
    """
    import igl
    import trimesh

    if mesh.is_winding_consistent:
        return mesh
    before = np.asarray(mesh.faces)
    faces, patch = igl.bfs_orient(np.ascontiguousarray(before, dtype=np.int64))
    vote = np.bincount(patch, weights=np.where(same_orientation(faces, before), mesh.area_faces, -mesh.area_faces))
    faces = np.where((vote < 0)[patch][:, None], faces[:, ::-1], faces)
    flipped = int((~same_orientation(faces, before)).sum())
    if flipped:
        warn(
            path,
            f"had faces oriented against their neighbors, {flipped} of {len(faces)}; they were flipped",
        )
    else:
        warn(path, "has faces oriented against their neighbors and cannot be oriented consistently")
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def orient_outward(mesh: trimesh.Trimesh, path: Path) -> None:
    """Flip all faces in place if the enclosed volume is negative."""
    corners = (np.asarray(mesh.vertices) - np.asarray(mesh.bounds).mean(axis=0))[mesh.faces]
    if np.linalg.det(corners).sum() < 0:
        mesh.invert()
        warn(path, "is inside out; all of its faces were flipped")


def same_orientation(faces: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Which faces (F,) list the same vertices as ``others`` in the same cyclic order."""
    return np.any([(faces == np.roll(others, shift, axis=1)).all(axis=1) for shift in range(3)], axis=0)


def warn(path: Path, defect: str) -> None:
    """Warn of a defect of the mesh."""
    warnings.warn(f"{path}: {defect}", MeshWarning, stacklevel=2)
