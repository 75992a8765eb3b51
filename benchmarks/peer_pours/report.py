"""What the peers share: their times and how their water fares, as a line of JSON. It needs nothing but NumPy."""

import json
import sys
import time
from collections.abc import Callable

import numpy as np


def report(frame: Callable[[], object], positions: Callable[[], np.ndarray], versions: str) -> None:
    """Print the processor milliseconds of a frame, and of the water its mean height and how it moved.

    Args:
        frame: advances by a frame.
        positions: of the particles now, (N, 3).
        versions: of the peer.
    """
    frames, start = int(sys.argv[2]), positions()
    frame()  # compiles
    frame()
    began, wall = time.process_time(), time.perf_counter()
    for _ in range(frames):
        frame()
    spent, waited = time.process_time() - began, time.perf_counter() - wall
    now = positions()
    print(
        json.dumps(
            {
                "versions": versions,
                "processor_ms": 1000 * spent / frames,
                "wall_ms": 1000 * waited / frames,
                "mean_height": float(now[:, 2].mean()),
                "finite": bool(np.isfinite(now).all()),
                "moved": float(np.linalg.norm(now - start, axis=1).mean()),
            }
        )
    )
