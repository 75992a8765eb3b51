"""More substeps in frames in which the water is fast for its particles.

Substeps of 1 ms suffice up to some 12 m/s, in the units of the solver: a particle then crosses at most 0.4 of a spacing
in a substep, the limit that SPlisHSPlasH uses (J. J. Monaghan, "Smoothed particle hydrodynamics", Annual Review of
Astronomy and Astrophysics 30, 1992). Faster water is compressed where it strikes: at 15 m/s to 1.3, at 25 m/s to three
times its density (measured, docs/log.md). From 15 m/s on a frame is cut into equal parts, each with its own neighbor
search and five substeps, in which a particle crosses at most 0.2 of a spacing; with 0.28 the density still reached 1.8.
A few fast particles in a splash do not count, so the frames of ordinary scenes are what they always were.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from surfsup.scene import SPACING
from surfsup.sph.state import SUBSTEP_TIME

LIMIT, TARGET = 0.5, 0.2  # spacings that fast particles cross in a substep: before a frame is cut, and after it
FAST_SHARE = 0.01  # of the particles that must be faster
MAX_PARTS = 32


def frame_parts(velocities: Tensor) -> int:
    """The number of equal parts of a frame that particles with ``velocities`` (N, 3) need; 1 for all but fast water."""
    if len(velocities) == 0:
        return 1
    limit = LIMIT * SPACING / SUBSTEP_TIME
    if 3 * float(velocities.detach().abs().max()) ** 2 <= limit**2:  # mostly so, and quickly found
        return 1
    squared = torch.linalg.vecdot(velocities.detach(), velocities.detach())
    if not float(squared.max()) > limit**2:
        return 1
    # The speed that a hundredth of the particles exceeds.
    speed = math.sqrt(float(squared.topk(max(1, math.ceil(FAST_SHARE * len(squared)))).values[-1]))
    if not limit < speed < math.inf:
        return 1
    return min(MAX_PARTS, math.ceil(speed / limit * LIMIT / TARGET))
