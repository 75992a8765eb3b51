"""A scene from a single mesh or neural surface: scaled to fit, it stands on the floor and water falls on it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from surfsup import sdf
from surfsup.errors import InputError
from surfsup.scene.container import Container
from surfsup.scene.fluid import PARTICLE_RADIUS, Block
from surfsup.scene.scene import Scene
from surfsup.scene.shapes import DeepSdfShape, MeshShape, Rotation, Shape, SirenShape
from surfsup.scene.start import is_in_other_units
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.shipped_surfaces import SUFFIX, is_shipped, require_surface

DEFAULT_FIT = 0.7  # meters
BLOCK_SIDE = 0.45  # meters: 14 particles per side, the middle of the training data
GAP = 0.1  # meters between the top of the solid and the water


@dataclass(frozen=True)
class Placement:
    """Size, orientation and place of the solid in the container.

    Attributes:
        fit: largest extent in meters after scaling; None keeps the coordinates of the file, in meters.
        up: upward axis of a mesh file; None for that of the file format.
        turn: rotation about z in degrees.
        at: position of the origin of the scaled and rotated solid in meters; a fitted solid has it below its middle.
        shape: name of the shape in a DeepSDF with several.
        thicken: thickness in meters of the walls that open parts of a mesh become; None refuses sheets.
    """

    fit: float | None = DEFAULT_FIT
    up: Literal["y", "z"] | None = None
    turn: float = 0.0
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shape: str | None = None
    thicken: float | None = None


def scene_from_surface(
    path: Path,
    placement: Placement,
    container: Container,
    block: Block | None,
    frames: int,
    particle_radius: float = PARTICLE_RADIUS,
) -> tuple[Scene, str]:
    """The scene of water that falls on the mesh or neural surface in ``path``.

    Args:
        path: the file, or the name of a shipped surface.
        placement: how to place it.
        container: the box around it.
        block: the water; None for a cube of 0.45 m above the solid.
        frames: number of frames.
        particle_radius: meters.

    Returns:
        The scene, and lines for the user: size and orientation of the solid, and where the water is if that is ours.

    Raises:
        InputError: the file is unusable, the solid does not fit the container, or there is no room for water above.
    """
    shape = placed_shape(path, placement)
    (lower, upper), summary = measure(path, shape, placement)
    check_fits(path, lower, upper, container, particle_radius, fitted=placement.fit is not None)
    water = block or block_above(lower, upper, container, particle_radius)
    scene = Scene(container=container, surface=shape, fluid=[water], frames=frames, particle_radius=particle_radius)
    if block is None:
        corners = (f"({', '.join(f'{value:.3g}' for value in corner)})" for corner in (water.min, water.max))
        between = " to ".join(corners)
        summary += f"\nthe water begins as a block from {between}; --block-min and --block-max, together, move it"
    return scene, summary


def measure(path: Path, shape: Shape, placement: Placement) -> tuple[np.ndarray, str]:
    """The bounding box (2, 3) of the placed solid in meters, and a line about its size and orientation.

    Raises:
        InputError: the file is unusable.
    """
    if shape.mesh is None:
        box = shape.surface().bounds().double().numpy()
        return box, f"{path.name} is {size_text(box)} m large"
    with warnings.catch_warnings():
        # The scene builds its surface from the same file and repeats the warnings.
        warnings.simplefilter("ignore", sdf.MeshWarning)
        original = np.asarray(sdf.load_mesh(path, up=placement.up, keep_sheets=placement.thicken is not None).extents)
        mesh = shape.mesh.mesh()
    rotation = sdf.axis_rotation((0.0, 0.0, 1.0), placement.turn).numpy()
    vertices = np.asarray(mesh.vertices) @ rotation.T + np.asarray(placement.at)
    box = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
    summary = f"{path.name} is {size_text(box)} m large"
    if placement.fit is not None:
        file_size = " x ".join(f"{side:.3g}" for side in original)
        summary += f" (in the file {file_size}, scaled by {placement.fit / original.max():.3g})"
    if placement.up is None and path.suffix.lower() not in (".glb", ".gltf"):
        summary += "; z is its upward axis, --up y turns one that lies on its side"
    return box, summary


def size_text(box: np.ndarray) -> str:
    """The sides of a box (2, 3), for a message."""
    return " x ".join(f"{side:.2f}" for side in box[1] - box[0])


def placed_shape(path: Path, placement: Placement) -> Shape:
    """The mesh or neural surface in ``path`` as a scene file would describe it.

    Raises:
        InputError: a value is out of range, or an option does not apply to the file.
    """
    rotate = Rotation(axis=(0.0, 0.0, 1.0), degrees=placement.turn) if placement.turn else None
    content = shape_of_file(path, placement)
    return Shape(**content, rotate=rotate, at=placement.at)


def shape_of_file(path: Path, placement: Placement) -> dict[str, Any]:
    """The shape in ``path`` under its key in a scene file.

    Raises:
        InputError: the file is of an unknown kind, or an option does not apply to it.
    """
    shipped = is_shipped(path)
    require_surface(path)
    file = path if shipped else path.resolve()
    if not shipped and path.suffix.lower() != SUFFIX:
        require_single_shape(path, placement)
        return {"mesh": MeshShape(file=file, fit=placement.fit, up=placement.up, thicken=placement.thicken)}
    if placement.up is not None:
        raise InputError(f"{path}: a neural surface already has z up; omit --up")
    if placement.thicken is not None:
        raise InputError(f"{path}: a neural surface is a solid already; omit --thicken")
    if surface_file.read_format(sdf.surface_path(path)) == surface_file.DEEPSDF:
        return {"deepsdf": DeepSdfShape(file=file, fit=placement.fit, shape=placement.shape)}
    require_single_shape(path, placement)
    return {"siren": SirenShape(file=file, fit=placement.fit)}


def require_single_shape(path: Path, placement: Placement) -> None:
    """Refuse a shape name for a file that holds a single shape.

    Raises:
        InputError: there is one.
    """
    if placement.shape is not None:
        raise InputError(f"{path}: holds a single shape; omit --shape, which chooses a shape of a DeepSDF")


def check_fits(
    path: Path, lower: np.ndarray, upper: np.ndarray, container: Container, particle_radius: float, fitted: bool
) -> None:
    """Refuse a solid that is larger than the container, reaches out of it, or is smaller than a particle.

    Args:
        path: file of the solid, for the message.
        lower, upper: corners (3,) of its bounding box in meters.
        container: the box around it.
        particle_radius: meters.
        fitted: whether it was scaled, for the remedy in the message.

    Raises:
        InputError: naming the size and the remedy.
    """
    size = " x ".join(f"{side:.4g}" for side in upper - lower)
    room = " x ".join(f"{side:.4g}" for side in container.size)
    remedy = "give a smaller --fit or a larger --container" if fitted else "omit --no-fit to scale it"
    if not fitted and is_in_other_units(lower, upper, container):
        remedy += ", or give it scale: 0.001 in a scene file if it is in millimeters"
    if (upper - lower > np.asarray(container.size) + 1e-6).any():
        raise InputError(f"{path}: is {size} m, larger than the container of {room} m; {remedy}")
    if (upper - lower).max() < 4 * particle_radius:
        raise InputError(f"{path}: is {size} m, too small for particles {2 * particle_radius:g} m apart; {remedy}")
    outside = (lower < np.asarray(container.lower) - 1e-6) | (upper > np.asarray(container.upper) + 1e-6)
    if outside.any():
        axis = int(np.argmax(outside))
        raise InputError(
            f"{path}: reaches from {lower[axis]:.3g} to {upper[axis]:.3g} m along {'xyz'[axis]}, out of "
            f"the container ({container.lower[axis]:.3g} to {container.upper[axis]:.3g} m); move it with --at"
        )


def block_above(lower: np.ndarray, upper: np.ndarray, container: Container, particle_radius: float) -> Block:
    """A cube of water above the middle of a solid with the bounding box ``lower`` to ``upper`` (3,).

    Raises:
        InputError: there is no room below the ceiling.
    """
    sides = np.minimum(BLOCK_SIDE, np.asarray(container.size))
    middle = (lower + upper)[:2] / 2
    low = np.clip(middle - sides[:2] / 2, container.lower[:2], np.asarray(container.upper[:2]) - sides[:2])
    bottom = upper[2] + GAP
    top = min(bottom + sides[2], container.size[2])
    if top - bottom < 4 * particle_radius:
        raise InputError(
            f"there is no room for water between the solid's top at {upper[2]:.3g} m and the ceiling at "
            f"{container.size[2]:.3g} m; give a smaller --fit, a taller --container or a block of your own"
        )
    return Block((*low.tolist(), float(bottom)), (*(low + sides[:2]).tolist(), float(top)))
