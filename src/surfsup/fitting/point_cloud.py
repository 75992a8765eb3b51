"""Oriented point clouds: points on a surface with outward normals."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surfsup.errors import InputError
from surfsup.fitting.cloud_normals import check_normals
from surfsup.sdf.mesh.cleaning import FLAT
from surfsup.sdf.mesh.query import unit

CLOUD_SUFFIXES = (".xyz", ".ply")
MIN_POINTS = 100
NORMAL_NAMES = ("nx", "ny", "nz")
NORMALS_HINT = (
    "estimate and orient them, for instance in MeshLab ('Compute normals for point sets') or with Open3D's "
    "estimate_normals and orient_normals_consistent_tangent_plane, and export them as nx ny nz"
)


@dataclass(frozen=True)
class PointCloud:
    """Points on the surface of a solid.

    Attributes:
        points: (N, 3) in the file's own unit.
        normals: (N, 3) of length one, outward.
    """

    points: np.ndarray
    normals: np.ndarray


def is_cloud(path: Path) -> bool:
    """Whether the file ``path`` contains points but no triangles."""
    if path.suffix.lower() == ".xyz":
        return True
    if path.suffix.lower() != ".ply" or not path.is_file():
        return False
    with path.open("rb") as file:
        for line in file:
            words = line.split()
            if words[:2] == [b"element", b"face"]:
                return int(words[2]) == 0 if len(words) > 2 and words[2].isdigit() else False
            if words[:1] == [b"end_header"]:
                return True
    return False


def load_cloud(path: Path) -> PointCloud:
    """Read the oriented points of a PLY file (x y z nx ny nz) or an XYZ file (six numbers a line).

    Raises:
        InputError: the file is missing or damaged, has no normals, too few points or numbers that are not finite, all
            points are in a plane, or the normals cannot be those of its surface.

    Warns:
        CloudWarning: the normals point inward.
    """
    if not path.is_file():
        raise InputError(f"{path}: cannot be read; check the path")
    rows = parse_ply(path) if path.suffix.lower() == ".ply" else parse_xyz(path)
    if len(rows) < MIN_POINTS:
        count = len(rows) or "no"
        raise InputError(f"{path}: has {count} points; give a cloud of at least {MIN_POINTS}, better 100,000")
    if not np.isfinite(rows).all():
        raise InputError(f"{path}: has numbers that are not finite (NaN or infinity); export it again")
    points, normals = rows[:, :3], rows[:, 3:]
    zero = int((np.linalg.norm(normals, axis=1) < 1e-9).sum())
    if zero:
        raise InputError(f"{path}: {zero} of its normals are zero; {NORMALS_HINT}")
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False, full_matrices=False)
    if spread[-1] <= FLAT * spread[0]:
        raise InputError(f"{path}: is flat, so it has no inside; give points on all sides of a solid")
    check_normals(points, normals, str(path), NORMALS_HINT)
    return PointCloud(points, unit(normals))


def parse_xyz(path: Path) -> np.ndarray:
    """The numbers of an XYZ file (N, 6).

    Raises:
        InputError: the file is not text, or a line does not have six numbers.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        raise InputError(f"{path}: cannot be read as text; export it as XYZ with normals") from None
    filled = [(number, line.split()) for number, line in enumerate(lines, 1) if line.strip() and line[0] not in "#/"]
    rows = np.empty((len(filled), 6))
    for row, (number, words) in zip(rows, filled, strict=True):
        if len(words) == 3:
            raise InputError(f"{path}: its points have no normals (line {number} has 3 numbers); {NORMALS_HINT}")
        try:
            row[:] = [float(word) for word in words[:6]]
        except ValueError:
            raise InputError(f"{path}: line {number} is not six numbers, x y z nx ny nz") from None
    return rows


def parse_ply(path: Path) -> np.ndarray:
    """The positions and normals of a PLY file (N, 6).

    Raises:
        InputError: the file is damaged or has no normals.
    """
    from trimesh.exchange.ply import load_ply

    try:
        vertices = load_ply(io.BytesIO(path.read_bytes()), skip_materials=True)["metadata"]["_ply_raw"]["vertex"]
        if vertices["length"] == 0:
            return np.empty((0, 6))
        raw = vertices["data"]
        columns = {name: np.asarray(raw[name], dtype=np.float64).reshape(-1) for name in property_names(raw)}
        positions = np.stack([columns[name] for name in "xyz"], axis=1)
    except Exception as error:
        # The reader raises all kinds of exceptions on damaged files.
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{path}: is damaged or is no PLY file ({reason}); export it again") from None
    if not set(NORMAL_NAMES) <= set(columns):
        raise InputError(f"{path}: its points have no normals (no nx, ny, nz); {NORMALS_HINT}")
    return np.concatenate([positions, np.stack([columns[name] for name in NORMAL_NAMES], axis=1)], axis=1)


def property_names(raw: np.ndarray | Mapping[str, object]) -> list[str]:
    """The names of the vertex properties: the reader returns binary files as an array, text files as a mapping."""
    return list(raw.dtype.names or ()) if isinstance(raw, np.ndarray) else list(raw)
