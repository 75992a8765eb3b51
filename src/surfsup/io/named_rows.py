"""What a trajectory has of each solid by its name: a row for each frame, such as its pose or the force on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import h5py
import numpy as np

Row = np.ndarray | None  # (width,), or unknown in this frame
Fill = Callable[[Sequence[Row], Row, int], np.ndarray]  # rows, the one before them, width


class NamedRows:
    """A group of data sets (frames, width), one for each name; they grow when the buffered rows are written."""

    def __init__(self, group: str, width: int, fill: Fill) -> None:
        """Begin without any name.

        Args:
            group: path of the group in the file.
            width: of a row.
            fill: makes rows of those that are unknown: :func:`held` or :func:`unknown`.
        """
        self._group, self._width, self._fill = group, width, fill
        self._buffer: list[Mapping[str, np.ndarray]] = []

    def put(self, index: int, rows: Mapping[str, np.ndarray]) -> None:
        """Buffer the rows of a frame, the one of number ``index`` after those that are written; later ones are lost."""
        self._buffer[index:] = [rows]

    def write(self, file: h5py.File, written: int) -> None:
        """Write the buffered rows after the first ``written`` ones, again if they are there already."""
        for name in {**dict.fromkeys(file.get(self._group, ())), **{n: None for rows in self._buffer for n in rows}}:
            path = f"{self._group}/{name}"
            rows: list[Row] = [frame.get(name) for frame in self._buffer]
            if path in file:
                filled = self._fill(rows, file[path][written - 1] if written else None, self._width)
            else:
                filled = self._fill([None] * written + rows, None, self._width)
                file.create_dataset(path, data=filled[:written], maxshape=(None, self._width))
            data = file[path]
            data.resize(written + len(rows), axis=0)
            data[written:] = filled[len(filled) - len(rows) :]


def held(rows: Sequence[Row], before: Row, width: int) -> np.ndarray:
    """Each unknown row is the one before; at the start, the first that is known."""
    last = next(row for row in rows if row is not None) if before is None else before
    filled = np.empty((len(rows), width))
    for number, row in enumerate(rows):
        filled[number] = last = last if row is None else row
    return filled


def unknown(rows: Sequence[Row], before: Row, width: int) -> np.ndarray:
    """Each unknown row is NaN."""
    filled = np.full((len(rows), width), np.nan)
    for number, row in enumerate(rows):
        if row is not None:
            filled[number] = row
    return filled
