"""Mesh files: read as data, checked, mended where that is safe, refused with one clear line where not."""

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
FLAT = 1e-6  # thickness over largest extent, below which nothing can be inside
OPEN_SHEET = 0.75  # |sum of the area vectors| / area: 0 for a closed mesh, 0.5 for a hemisphere, 1 for a sheet


class MeshWarning(UserWarning):
    """A mesh has a fault that it can be used with; the message says what was done about it."""


def load_mesh(path: str | Path, up: Literal["y", "z"] | None = None) -> trimesh.Trimesh:
    """The triangles of a mesh file, in the file's own unit, with z up and the faces turned outward.

    The named file alone is read: no textures, no materials, no network. Objects of a scene are put where the
    scene has them and joined; polygons are cut into triangles; equal vertices are merged; degenerate and
    duplicate faces and vertices that no face uses are dropped.

    Args:
        path: an OBJ, STL, PLY, OFF or GLB file.
        up: the axis that points up in the file. GLB is y-up by its specification; the others do not say and
            are left as they are. Many OBJ files (the Stanford dragon) are y-up: ``up="y"`` is for those.

    Raises:
        InputError: the file is missing, of an unknown kind, damaged, without triangles, with vertices that
            are not finite, or flat, so that it has no inside.

    Warns:
        MeshWarning: the mesh has holes (the winding number then decides what is inside), or its faces were
            turned against one another or all inward, and were turned.
    """
    path = Path(path)
    kind = path.suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise InputError(f"{path}: is no mesh file that can be read; give one that ends in {known_endings()}")
    if up not in ("y", "z", None):
        raise InputError(f"{path}: up is {up!r}, but must be y or z, the axis that points up in the file")
    mesh = clean(parse(path, kind), path)
    if (up or ("y" if kind == "glb" else "z")) == "y":
        mesh.vertices = np.asarray(mesh.vertices)[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    return mesh


def fit_mesh(mesh: trimesh.Trimesh, largest_extent: float) -> tuple[trimesh.Trimesh, float]:
    """A copy whose largest extent is ``largest_extent`` meters, centered on x = y = 0 and standing on z = 0.

    Returns:
        The copy, and the scale that it was multiplied by.

    Raises:
        InputError: the extent is not a positive number.
    """
    if not (np.isfinite(largest_extent) and largest_extent > 0):
        raise InputError(f"fit: the largest extent is {largest_extent}, but must be a positive number of meters")
    lower, upper = np.asarray(mesh.bounds)
    scale = float(largest_extent / (upper - lower).max())
    middle = (lower + upper) / 2
    fitted = mesh.copy()
    fitted.vertices = (np.asarray(mesh.vertices) - [middle[0], middle[1], lower[2]]) * scale
    return fitted, scale


def known_endings() -> str:
    """The endings that can be read, for a message."""
    return ", ".join(f".{known}" for known in FORMATS[:-1]) + f" or .{FORMATS[-1]}"


def parse(path: Path, kind: str) -> trimesh.Trimesh:
    """The file's triangles just as they are.

    Raises:
        InputError: it cannot be read, or holds no triangles.
    """
    import trimesh

    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    if not content:
        raise InputError(f"{path}: is empty; export it again")
    try:
        # From memory and without a resolver, the loader has no way to open anything else.
        scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False, skip_materials=True)
        mesh = scene.to_mesh()
        faces, vertices = np.asarray(mesh.faces), np.asarray(mesh.vertices, dtype=np.float64)
        broken = len(faces) > 0 and (faces.min() < 0 or faces.max() >= len(vertices))
    except Exception as error:
        # Loaders fail on damaged files in every way there is.
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{path}: is damaged or is no {kind.upper()} file ({reason}); export it again") from error
    if broken:
        raise InputError(f"{path}: is damaged: faces name vertices that it does not have; export it again")
    if len(faces) == 0:
        raise InputError(f"{path}: holds no triangles that can be read; is it a whole {kind.upper()} mesh?")
    return trimesh.Trimesh(vertices, faces, process=False)


