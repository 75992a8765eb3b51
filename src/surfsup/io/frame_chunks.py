"""The chunks of positions and velocities, compressed and decompressed with ISA-L.

ISA-L writes eight times faster than HDF5, what HDF5 itself reads.
"""

from __future__ import annotations

import h5py
import numpy as np
from isal import isal_zlib
from isal.igzip_lib import IsalError

from surfsup.io.trajectory_format import FRAMES_PER_CHUNK

COMPRESSION_LEVEL = 2  # of ISA-L
DAMAGED = (OSError, RuntimeError, ValueError, IsalError)  # that :func:`read_chunks` raises


def write_chunks(data: h5py.Dataset, first: int, frames: np.ndarray, shuffled: np.ndarray) -> None:
    """Write ``frames`` (K, N, 3) float32 to the frames of ``data`` from ``first``.

    Args:
        data: the data set.
        first: number of the first frame to write; a chunk starts there.
        frames: the new values; contiguous ones are not copied.
        shuffled: scratch memory (4, FRAMES_PER_CHUNK * N * 3) uint8.
    """
    for start in range(0, len(frames), FRAMES_PER_CHUNK):
        chunk = frames[start : start + FRAMES_PER_CHUNK]
        # HDF5's shuffle: the first bytes of all values, then their second bytes, and so on. Zeros pad the last chunk.
        byte_planes = np.ascontiguousarray(chunk).reshape(-1).view(np.uint8).reshape(-1, shuffled.shape[0]).T
        shuffled[:, : byte_planes.shape[1]] = byte_planes
        shuffled[:, byte_planes.shape[1] :] = 0
        data.id.write_direct_chunk((first + start, 0, 0), isal_zlib.compress(shuffled, COMPRESSION_LEVEL))


def read_chunks(data: h5py.Dataset, first: int, count: int) -> np.ndarray:
    """Read frames (count, N, 3) from ``first``, with ISA-L if the chunks are as :func:`write_chunks` writes them."""
    length = data.chunks[0] if data.chunks else 0
    end = first + count
    fast = length and data.shuffle and data.compression == "gzip" and data.dtype == np.float32 and end <= len(data)
    if not fast or data.chunks[1:] != data.shape[1:]:
        return data[first:end]
    begin = first - first % length
    size = int(np.prod(data.chunks)) * data.dtype.itemsize
    chunks = []
    for start in range(begin, end, length):
        _, compressed = data.id.read_direct_chunk((start, 0, 0))
        shuffled = np.frombuffer(isal_zlib.decompress(compressed, bufsize=size), dtype=np.uint8)
        chunks.append(shuffled.reshape(data.dtype.itemsize, -1).T.copy().view(np.float32).reshape(data.chunks))
    return np.concatenate(chunks)[first - begin : end - begin] if chunks else data[first:end]
