"""The impulses of the fluid on every solid, from which forces follow.

Every term by which a solid changes the velocity of a particle is added to the solid with the opposite sign: the
pressure against it in each substep (-pᵢ gᵢᵇ), and the velocity that collision handling removes. Forces between
particles cancel, so the momentum of water and solids together changes by gravity alone, to rounding. Two parts of the
solver do not conserve it: the viscosity between particles, which divides by each particle's own density, and the energy
limiter in the rare frames in which it acts.
"""

from __future__ import annotations

import numpy as np
import torch

from surfsup.scene import FRAME_TIME, SPACING
from surfsup.scene.pose import between
from surfsup.scene.solids import CONTAINER, Solids
from surfsup.scene.units import Units
from surfsup.scene.wrench import Wrench
from surfsup.sph.moving import FrameMotion

PARTICLE_VOLUME = SPACING**3  # m³, of a particle of 15 mm in water at its rest density


class Impulses:
    """The impulses in one frame, which the solver adds up.

    Attributes:
        solids: of the scene, in the units of the solver.
        rows: (R, 6) float64, impulse and its moment about the solid's origin for particles of unit mass, m/s and m²/s:
            of the container, of each solid that stands still, of each that moves.
    """

    def __init__(self, solids: Solids) -> None:
        self.solids = solids
        self.rows = self.no_rows()

    def no_rows(self) -> np.ndarray:
        """Rows of zeros, for C++ code to add to."""
        return np.zeros((len(self.names), 6))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the rows."""
        return CONTAINER, *(part.name for part in self.solids.parts), *(solid.name for solid in self.solids.moving)

    def native(
        self, positions: np.ndarray, masses: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
        """New rows for C++ code, and which of the still solids each of the particles at ``positions`` (N, 3) is at.

        All that stands still is one solid. What it does to a particle counts for the part that is nearest. The third
        item are the ``masses`` (N,) of the particles, None where all are 1.
        """
        if len(self.solids.parts) < 2:
            return self.no_rows(), None, masses
        points = torch.from_numpy(positions)
        distances = np.stack([part.surface.distance(points).detach().numpy() for part in self.solids.parts])
        return self.no_rows(), distances.argmin(axis=0).astype(np.int32), masses

    def add(self, rows: np.ndarray, motion: FrameMotion | None) -> None:
        """Add rows with moments about the origin of the world, of a step with ``motion``."""
        moments = rows[:, 3:] - np.cross(self.origins(motion), rows[:, :3])
        self.rows += np.concatenate([rows[:, :3], moments], axis=1)

    def origins(self, motion: FrameMotion | None) -> np.ndarray:
        """The origins (R, 3) of the solids in the middle of a step."""
        poses = (
            {}
            if motion is None
            else {name: between(motion.start[name], motion.end[name], 0.5) for name in motion.start}
        )
        still = [part.origin for part in self.solids.parts]
        walls = poses[CONTAINER].position if CONTAINER in poses else np.zeros(3)
        return np.stack([walls, *still, *(poses[solid.name].position for solid in self.solids.moving)])

    def wrenches(self, units: Units, density: float, part: float = 1.0) -> dict[str, Wrench]:
        """Mean force and torque, by name, in the units of a scene.

        Args:
            units: of the scene.
            density: of its water at rest, kg/m³.
            part: of a frame of the simulator that the impulses are of.
        """
        scale = density * PARTICLE_VOLUME / (part * FRAME_TIME) * units.force
        return {
            name: Wrench(scale * row[:3], scale * units.length * row[3:])
            for name, row in zip(self.names, self.rows, strict=True)
        }
