"""Meshes that a user gives: checked one by one, those that can be used copied into the data set."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from surfsup.errors import InputError
from surfsup.sdf import fit_mesh, load_mesh

SURFACES = "surfaces"  # the room of a data set's files in its folder


class UnusableMesh(UserWarning):
    """A mesh was left out; the message says which and why."""


def collect(meshes: Iterable[tuple[str, Path]], folder: Path, count: int) -> int:
    """Copy the first ``count`` usable ones of ``meshes`` to ``folder``/surfaces; those there already are kept.

    Args:
        meshes: what each is to be called, without an ending, and its file; in the order of the names.
        folder: of the data set.
        count: how many are needed at most.

    Returns:
        How many usable ones were found.

    Warns:
        UnusableMesh: for each that had to be left out.
    """
    room = folder / SURFACES
    room.mkdir(parents=True, exist_ok=True)
    found = 0
    for name, path in meshes:
        if found == count:
            break
        copy = room / f"{name}{path.suffix.lower()}"
        if not copy.exists():
            try:
                check(path)
            except InputError as error:
                warnings.warn(f"{error}; left out", UnusableMesh, stacklevel=2)
                continue
            partial = copy.with_name(f".{copy.name}.partial")
            shutil.copyfile(path, partial)
            partial.replace(copy)
        found += 1
    return found


def check(path: Path) -> None:
    """Refuse a mesh that no surface can be made of.

    Raises:
        InputError: it cannot be read, or is no solid.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # faults that it can be used with are told when it is used
        load_mesh(path)


def fitted_corners(path: Path, fit: float, up: str | None = None) -> np.ndarray:
    """The vertices (V, 3) of a mesh file as the surface ``mesh: {file, fit, up}`` of a scene has them, meters."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mesh, _ = fit_mesh(load_mesh(path, up=up), fit)
    return np.asarray(mesh.vertices)
