"""Triangles from a file made into a solid: merged, oriented, checked, in coordinates of its own."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surfsup.errors import InputError
from surfsup.sdf.mesh.duplicates import without_duplicates
from surfsup.sdf.mesh.orientation import orient_consistently, orient_outward, same_orientation
from surfsup.sdf.mesh.sheets import sheet_faces
from surfsup.sdf.mesh.topology import area_vectors, open_edges, used_vertices

if TYPE_CHECKING:
    import trimesh

FLAT = 1e-6  # thickness over largest extent below which a mesh has no inside
MERGE_DIGITS = 8  # vertices that agree to this many digits of the largest extent are one
MAX_COORDINATE = 1e150  # beyond it areas and volumes are infinite in double precision
MOSTLY = 0.5  # share of the area that are sheets above which a mesh is refused


class MeshWarning(UserWarning):
    """A mesh has a defect but can be used; the message says how the defect was handled."""


def clean(vertices: np.ndarray, faces: np.ndarray, path: Path, keep_sheets: bool = False) -> trimesh.Trimesh:
    """The solid without superfluous elements and with faces oriented outward.

    All of it works with vertices centered and scaled to a largest extent of one, in double precision. The result has
    the coordinates of the file.

    Args:
        vertices: (V, 3).
        faces: (F, 3).
        path: of the file, for messages.
        keep_sheets: keep parts without thickness, without a word, for the caller to thicken.

    Raises:
        InputError: It has vertices that are not finite, or no inside.
    """
    import trimesh

    used = used_vertices(faces, len(vertices))
    faces, vertices = (np.cumsum(used) - 1)[faces], vertices[used]
    bad = int((~np.isfinite(vertices)).any(axis=1).sum())
    if bad:
        raise InputError(f"{path}: {bad} of its vertices are not finite numbers (NaN or infinity); export it again")
    local = centered_and_scaled(vertices, path)
    first, inverse = trimesh.grouping.unique_rows(local, digits=MERGE_DIGITS)
    vertices, local, faces = vertices[first], local[first], inverse[faces]
    faces = faces[distinct_corners(faces)]
    require_thickness(local, faces, path, keep_sheets)

    faces = without_duplicates(local, faces, lambda part: oriented(local, part)[0])
    given = faces
    faces, patch = orient_consistently(local, faces)
    flipped = int((~same_orientation(faces, given)).sum())
    if flipped:
        warn(path, f"had faces oriented against their neighbors, {flipped} of {len(faces)}; they were flipped")
    faces, turned, bodies = orient_outward(local, faces, patch)
    faces = handle_openings(local, faces, path, keep_sheets)
    if turned:
        if turned == bodies:
            warn(path, "is inside out; all of its faces were flipped")
        else:
            warn(path, f"has {turned} of {bodies} bodies inside out; their faces were flipped")
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.remove_unreferenced_vertices()
    return mesh


def oriented(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, int, int]:
    """``faces`` oriented consistently and outward; see :func:`orient_outward`."""
    faces, patch = orient_consistently(vertices, faces)
    return orient_outward(vertices, faces, patch)


def centered_and_scaled(vertices: np.ndarray, path: Path) -> np.ndarray:
    """``vertices`` (V, 3) with the middle of their box at 0 and a largest extent of one.

    Raises:
        InputError: They are too large for double precision, or all in one place.
    """
    if len(vertices) == 0:
        return vertices
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    largest = float(max(np.abs(lower).max(), np.abs(upper).max()))
    if largest > MAX_COORDINATE:
        raise InputError(f"{path}: has coordinates of {largest:.3g}, too large to compute with; scale it down")
    middle = lower + (upper - lower) / 2
    extent = float((upper - lower).max())
    if extent < np.finfo(float).tiny:
        raise InputError(f"{path}: is flat, so it has no inside: all of its vertices are in one place")
    return (vertices - middle) / extent


def distinct_corners(faces: np.ndarray) -> np.ndarray:
    """Which faces (F,) have three distinct vertices.

    Slivers with distinct vertices stay: without them the mesh would have holes.
    """
    return (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])


def require_thickness(vertices: np.ndarray, faces: np.ndarray, path: Path, flat_allowed: bool) -> None:
    """Refuse a planar mesh.

    Raises:
        InputError: The mesh is planar, or has no faces.
    """
    if len(faces) and flat_allowed:
        return
    if len(faces):
        used = vertices[np.unique(faces)]
        spread = np.linalg.svd(used - used.mean(axis=0), compute_uv=False, full_matrices=False)
        if spread[-1] > FLAT * spread[0] and len(faces) > 2:
            return
    raise InputError(f"{path}: is flat, so it has no inside; give a solid, or a sheet with some thickness")


def handle_openings(vertices: np.ndarray, faces: np.ndarray, path: Path, keep_sheets: bool) -> np.ndarray:
    """The faces without sheets, after a warning that says what happens to water at each kind of opening.

    Raises:
        InputError: The mesh consists of sheets, at least for the most part.
    """
    if keep_sheets or not (is_open := open_edges(faces)).any():
        return faces
    sheet = sheet_faces(vertices, faces)
    if sheet.any():
        area = np.linalg.norm(area_vectors(vertices, faces), axis=1)
        share = float(area[sheet].sum() / area.sum())
        remedy = "give them walls with --thicken 0.03 (thicken: 0.03 in a scene file)"
        if share > MOSTLY:
            raise InputError(
                f"{path}: is an open sheet without thickness, or triangles that enclose nothing, so water would run "
                "through it; "
                "give it walls with --thicken 0.03 (thicken: 0.03 in a scene file), or close it"
            )
        warn(
            path,
            f"has sheets without thickness, {100 * share:.2g} % of its area, which were left out: "
            f"water passes where they are; {remedy}",
        )
        faces, is_open = faces[~sheet], open_edges(faces[~sheet])
    if is_open.any():
        warn(path, "has holes; its winding number defines the inside, as if they were closed: no water enters by them")
    return faces


def warn(path: Path, defect: str) -> None:
    """Warn of a defect of the mesh."""
    warnings.warn(f"{path}: {defect}", MeshWarning, stacklevel=2)
