"""A scene from nothing but a mesh or a neural surface: scaled to fit, it stands on the floor, and water falls on it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from surfsup import sdf
from surfsup.errors import InputError
from surfsup.scene.fluid import PARTICLE_RADIUS, SPACING, Block, Fluid
from surfsup.scene.scene import Container, Scene
from surfsup.scene.shapes import DeepSdfShape, MeshShape, Rotation, Shape, SirenShape
from surfsup.scene.validation_message import one_line
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.shipped_surfaces import is_shipped

FIT = 0.7  # meters: the largest extent of a fitted mesh
BLOCK_SIDE = 0.45  # meters: 14 particles a side, the middle of the training data
GAP = 0.1  # meters between the top of the mesh and the water


@dataclass(frozen=True)
class Placing:
    """How a mesh stands in the container.

    Attributes:
        fit: largest extent in meters after scaling; None leaves the mesh as it is, in meters.
        up: the mesh's own upward axis, "y" or "z"; None takes the file format's.
        turn: degrees about z.
        at: where the mesh's foot goes, meters.
        shape: which one of a DeepSDF's.
    """

    fit: float | None = FIT
    up: str | None = None
    turn: float = 0.0
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shape: str | None = None


def pour_on(
    path: Path,
    placing: Placing,
    container: Container,
    block: Block | None,
    frames: int,
) -> tuple[Scene, str]:
    """The scene of water falling on the mesh or the neural surface in ``path``.

    Args:
        path: the file, or the name of a shipped surface.
        placing: how it stands.
        container: what it stands in.
        block: the water; left out, a cube of 0.45 m above the solid.
        frames: how long.

    Returns:
        The scene, and a line that says how the solid was placed.

    Raises:
        InputError: the file cannot be used, does not fit the container, or leaves no room for water above.
    """
    shape = shape_of(path, placing)
    box, said = box_of(path, shape, placing)
    lower, upper = box
    check_fits(path, lower, upper, container, fitted=placing.fit is not None)
    water = block or block_above(lower, upper, container)
    return Scene(container=container, surface=shape, fluid=[Fluid(block=water)], frames=frames), said


def box_of(path: Path, shape: Shape, placing: Placing) -> tuple[np.ndarray, str]:
    """The box (2, 3) around the placed solid in meters, and a line that says how it was placed.

    Raises:
        InputError: the file cannot be used.
    """
    if shape.mesh is None:
        box = shape.surface().bounds().double().numpy()
        return box, f"{path.name} stands {size_text(box)} m"
    with warnings.catch_warnings():
        # The scene's surface is built from the same file and will warn of its faults.
        warnings.simplefilter("ignore", sdf.MeshWarning)
        mesh = sdf.load_mesh(path, up=placing.up)
    own_extent = np.asarray(mesh.extents)
    if placing.fit is not None:
        mesh, _ = sdf.fit_mesh(mesh, placing.fit)
    turn = sdf.axis_rotation((0.0, 0.0, 1.0), placing.turn).numpy()
    corners = np.asarray(mesh.vertices) @ turn.T + np.asarray(placing.at)
    box = np.stack([corners.min(axis=0), corners.max(axis=0)])
    said = f"{path.name} stands {size_text(box)} m"
    if placing.fit is not None:
        own_size = " x ".join(f"{side:.3g}" for side in own_extent)
        said += f" (its own {own_size}, scaled by {placing.fit / own_extent.max():.3g})"
    if placing.up is None and path.suffix.lower() != ".glb":
        said += "; z is taken as up, --up y stands it up if it lies on its side"
    return box, said


def size_text(box: np.ndarray) -> str:
    """The sides of a box (2, 3), for a message."""
    return " x ".join(f"{side:.2f}" for side in box[1] - box[0])


def shape_of(path: Path, placing: Placing) -> Shape:
    """The mesh or neural surface in ``path``, placed, as a scene file would describe it.

    Raises:
        InputError: a number is not finite or a length not above zero, or an option is not for such a file.
    """
    try:
        return Shape(
            **kind_of_file(path, placing),
            rotate=Rotation(axis=(0.0, 0.0, 1.0), degrees=placing.turn) if placing.turn else None,
            at=placing.at,
        )
    except ValidationError as error:
        raise InputError(f"placing of {path.name}: {one_line(error, Shape)}") from None


def kind_of_file(path: Path, placing: Placing) -> dict[str, MeshShape | SirenShape | DeepSdfShape]:
    """The kind of surface in ``path``, by the key that a scene file has for it.

    Raises:
        InputError: it is of no known kind, or an option is not for such a file.
    """
    own = is_shipped(path)
    if not own and not path.suffix and not path.exists():
        raise InputError(f"{path}: there is no such file; surfaces that ship are {', '.join(sdf.shipped_surfaces())}")
    file = path if own else path.resolve()
    if not own and path.suffix.lower() != surface_file.ENDING:
        if placing.shape is not None:
            raise InputError(f"{path}: is a single shape; leave out --shape, which chooses one of a DeepSDF's")
        return {"mesh": MeshShape(file=file, fit=placing.fit, up=placing.up)}
    if placing.up is not None:
        raise InputError(f"{path}: was stood up when it was fitted; leave out --up")
    if surface_file.kind_of(sdf.resolve(path)) == surface_file.DEEPSDF:
        return {"deepsdf": DeepSdfShape(file=file, fit=placing.fit, shape=placing.shape)}
    if placing.shape is not None:
        raise InputError(f"{path}: is a single shape; leave out --shape, which chooses one of a DeepSDF's")
    return {"siren": SirenShape(file=file, fit=placing.fit)}


def check_fits(path: Path, lower: np.ndarray, upper: np.ndarray, container: Container, fitted: bool) -> None:
    """Refuse a mesh that is larger than the container, reaches out of it, or is smaller than a particle.

    Raises:
        InputError: naming the size and the way out.
    """
    size = " x ".join(f"{side:.4g}" for side in upper - lower)
    room = " x ".join(f"{side:.4g}" for side in container.size)
    remedy = "give a smaller --fit or a larger --container" if fitted else "leave out --no-fit, so that it is scaled"
    if (upper - lower > np.asarray(container.size) + 1e-6).any():
        raise InputError(f"{path}: is {size} m, larger than the container of {room} m; {remedy}")
    if (upper - lower).max() < 4 * PARTICLE_RADIUS:
        raise InputError(f"{path}: is {size} m, too small to be met by particles {SPACING} m apart; {remedy}")
    outside = (lower < np.asarray(container.lower) - 1e-6) | (upper > np.asarray(container.upper) + 1e-6)
    if outside.any():
        axis = int(np.argmax(outside))
        raise InputError(
            f"{path}: reaches from {lower[axis]:.3g} to {upper[axis]:.3g} m along {'xyz'[axis]}, out of "
            f"the container ({container.lower[axis]:.3g} to {container.upper[axis]:.3g} m); move it with --at"
        )


def block_above(lower: np.ndarray, upper: np.ndarray, container: Container) -> Block:
    """A cube of water above the middle of a solid that reaches from ``lower`` to ``upper`` (3,).

    Raises:
        InputError: there is no room below the ceiling.
    """
    sides = np.minimum(BLOCK_SIDE, np.asarray(container.size))
    middle = (lower + upper)[:2] / 2
    low = np.clip(middle - sides[:2] / 2, container.lower[:2], np.asarray(container.upper[:2]) - sides[:2])
    bottom = upper[2] + GAP
    top = min(bottom + sides[2], container.size[2])
    if top - bottom < 2 * SPACING:
        raise InputError(
            f"there is no room for water between the solid's top at {upper[2]:.3g} m and the ceiling at "
            f"{container.size[2]:.3g} m; give a smaller --fit, a taller --container or a block of your own"
        )
    return Block(min=(*low.tolist(), float(bottom)), max=(*(low + sides[:2]).tolist(), float(top)))
