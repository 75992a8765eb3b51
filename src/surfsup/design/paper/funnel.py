"""The funnel of section 7 of the SURFSUP supplement: how wide it opens, and how wide its spout is.

The paper says the reward, its variance, the frames and the iterations. The rest is ours: the reward is the mean over
those particles that have reached the floor; a particle has when it is two spacings above it; the spout ends 0.1 m
above the floor; and the block of water, which is three layers thick, starts at 1.5 m/s, as if it had fallen 0.11 m, for
within 75 frames from rest hardly any of it would pass a spout. The reward cannot tell funnels apart that catch all of
the water, so the capture radius ends at one that just does.
"""

from __future__ import annotations

from torch import Tensor

from surfsup.design.parameter import Parameter, Values
from surfsup.design.reward import landing_near
from surfsup.design.task import Task
from surfsup.scene import SPACING, Block, Fluid, Scene
from surfsup.sdf import WALL, Funnel, Surface, Transformed

VARIANCE = 0.75  # m² (supplement, section 7.1)
FRAMES = 75  # likewise
START = (0.10, 0.09)  # meters, capture and filter radius (supplement, section 7.2)
CAPTURE_RADIUS = (0.1, 0.25)  # meters
FILTER_RADIUS = 0.065  # meters; two particles wide, a narrower one clogs
WIDEST_SPOUT = 0.95  # of the capture radius: what is left of a funnel
CONE, SPOUT, LIFT = 0.2, 0.03, 0.1  # meters: heights of cone, spout and of the spout's end above the floor
HEIGHT = LIFT + WALL / 2 + SPOUT + CONE  # meters of the mouth above the floor
WATER = (0.33, 0.12)  # meters, side and height of the block: 300 particles
GAP = 0.03  # meters of air between the plane of the mouth and the block
SPEED = 1.5  # m/s
FLOOR = 2 * SPACING  # meters: who is as low has reached the floor
STEP = 0.02  # meters


def funnel(capture_radius: float = START[0], filter_radius: float = START[1], frames: int = FRAMES) -> Task:
    """The task, from a funnel of these radii in meters, over so many frames."""
    side, tall = WATER
    block = Block(
        min=(-side / 2, -side / 2, HEIGHT + GAP),
        max=(side / 2, side / 2, HEIGHT + GAP + tall),
        velocity=(0.0, 0.0, -SPEED),
    )
    return Task(
        name="funnel",
        shape=hanging_funnel,
        parameters={
            "r1": Parameter(capture_radius, *CAPTURE_RADIUS, STEP),
            "r2": Parameter(filter_radius, FILTER_RADIUS, widest_spout, STEP),
        },
        scene=Scene(fluid=[Fluid(block=block)], frames=frames + 1),
        reward=landing_near((0.0, 0.0), VARIANCE, FLOOR),
        floor=FLOOR,
    )


def hanging_funnel(r1: Tensor, r2: Tensor) -> Surface:
    """The funnel in its place."""
    return Transformed(Funnel(r1, r2, CONE, SPOUT), translation=(0.0, 0.0, HEIGHT))


def widest_spout(values: Values) -> Tensor:
    """The largest filter radius, meters."""
    return WIDEST_SPOUT * values["r1"].detach()
