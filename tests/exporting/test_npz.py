"""NPZ archives, read by NumPy."""

import io

import numpy as np

from surfsup.exporting import npz
from tests.exporting.conftest import cloud


def test_particles_come_back_without_pickle():
    frame = cloud(7)
    with np.load(io.BytesIO(npz.particles(frame)), allow_pickle=False) as archive:
        assert sorted(archive) == ["ids", "positions", "radius", "time", "velocities"]
        for name in ("ids", "positions", "velocities"):
            np.testing.assert_array_equal(archive[name], getattr(frame, name))
        assert (archive["time"], archive["radius"]) == (0.25, np.float32(0.015))
