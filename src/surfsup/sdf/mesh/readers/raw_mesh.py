"""What every reader returns, and the error that it raises."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


class UnreadableMeshError(ValueError):
    """A file cannot be read as a mesh.

    The message completes the sentence "FILE: ..." in one line: what is wrong, and how to mend it.
    """


@dataclass(frozen=True)
class RawMesh:
    """Triangles as they stand in a file, or as its polygons give them.

    Attributes:
        vertices: (V, 3) float64 in the unit of the file.
        faces: (F, 3) int64 indices of vertices; the reader has not checked their range.
        remarks: what the reader skipped or corrected; each completes the sentence "FILE: ...".
    """

    vertices: np.ndarray
    faces: np.ndarray
    remarks: list[str] = field(default_factory=list)
