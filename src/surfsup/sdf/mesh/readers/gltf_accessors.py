"""The arrays in a glTF file: buffers, views and accessors."""

from __future__ import annotations

import base64
import binascii
from typing import Any

import numpy as np

from surfsup.sdf.mesh.readers.raw_mesh import UnreadableMeshError

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
DATA_MARK = ";base64,"


class Accessors:
    """The arrays of a glTF file.

    Args:
        document: the JSON part.
        binary: the binary part of a GLB file; None without one.
    """

    def __init__(self, document: dict[str, Any], binary: bytes | None) -> None:
        self.document = document
        self.buffers = [self._buffer(number, entry, binary) for number, entry in enumerate(document.get("buffers", []))]

    def _buffer(self, number: int, entry: dict[str, Any], binary: bytes | None) -> bytes:
        address = entry.get("uri")
        if address is None:
            return binary if number == 0 and binary is not None else b""
        if not (address.startswith("data:") and DATA_MARK in address[:100]):
            raise UnreadableMeshError(
                f"keeps its data in another file ('{address[:60]}'), which is not opened; "
                "join them by 'npx @gltf-transform/cli copy IN.gltf OUT.glb', or export as GLB"
            )
        try:
            return base64.b64decode(address.split(DATA_MARK, 1)[1], validate=True)
        except binascii.Error:
            raise UnreadableMeshError("is damaged: a buffer is no base64 text; export it again") from None

    def view(self, index: int) -> bytes:
        """The bytes of a buffer view.

        Raises:
            UnreadableMeshError: it is compressed by meshopt, or reaches beyond its buffer.
        """
        entry = self.document["bufferViews"][index]
        for name in entry.get("extensions", {}):
            if name in ("EXT_meshopt_compression", "KHR_meshopt_compression"):
                raise UnreadableMeshError(
                    f"is compressed by the extension {name}, which cannot be decoded; "
                    "decode it by 'gltfpack -i IN.glb -o OUT.glb -noq'"
                )
        buffer, start = self.buffers[entry["buffer"]], entry.get("byteOffset", 0)
        if start < 0 or start + entry["byteLength"] > len(buffer):
            raise UnreadableMeshError("is damaged or cut off: an array reaches beyond the end; export it again")
        return buffer[start : start + entry["byteLength"]]

    def read(self, index: int) -> np.ndarray:
        """The array (count, width) of an accessor; normalized integers become float64 between -1 and 1.

        Raises:
            UnreadableMeshError: it reaches beyond its buffer.
        """
        entry = self.document["accessors"][index]
        kind, width, count = np.dtype(COMPONENTS[entry["componentType"]]), WIDTHS[entry["type"]], entry["count"]
        if "bufferView" in entry:
            stride = self.document["bufferViews"][entry["bufferView"]].get("byteStride", kind.itemsize * width)
            values = strided(self.view(entry["bufferView"]), entry.get("byteOffset", 0), stride, count, width, kind)
        else:
            limit = sum(map(len, self.buffers)) + 1_000_000
            if count > limit:
                raise UnreadableMeshError(f"is damaged: an array of {count} zeros is announced; export it again")
            values = np.zeros((count, width), kind)
        if "sparse" in entry:
            values = self._with_sparse(values, entry["sparse"])
        if not entry.get("normalized"):
            return values
        return np.maximum(values / float(np.iinfo(kind).max), -1.0)

    def _with_sparse(self, values: np.ndarray, sparse: dict[str, Any]) -> np.ndarray:
        """The values with those replaced that a sparse accessor names."""
        count, where, what = sparse["count"], sparse["indices"], sparse["values"]
        kind = np.dtype(COMPONENTS[where["componentType"]])
        indices = strided(self.view(where["bufferView"]), where.get("byteOffset", 0), kind.itemsize, count, 1, kind)
        size = values.dtype.itemsize * values.shape[1]
        content = self.view(what["bufferView"])
        values = values.copy()
        values[indices[:, 0]] = strided(content, what.get("byteOffset", 0), size, count, values.shape[1], values.dtype)
        return values


def strided(content: bytes, start: int, stride: int, count: int, width: int, kind: np.dtype) -> np.ndarray:
    """An array (count, width) of ``kind`` whose rows begin ``stride`` bytes apart.

    Raises:
        UnreadableMeshError: it reaches beyond the content.
    """
    size = kind.itemsize * width
    if min(start, stride, count) < 0 or (count and start + (count - 1) * stride + size > len(content)):
        raise UnreadableMeshError("is damaged or cut off: an array reaches beyond its view; export it again")
    if count == 0:
        return np.empty((0, width), kind)
    return np.ndarray((count, width), kind, content, start, (stride, kind.itemsize))
