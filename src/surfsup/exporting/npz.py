"""NPZ, the archives of NumPy."""

from __future__ import annotations

import io

import numpy as np

from surfsup.exporting.frames import ParticleFrame


def particles(frame: ParticleFrame) -> bytes:
    """An archive with ``positions``, ``velocities``, ``ids``, ``radius`` and ``time``."""
    file = io.BytesIO()
    np.savez(
        file,
        positions=frame.positions,
        velocities=frame.velocities,
        ids=frame.ids,
        radius=np.float32(frame.radius),
        time=np.float64(frame.time),
    )
    return file.getvalue()
