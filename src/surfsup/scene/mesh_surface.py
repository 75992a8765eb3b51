"""A mesh file as a surface for Python code."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from surfsup import sdf
from surfsup.scene.shapes import MeshShape, Shape

if TYPE_CHECKING:
    import trimesh


class MeshFileSurface(sdf.MeshSurface):
    """The surface of a mesh file.

    Attributes:
        shape: its description in a scene file.
    """

    def __init__(self, mesh: trimesh.Trimesh, shape: Shape) -> None:
        super().__init__(mesh)
        self.shape = shape


def load_mesh(
    path: str | Path, fit: float | None = None, up: Literal["y", "z"] | None = None, thicken: float | None = None
) -> MeshFileSurface:
    """Read a mesh file as a surface, placed as ``surfsup simulate FILE --fit FIT --up UP`` places it.

    Args:
        path: an OBJ, STL, PLY, OFF, GLB or glTF file.
        fit: largest extent in meters. The mesh is scaled to it, centered in x and y, and put on z = 0. None keeps the
            coordinates of the file, in meters.
        up: upward axis of the file; None for that of the format, which is y for glTF and z for the others.
        thicken: thickness in meters, after scaling, of the walls that open parts become; None refuses sheets.

    Returns:
        A surface that a :class:`Scene` can also write to a file.

    Raises:
        InputError: the file is missing or unusable, or ``fit`` is not above zero.

    Examples:
        >>> import trimesh
        >>> _ = trimesh.creation.icosphere().export("ball.stl")
        >>> load_mesh("ball.stl", fit=0.5).bounds()[:, 2].tolist()  # as high as fit, on the floor
        [0.0, 0.5]
    """
    description = MeshShape(file=Path(path).resolve(), fit=fit, up=up, thicken=thicken)
    return MeshFileSurface(description.mesh(), Shape(mesh=description))
