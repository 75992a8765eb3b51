"""Mesh files: read as data, checked, repaired where that is safe and refused where it is not."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from surfsup.activity import activity
from surfsup.cache import cached, digest
from surfsup.errors import InputError
from surfsup.memory import available_memory
from surfsup.sdf.mesh.cleaning import MeshWarning, clean, warn
from surfsup.sdf.mesh.readers.identify import READERS, identify, known_suffixes
from surfsup.sdf.mesh.readers.raw_mesh import RawMesh, UnreadableMeshError

if TYPE_CHECKING:
    import trimesh

FORMATS = tuple(READERS)
SMALL = 10_000_000  # bytes of a file that any machine has memory for
MEMORY_PER_BYTE = 30  # bytes of memory for a byte of a file: 17 in binary STL, 30 in OBJ, 46 in binary PLY (measured)


def load_mesh(path: str | Path, up: Literal["y", "z"] | None = None, keep_sheets: bool = False) -> trimesh.Trimesh:
    """The triangles of a mesh file, in the units of the file, with z up and faces oriented outward.

    Only this file is read: no textures, materials or network. Its content decides on its format, not its name. The
    objects of a scene are placed and joined, polygons are triangulated, equal vertices are merged. Degenerate faces,
    duplicate faces, walls between bodies that share faces and unused vertices are removed.

    The triangles of a file whose content is known come from the :mod:`surfsup.cache`, with the same warnings.

    Args:
        path: An OBJ, STL, PLY, OFF, GLB or glTF file.
        up: The axis that points up in the file. glTF is y-up by its specification. The other formats do not specify it
            and are z-up by default; many OBJ files (the Stanford dragon) need ``up="y"``.
        keep_sheets: Keep parts without thickness for :func:`thicken_sheets`, instead of refusing them.

    Raises:
        InputError: The file is missing, of an unknown format, damaged, without triangles, with vertices that are not
            finite, or flat, or a sheet, so that it has no inside.

    Warns:
        MeshWarning: The mesh has holes, and winding numbers define its inside; sheets were left out; faces or bodies
            were flipped; or something in the file was skipped.
    """
    import trimesh

    path = Path(path)
    if up not in ("y", "z", None):
        raise InputError(f"{path}: up is {up!r}, but must be y or z, the axis that points up in the file")
    try:
        if path.stat().st_size > SMALL:
            require_memory(path)
        content = path.read_bytes()
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or "its name is no name of a file"
        raise InputError(f"{path}: cannot be read ({reason}); check the path") from error
    key = digest(content, path.suffix.lower(), up, keep_sheets)
    with activity(f"reading {path}"):
        arrays = cached("mesh", key, lambda: read_and_repair(content, path, up, keep_sheets))
    for defect in json.loads(arrays["defects"].tobytes()):
        warn(path, defect)
    return trimesh.Trimesh(arrays["vertices"], arrays["faces"], process=False)


def require_memory(path: Path) -> None:
    """Refuse a file so large that this machine has no memory to read and repair it.

    Raises:
        InputError: with the memory that it takes.
        OSError: the file is missing.
    """
    size, free = path.stat().st_size, available_memory()
    if MEMORY_PER_BYTE * size > free:
        raise InputError(
            f"{path}: has {size / 1e9:.3g} GB, and reading it takes some {MEMORY_PER_BYTE * size / 1e9:.3g} GB of "
            f"memory, of which this machine has {free / 1e9:.2g}; reduce its triangles first, for instance by the "
            "modifier Decimate of Blender"
        )


def read_and_repair(
    content: bytes, path: Path, up: Literal["y", "z"] | None, keep_sheets: bool
) -> dict[str, np.ndarray]:
    """Vertices and faces of :func:`load_mesh` from the content of a file, and the texts of the warnings."""
    caught: list[warnings.WarningMessage] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", MeshWarning)
            raw, kind = read_mesh(content, path)
            mesh = clean(raw.vertices, raw.faces, path, keep_sheets)
    except InputError:
        for warning in caught:  # of what was found before
            warnings.warn(warning.message, stacklevel=2)
        raise
    texts = [str(warning.message) for warning in caught if issubclass(warning.category, MeshWarning)]
    defects = [text.removeprefix(f"{path}: ") for text in texts]
    vertices = np.asarray(mesh.vertices)
    if (up or ("y" if kind in ("glb", "gltf") else "z")) == "y":
        vertices = vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    return {
        "vertices": np.array(vertices, np.float64),
        "faces": np.array(mesh.faces, np.int64),
        "defects": np.frombuffer(json.dumps(defects).encode(), np.uint8),
    }


def read_mesh(content: bytes, path: Path) -> tuple[RawMesh, str]:
    """The unprocessed triangles of the content of a file, and its format.

    Raises:
        InputError: The content cannot be read, or contains no triangles.
    """
    suffix = path.suffix.lower().lstrip(".")
    if not content:
        raise InputError(f"{path}: is empty; export it again")
    try:
        kind = identify(content, suffix)
        if kind is None:
            raise InputError(f"{path}: is not a mesh file that can be read; give one that ends in {known_suffixes()}")
        mesh = READERS[kind](content)
    except UnreadableMeshError as error:
        raise InputError(f"{path}: {error}") from error
    faces = mesh.faces
    if len(faces) and (faces.min() < 0 or faces.max() >= len(mesh.vertices)):
        raise InputError(f"{path}: is damaged: faces refer to vertices that do not exist; export it again")
    if len(faces) == 0:
        raise InputError(f"{path}: contains no triangles that can be read; is it a complete {kind.upper()} mesh?")
    if suffix in READERS and kind != suffix and {kind, suffix} != {"glb", "gltf"}:
        warn(path, f"is a file of the format {kind.upper()} by its content and was read as one")
    for remark in mesh.remarks:
        warn(path, remark)
    return mesh, kind


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
