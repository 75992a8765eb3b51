"""Drains during a simulation: regions that take the particles which enter them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch

from surfsup.scene import PARTICLE_RADIUS
from surfsup.sdf import Surface
from surfsup.sph.taps import CarrierMotion


@dataclass(frozen=True)
class DrainRegion:
    """A drain in the units of the solver.

    Attributes:
        surface: the region.
        start, until: when it opens and closes, seconds.
        carrier: name of what carries it, in whose frame the region is; None for the world.
    """

    surface: Surface
    start: float
    until: float
    carrier: str | None = None

    @cached_property
    def box(self) -> np.ndarray:
        """Corners (2, 3) of a box around the region, meters."""
        return self.surface.bounds().detach().cpu().numpy()

    def takes(self, before: np.ndarray, after: np.ndarray, end_time: float, motion: CarrierMotion) -> np.ndarray:
        """Which particles (N,) enter the region on a straight way in a frame.

        Args:
            before, after: positions (N, 3) at the start and the end of the frame, meters.
            end_time: of the frame, seconds.
            motion: of the carriers in the frame.
        """
        taken = np.zeros(len(after), bool)
        if end_time <= self.start or end_time - motion.seconds >= self.until:
            return taken
        if self.carrier is not None:
            before = motion.start[self.carrier].to_own(before)
            after = motion.end[self.carrier].to_own(after)
        near = (np.minimum(before, after) <= self.box[1]).all(axis=1) & (np.maximum(before, after) >= self.box[0]).all(
            axis=1
        )
        rows = np.flatnonzero(near)
        if not len(rows):
            return taken
        one, way = before[rows], after[rows] - before[rows]
        # Points on the way, a particle radius apart: a drain thinner than that may miss a particle.
        count = max(1, int(np.ceil(np.linalg.norm(way, axis=1).max() / PARTICLE_RADIUS)))
        with torch.no_grad():
            for part in (np.arange(count) + 1) / count:
                points = torch.from_numpy((one + part * way).astype(np.float32))
                taken[rows] |= self.surface.distance(points).numpy() < 0
        return taken
