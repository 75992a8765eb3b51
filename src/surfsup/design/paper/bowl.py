"""The bowl of the SURFSUP supplement, section 7: the radii of its mouth and of the hole at its bottom.

The supplement gives the reward, its variance, and the numbers of frames and iterations. Positions of bowl and water are
our choice: the mouth of the bowl is 0.5 m above the floor of the standard container, the water starts at rest right
above it, and the height h around which the water should gather is that of the mouth. Water that leaves through the
hole or over the rim lowers the reward, and in a bowl that is larger than necessary the water is too low. A hole so
narrow that the clearance of particles from the surface closes it counts as closed.
"""

from __future__ import annotations

from torch import Tensor

from surfsup.design.parameter import Parameter, Values
from surfsup.design.reward import near
from surfsup.design.task import Task
from surfsup.scene import SURFACE_CLEARANCE, Block, Fluid, Scene
from surfsup.sdf import Bowl, Surface, Transformed

VARIANCE = 0.8  # m² (supplement, section 7.1)
FRAMES = 50  # (supplement, section 7.1)
START = (0.07, 0.05)  # meters, capture and filter radius (supplement, section 7.2)
CAPTURE_RADIUS = (0.06, 0.3)  # meters, bounds; a narrower bowl holds no particle, a wider one is close to the walls
MAX_HOLE = 0.8  # of the capture radius
HEIGHT = 0.5  # meters of the mouth above the floor
WATER = (0.36, 0.18)  # meters, side and height of the block: 605 particles
GAP = 0.02  # meters between mouth and block
STEP = 0.03  # meters


def bowl(capture_radius: float = START[0], filter_radius: float = START[1], frames: int = FRAMES) -> Task:
    """The task, with these initial radii in meters and this number of frames."""
    side, height = WATER
    block = Block(min=(-side / 2, -side / 2, HEIGHT + GAP), max=(side / 2, side / 2, HEIGHT + GAP + height))
    return Task(
        name="bowl",
        shape=bowl_surface,
        parameters={
            "r1": Parameter(capture_radius, *CAPTURE_RADIUS, STEP, unit="m"),
            "r2": Parameter(filter_radius, 0.0, max_filter_radius, STEP, 0.0, SURFACE_CLEARANCE, unit="m"),
        },
        scene=Scene(fluid=[Fluid(block=block)], frames=frames + 1),
        reward=near((0.0, 0.0, HEIGHT), VARIANCE),
    )


def bowl_surface(r1: Tensor, r2: Tensor) -> Surface:
    """The bowl at its position."""
    return Transformed(Bowl(r1, r2), translation=(0.0, 0.0, HEIGHT))


def max_filter_radius(values: Values) -> Tensor:
    """The upper bound of the filter radius, meters."""
    return MAX_HOLE * values["r1"].detach()
