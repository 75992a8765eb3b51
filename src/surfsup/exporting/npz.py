"""NPZ, the archives of NumPy."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from surfsup.exporting.frames import ParticleFrame


def particles(frame: ParticleFrame) -> bytes:
    """An archive with ``positions``, ``velocities``, ``ids``, ``radius``, ``time``; of several liquids ``liquids``."""
    file = io.BytesIO()
    several: dict[str, Any] = {} if frame.liquids is None else {"liquids": frame.liquids}
    np.savez(
        file,
        positions=frame.positions,
        velocities=frame.velocities,
        ids=frame.ids,
        radius=np.float32(frame.radius),
        time=np.float64(frame.time),
        **several,
    )
    return file.getvalue()
