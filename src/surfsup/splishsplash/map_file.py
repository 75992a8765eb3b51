"""A volume map as a file of Discregrid (``.cdm``), which SPlisHSPlasH reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surfsup.sph.boundary.volume_map import VolumeMap

NO_NODES = np.uint32(0xFFFFFFFF)
FIELDS = 2  # distances, volumes


def write_map(path: Path, volume_map: VolumeMap) -> None:
    """Write ``volume_map`` in the layout of Discregrid's cubic Lagrange grid.

    The file contains the box, its resolution and its cells; the values of both fields at the nodes; the nodes of each
    cell; and for both fields the index of each cell among those with nodes. The list of cells is empty for the second
    field, because the solver uses that of the first.
    """
    lower, cell, resolution = volume_map.lower, volume_map.cell, volume_map.resolution
    indices = np.full(int(resolution.prod()), NO_NODES, dtype=np.uint32)
    indices[volume_map.cells] = np.arange(len(volume_map.cells), dtype=np.uint32)
    fields = (volume_map.distances, volume_map.volumes)
    with path.open("wb") as file:
        file.write(np.concatenate([lower, lower + resolution * cell]).astype(np.float64).tobytes())
        file.write(resolution.astype(np.uint32).tobytes())
        file.write(cell.tobytes() + (1 / cell).tobytes())
        file.write(counts(len(indices), FIELDS))
        file.write(counts(FIELDS))
        for values in fields:
            file.write(counts(len(values)) + values.astype(np.float64).tobytes())
        file.write(
            counts(FIELDS, len(volume_map.cell_nodes)) + volume_map.cell_nodes.astype(np.uint32).tobytes() + counts(0)
        )
        file.write(counts(FIELDS))
        for _ in fields:
            file.write(counts(len(indices)) + indices.tobytes())


def counts(*numbers: int) -> bytes:
    """``numbers`` as 64-bit integers."""
    return np.array(numbers, dtype=np.uint64).tobytes()
