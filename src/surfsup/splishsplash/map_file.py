"""A volume map as a file of Discregrid (``.cdm``), which SPlisHSPlasH reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surfsup.sph.boundary.volume_map import VolumeMap

NO_CELL = np.uint32(0xFFFFFFFF)
FIELDS = 2  # distances, volumes


def write_map(path: Path, volume_map: VolumeMap) -> None:
    """Write ``volume_map`` in the layout of Discregrid's cubic Lagrange grid.

    The box, its cells and their number; then for each of the two fields its nodes, which nodes a cell has, and where
    among those a cell is. The solver looks into the second field with the first one's cells, so it has none.
    """
    lower, cell, resolution = volume_map.lower, volume_map.cell, volume_map.resolution
    places = np.full(int(resolution.prod()), NO_CELL, dtype=np.uint32)
    places[volume_map.cells] = np.arange(len(volume_map.cells), dtype=np.uint32)
    fields = (volume_map.distances, volume_map.volumes)
    with path.open("wb") as file:
        file.write(np.concatenate([lower, lower + resolution * cell]).astype(np.float64).tobytes())
        file.write(resolution.astype(np.uint32).tobytes())
        file.write(cell.tobytes() + (1 / cell).tobytes())
        file.write(counts(len(places), FIELDS))
        file.write(counts(FIELDS))
        for values in fields:
            file.write(counts(len(values)) + values.astype(np.float64).tobytes())
        file.write(counts(FIELDS, len(volume_map.cell_nodes)) + volume_map.cell_nodes.astype(np.uint32).tobytes() + counts(0))
        file.write(counts(FIELDS))
        for _ in fields:
            file.write(counts(len(places)) + places.tobytes())


def counts(*numbers: int) -> bytes:
    """``numbers`` as 64-bit counts."""
    return np.array(numbers, dtype=np.uint64).tobytes()
