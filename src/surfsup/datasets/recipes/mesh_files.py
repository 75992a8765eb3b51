"""The user's meshes: each is checked, and valid ones are copied into the data set."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import numpy as np

from surfsup.datasets.folder import SURFACES, atomic_write
from surfsup.errors import InputError
from surfsup.sdf import fit_mesh, load_mesh


class InvalidMeshWarning(UserWarning):
    """A mesh was left out; the message has its file and the reason."""


def copy_meshes(meshes: Iterable[tuple[str, Path]], folder: Path, count: int) -> int:
    """Copy the first ``count`` valid ones of ``meshes`` to ``folder``/surfaces; copies that are there are kept.

    Args:
        meshes: name without a suffix and file of each mesh, in the order of the names.
        folder: of the data set.
        count: limit of the number of copies.

    Returns:
        The number of valid meshes.

    Warns:
        InvalidMeshWarning: for each mesh that was left out.
    """
    found = 0
    for name, path in meshes:
        if found == count:
            break
        copy = folder / SURFACES / f"{name}{path.suffix.lower()}"
        if not copy.exists():
            try:
                check_mesh(path)
            except InputError as error:
                warnings.warn(f"{error}; left out", InvalidMeshWarning, stacklevel=2)
                continue
            with atomic_write(copy) as partial:
                shutil.copyfile(path, partial)
        found += 1
    return found


def check_mesh(path: Path) -> None:
    """Check that a mesh file can become a surface.

    Raises:
        InputError: it is unreadable, or not a solid.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the warnings about its faults come when it is used
        load_mesh(path)


def fitted_vertices(path: Path, fit: float, up: Literal["y", "z"] | None = None) -> np.ndarray:
    """The vertices (V, 3) of a mesh file as the surface ``mesh: {file, fit, up}`` of a scene places them, meters."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mesh, _ = fit_mesh(load_mesh(path, up=up), fit)
    return np.asarray(mesh.vertices)