def clean(mesh: trimesh.Trimesh, path: Path) -> trimesh.Trimesh:
    """The mesh without what is superfluous and with its faces outward.

    Raises:
        InputError: it has vertices that are not finite, or no inside.
    """
    mesh.remove_unreferenced_vertices()
    bad = int((~np.isfinite(mesh.vertices)).any(axis=1).sum())
    if bad:
        raise InputError(f"{path}: {bad} of its vertices are not finite numbers (NaN or infinity); export it again")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(distinct_corners(mesh) & mesh.unique_faces())
    mesh.remove_unreferenced_vertices()
    require_thickness(mesh, path)
    mesh = turn_alike(mesh, path)
    if not mesh.is_watertight:
        area_vectors = np.asarray(mesh.area_faces)[:, None] * np.asarray(mesh.face_normals)
        if np.linalg.norm(area_vectors.sum(axis=0)) > OPEN_SHEET * mesh.area:
            raise InputError(f"{path}: is an open sheet, which has no inside; give it thickness or close it")
        warn(path, "has holes; what is inside is decided by its winding number, as if they were closed")
    turn_outward(mesh, path)
    return mesh


def distinct_corners(mesh: trimesh.Trimesh) -> np.ndarray:
    """Which faces (F,) have three different corners.

    A sliver whose corners differ stays: without it the mesh would have a hole.
    """
    faces = mesh.faces
    return (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])


def require_thickness(mesh: trimesh.Trimesh, path: Path) -> None:
    """Refuse what lies in a plane.

    Raises:
        InputError: it does.
    """
    if len(mesh.faces):
        centered = np.asarray(mesh.vertices) - np.asarray(mesh.vertices).mean(axis=0)
        spread = np.linalg.svd(centered, compute_uv=False, full_matrices=False)
        if spread[-1] > FLAT * spread[0] and len(mesh.faces) > 2:
            return
    raise InputError(f"{path}: is flat, so it has no inside; give a solid, or a sheet with some thickness")


def turn_alike(mesh: trimesh.Trimesh, path: Path) -> trimesh.Trimesh:
    """The mesh with neighboring faces turned alike.

    In each connected patch the side that most of the area faces wins, so that a cavity stays a cavity.
    """
    import igl
    import trimesh

    if mesh.is_winding_consistent:
        return mesh
    before = np.asarray(mesh.faces)
    faces, patch = igl.bfs_orient(np.ascontiguousarray(before, dtype=np.int64))
    vote = np.bincount(patch, weights=np.where(same_turn(faces, before), mesh.area_faces, -mesh.area_faces))
    faces = np.where((vote < 0)[patch][:, None], faces[:, ::-1], faces)
    turned = int((~same_turn(faces, before)).sum())
    if turned:
        warn(
            path,
            f"had faces turned against their neighbors, {turned} of {len(faces)}; they were turned over",
        )
    else:
        warn(path, "has faces that are turned against their neighbors and cannot be turned alike")
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def turn_outward(mesh: trimesh.Trimesh, path: Path) -> None:
    """Turn all faces over, in place, if the volume that they enclose is negative."""
    corners = (np.asarray(mesh.vertices) - np.asarray(mesh.bounds).mean(axis=0))[mesh.faces]
    if np.linalg.det(corners).sum() < 0:
        mesh.invert()
        warn(path, "is inside out; all of its faces were turned over")


def same_turn(faces: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Which faces (F,) list the same corners as ``others`` in the same sense of rotation."""
    return np.any([(faces == np.roll(others, shift, axis=1)).all(axis=1) for shift in range(3)], axis=0)


def warn(path: Path, fault: str) -> None:
    """Say what is wrong with the mesh, and go on."""
    warnings.warn(f"{path}: {fault}", MeshWarning, stacklevel=2)
