"""Data sets of HDF5 files from strangers: only plain numbers that are in the file itself.

HDF5 follows links to other files, stores data in other files, and assembles data sets of parts of other files. A
trajectory so made could show any file of the user's. None of that is followed here.
"""

from __future__ import annotations

import math

import h5py


def stored_dataset(file: h5py.File, name: str, kinds: str = "f") -> h5py.Dataset:
    """The data set ``name`` of ``file``.

    Args:
        file: an open file.
        name: path of the data set in it.
        kinds: of numbers that it may hold, as ``numpy.dtype.kind``.

    Raises:
        KeyError: there is none.
        ValueError: it is not in the file itself, or holds something else.
    """
    data = stored_object(file, name)
    if not isinstance(data, h5py.Dataset):
        raise ValueError(f"{name} is not a data set")
    if data.external or data.is_virtual:
        raise ValueError(f"{name} is stored in another file, which is not read")
    if data.dtype.kind not in kinds or data.dtype.itemsize > 8:
        raise ValueError(f"{name} holds values of type {data.dtype}, not numbers of 4 or 8 bytes")
    return data


def stored_object(file: h5py.File, name: str) -> h5py.Group | h5py.Dataset:
    """The group or data set ``name`` of ``file``, which no link to another place leads to.

    Raises:
        KeyError: there is none.
        ValueError: a link leads elsewhere.
    """
    place = ""
    for part in name.split("/"):
        place = f"{place}/{part}"
        link = file.get(place, getlink=True)
        if link is None:
            raise KeyError(f"{name} is missing")
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"{name} is a link to another place, which is not followed")
    return file[name]


def check_written(data: h5py.Dataset) -> None:
    """Require that all values of a data set are in the file, as many as its shape promises.

    Raises:
        ValueError: some are missing; HDF5 would make zeros of them, without end in a file of a few bytes.
    """
    if data.chunks is None:
        missing = data.id.get_storage_size() < data.nbytes
    else:
        chunks = math.prod(math.ceil(size / chunk) for size, chunk in zip(data.shape, data.chunks, strict=True))
        missing = data.id.get_num_chunks() < chunks
    if missing:
        raise ValueError(f"{data.name} should have the shape {data.shape}, but not all of that is in the file")
