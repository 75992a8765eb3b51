"""The bowl of section 7 of the SURFSUP supplement: how wide it opens, and the hole at its bottom.

The paper says the reward, its variance, the frames and the iterations. It does not say where bowl and water are; that
is ours: the bowl hangs from its mouth 0.5 m above the floor of the standard container, the water starts at rest right
above it, and the object's height h, around which the water shall gather, is that of the mouth. So water that runs
through the hole or over the rim falls out of the reward's favor, and a bowl larger than needed lets it sink too deep.
A hole narrower than particles of either simulator keep from a solid, through which none can pass, counts as closed.
"""

from __future__ import annotations

from torch import Tensor

from surfsup.design.parameter import Parameter, Values
from surfsup.design.reward import near
from surfsup.design.task import Task
from surfsup.scene import SURFACE_CLEARANCE, Block, Fluid, Scene
from surfsup.sdf import Bowl, Surface, Transformed

VARIANCE = 0.8  # m² (supplement, section 7.1)
FRAMES = 50  # likewise
START = (0.07, 0.05)  # meters, capture and filter radius (supplement, section 7.2)
CAPTURE_RADIUS = (0.06, 0.3)  # meters; narrower it holds no particle, wider it nears the walls
WIDEST_HOLE = 0.8  # of the capture radius: what is left of a bowl
HEIGHT = 0.5  # meters of the mouth above the floor
WATER = (0.36, 0.18)  # meters, side and height of the block: 605 particles
GAP = 0.02  # meters of air between the plane of the mouth and the block
STEP = 0.03  # meters


def bowl(capture_radius: float = START[0], filter_radius: float = START[1], frames: int = FRAMES) -> Task:
    """The task, from a bowl of these radii in meters, over so many frames."""
    side, tall = WATER
    block = Block(min=(-side / 2, -side / 2, HEIGHT + GAP), max=(side / 2, side / 2, HEIGHT + GAP + tall))
    return Task(
        name="bowl",
        shape=hanging_bowl,
        parameters={
            "r1": Parameter(capture_radius, *CAPTURE_RADIUS, STEP),
            "r2": Parameter(filter_radius, 0.0, widest_hole, STEP, keeps=0.0, reach=SURFACE_CLEARANCE),
        },
        scene=Scene(fluid=[Fluid(block=block)], frames=frames + 1),
        reward=near((0.0, 0.0, HEIGHT), VARIANCE),
    )


def hanging_bowl(r1: Tensor, r2: Tensor) -> Surface:
    """The bowl in its place."""
    return Transformed(Bowl(r1, r2), translation=(0.0, 0.0, HEIGHT))


def widest_hole(values: Values) -> Tensor:
    """The largest filter radius, meters."""
    return WIDEST_HOLE * values["r1"].detach()
