"""The funnel of the SURFSUP supplement, section 7: the radii of its mouth and of its spout.

The supplement gives the reward, its variance, and the numbers of frames and iterations. The rest is our choice: the
reward is the mean over the particles that have reached the floor, which is two spacings above the container's; the
spout ends 0.1 m above the floor; and the block of water is three layers thick and starts at 1.5 m/s, as after a fall of
0.11 m, because from rest hardly any water would pass a spout within 75 frames. The reward does not distinguish funnels
that catch all of the water, so the capture radius ends at one that just does.
"""

from __future__ import annotations

from torch import Tensor

from surfsup.design.parameter import Parameter, Values
from surfsup.design.reward import landing_near
from surfsup.design.task import Task
from surfsup.scene import SPACING, Block, Fluid, Scene
from surfsup.sdf import WALL, Funnel, Surface, Transformed

VARIANCE = 0.75  # m² (supplement, section 7.1)
FRAMES = 75  # (supplement, section 7.1)
START = (0.10, 0.09)  # meters, capture and filter radius (supplement, section 7.2)
CAPTURE_RADIUS = (0.1, 0.25)  # meters, bounds
MIN_FILTER_RADIUS = 0.065  # meters; two particles wide, a narrower spout clogs
MAX_SPOUT = 0.95  # of the capture radius
CONE, SPOUT, LIFT = 0.2, 0.03, 0.1  # meters: heights of cone, of spout, and of the spout's end above the floor
HEIGHT = LIFT + WALL / 2 + SPOUT + CONE  # meters of the mouth above the floor
WATER = (0.33, 0.12)  # meters, side and height of the block: 300 particles
GAP = 0.03  # meters between mouth and block
SPEED = 1.5  # m/s
FLOOR = 2 * SPACING  # meters; lower particles have landed
STEP = 0.02  # meters


def funnel(capture_radius: float = START[0], filter_radius: float = START[1], frames: int = FRAMES) -> Task:
    """The task, with these initial radii in meters and this number of frames."""
    side, height = WATER
    block = Block(
        min=(-side / 2, -side / 2, HEIGHT + GAP),
        max=(side / 2, side / 2, HEIGHT + GAP + height),
        velocity=(0.0, 0.0, -SPEED),
    )
    return Task(
        name="funnel",
        shape=funnel_surface,
        parameters={
            "r1": Parameter(capture_radius, *CAPTURE_RADIUS, STEP, unit="m"),
            "r2": Parameter(filter_radius, MIN_FILTER_RADIUS, max_filter_radius, STEP, unit="m"),
        },
        scene=Scene(fluid=[Fluid(block=block)], frames=frames + 1),
        reward=landing_near((0.0, 0.0), VARIANCE, FLOOR),
        floor=FLOOR,
    )


def funnel_surface(r1: Tensor, r2: Tensor) -> Surface:
    """The funnel at its position."""
    return Transformed(Funnel(r1, r2, CONE, SPOUT), translation=(0.0, 0.0, HEIGHT))


def max_filter_radius(values: Values) -> Tensor:
    """The upper bound of the filter radius, meters."""
    return MAX_SPOUT * values["r1"].detach()
