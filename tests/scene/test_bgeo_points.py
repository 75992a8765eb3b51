"""BGEO files as other programs write them; `tests/exporting/test_bgeo.py` has the files that we write."""

import gzip
import struct

import numpy as np
import pytest

from surfsup import InputError
from surfsup.scene.bgeo_points import read_bgeo
from surfsup.scene.particle_file import read_particles

POSITIONS = np.array([[0, 0, 1], [0.5, -1, 2]], np.float32)
VELOCITIES = np.array([[1, 2, 3], [-1, 0, 0]], np.float32)


def bgeo(attributes=(), rows=None, count=2, version=5):
    """A file with definitions of attributes, and the bytes of each point after its position."""
    head = b"BgeoV" + struct.pack(">9i", version, count, 0, 0, 0, len(attributes), 0, 0, 0) + b"".join(attributes)
    rows = rows or [b""] * len(POSITIONS)
    points = b"".join(
        np.append(position, 1).astype(">f4").tobytes() + row for position, row in zip(POSITIONS, rows, strict=True)
    )
    return head + points + b"\x00\xff"


def definition(name, size, kind, default):
    return struct.pack(f">H{len(name)}sHi", len(name), name.encode(), size, kind) + default


def test_positions_alone(tmp_path):
    file = tmp_path / "a.bgeo"
    file.write_bytes(bgeo())
    np.testing.assert_array_equal(read_bgeo(file), POSITIONS)
    np.testing.assert_array_equal(read_particles(file).velocities, 0)


def test_velocities_are_found_between_other_attributes_also_in_a_compressed_file(tmp_path):
    name = struct.pack(">iH5s", 1, 5, b"water")
    attributes = [
        definition("id", 1, 1, struct.pack(">i", 0)),
        definition("kind", 1, 4, name),
        definition("v", 3, 5, struct.pack(">3f", 0, 0, 0)),
    ]
    rows = [struct.pack(">ii", 7, 0) + velocity.astype(">f4").tobytes() for velocity in VELOCITIES]
    file = tmp_path / "a.bgeo"
    file.write_bytes(gzip.compress(bgeo(attributes, rows)))
    np.testing.assert_array_equal(read_bgeo(file), np.hstack([POSITIONS, VELOCITIES]))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it is no BGEO file"),
        (b"\x7fNSJb", "newer ones begin otherwise, and Houdini's gconvert converts"),
        (bgeo(version=4), "it has version 4"),
        (bgeo(count=3), "it was cut off"),
        (bgeo(count=-1), "it was cut off"),
        (bgeo()[:20], "it was cut off"),
        (bgeo([definition("a", 1, 9, b"")]), "its attribute 'a' has the unknown type 9"),
    ],
)
def test_another_file_is_refused_in_one_line(tmp_path, content, message):
    file = tmp_path / "a.bgeo"
    file.write_bytes(content)
    with pytest.raises(InputError, match=message) as error:
        read_particles(file)
    assert "\n" not in str(error.value)
    assert str(file) in str(error.value)
