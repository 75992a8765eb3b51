"""The force and the torque of the fluid on a solid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Wrench(NamedTuple):
    """What the fluid does to a solid, mean over a frame.

    Attributes:
        force: (3,) float64, N.
        torque: (3,) float64, N m, about the origin of the solid: where ``at`` or its pose has it.

    Examples:
        >>> import surfsup as sf
        >>> ball = sf.Transformed(sf.Sphere(0.15), translation=(0, 0, 0.15))
        >>> water = [sf.Block((-0.1, -0.1, 0.35), (0.1, 0.1, 0.5))]
        >>> simulation = sf.Simulation(sf.Scene(surface=ball, fluid=water, forces="all"))
        >>> frames = list(simulation.run(seconds=0.3))
        >>> bool(frames[-1].forces["surface"].force[2] < 0)  # the water presses the ball down
        True
    """

    force: np.ndarray
    torque: np.ndarray
