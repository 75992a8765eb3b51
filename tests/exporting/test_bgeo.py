"""BGEO files, read after the layout that partio's reader has."""

import struct

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from surfsup.exporting import bgeo
from tests.exporting.conftest import cloud

KINDS = {0: ">f4", 1: ">i4", 5: ">f4"}


def read(content):
    """The attributes of all points by name, as partio's ``readBGEO`` finds them."""
    assert content[:5] == b"BgeoV"
    version, points, *counts, attributes, vertex, primitive, detail = struct.unpack_from(">9i", content, 5)
    assert (version, counts, vertex, primitive, detail) == (5, [0, 0, 0], 0, 0, 0)
    offset, fields = 5 + 36, [("P", ">f4", 4)]
    for _ in range(attributes):
        (length,) = struct.unpack_from(">H", content, offset)
        name = content[offset + 2 : offset + 2 + length].decode()
        size, kind = struct.unpack_from(">Hi", content, offset + 2 + length)
        offset += 2 + length + 6 + 4 * size
        fields.append((name, KINDS[kind], size))
    data = np.frombuffer(content, fields, points, offset)
    assert content[offset + data.nbytes :] == b"\x00\xff"
    return data


@given(st.integers(0, 40), st.integers(0, 100))
def test_particles_come_back(count, seed):
    frame = cloud(count, seed)
    data = read(bgeo.particles(frame))
    assert data.dtype.names == ("P", "v", "id", "pscale")
    np.testing.assert_array_equal(data["P"], np.column_stack([frame.positions, np.ones(count)]))
    np.testing.assert_array_equal(data["v"], frame.velocities)
    np.testing.assert_array_equal(data["id"].ravel(), frame.ids)
    np.testing.assert_array_equal(data["pscale"].ravel(), np.full(count, 0.015, np.float32))
