"""The recipe ``assorted``: all that a user might pour, for training and for judging beyond the supplement's sets.

All of it is ours. A solid of one of the other recipes, made smaller or lifted off the floor at times, or none; a
container up to half as wide again; one or two blocks of water of any shape between a slab and a column, above the
solid or standing on the floor like a dam, at rest or thrown; gravity weaker or stronger, tilted at times. Half as many
frames as usual: what is asked for is variety.
"""

from __future__ import annotations

import numpy as np
import torch

from surfsup.datasets.recipes.bowls import Bowls
from surfsup.datasets.recipes.chairs import Chairs
from surfsup.datasets.recipes.funnels import Funnels
from surfsup.datasets.recipes.prim_shapes import PrimShapes
from surfsup.datasets.recipes.prim_unions import PrimUnions
from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.water import WALL_GAP, Random
from surfsup.scene import SPACING, Block, Container, Fluid, Scene, Shape
from surfsup.sdf import Surface

SOLIDS = (PrimShapes, PrimUnions, Bowls, Funnels, Chairs)
FRAMES = 400
SIDE = (1.0, 1.5)  # meters of the container, along x and along y
SMALLER = (0.5, 1.0)  # scale of every third solid
LIFTED = (0.0, 0.3)  # meters, every third one again
BLOCK_SIDE = (0.2, 0.6)
PARTICLES = (600, 5000)  # of a block
SPEED = 2.5  # m/s, the largest of a thrown block
STRENGTH = (0.6, 1.4)  # of gravity's 9.81 m/s²
TILT = 20.0  # degrees, the largest
# Water of a lattice that begins nearer than this to a solid is denser than the solver allows, and bursts.
CLEAR = 0.036  # meters
TRIES = 50


class Assorted(Recipe):
    """Any solid, any container, any water, any gravity."""

    name = "assorted"

    def scene(self, index: int, random: Random) -> Scene:
        """Scene number ``index``: the kinds of solid take turns, every sixth has none; the rest is from ``random``."""
        container = Container(size=(*random.uniform(*SIDE, size=2).tolist(), 2.0))
        kind = index % (len(SOLIDS) + 1)
        solid = None
        if kind < len(SOLIDS):
            solid = moved(SOLIDS[kind](self.folder).scene(index, random).surface, random)
        surface = None if solid is None else solid.surface(self.folder)
        water: list[Fluid] = []
        for _ in range(random.integers(1, 3)):
            water += free_block(container, surface, water, random)
        return Scene(container=container, surface=solid, fluid=water, gravity=gravity(random), frames=FRAMES)


def moved(solid: Shape, random: Random) -> Shape:
    """The solid as it is, or smaller about the middle of the floor, or lifted: a third each."""
    choice = random.integers(3)
    if choice == 1:
        return Shape(union=[solid], scale=random.uniform(*SMALLER))
    if choice == 2:
        return Shape(union=[solid], at=(0.0, 0.0, random.uniform(*LIFTED)))
    return solid


def free_block(container: Container, surface: Surface | None, others: list[Fluid], random: Random) -> list[Fluid]:
    """A block of water that touches nothing; none where none was found, but always one where there is no other.

    Raises:
        RuntimeError: the container is full, which no solid of these recipes makes it.
    """
    lower, upper = np.add(container.lower, WALL_GAP), np.subtract(container.upper, WALL_GAP)
    for _ in range(TRIES if others else 100 * TRIES):
        sides = random.uniform(*BLOCK_SIDE, size=3)
        corner = random.uniform(lower, upper - sides)
        if random.random() < 0.3:
            corner[2] = WALL_GAP
        if not PARTICLES[0] < np.prod(sides) / SPACING**3 < PARTICLES[1]:
            continue
        thrown = random.random() < 0.5
        direction = random.normal(size=3)
        speed = random.uniform(0.0, SPEED) if thrown else 0.0
        velocity = speed * direction / np.linalg.norm(direction)
        block = Block(
            min=tuple(corner.tolist()), max=tuple((corner + sides).tolist()), velocity=tuple(velocity.tolist())
        )
        if not any(meet(block, other.block) for other in others) and is_clear(block, surface):
            return [Fluid(block=block)]
    if others:
        return []
    raise RuntimeError("no room for water")


def meet(one: Block, other: Block) -> bool:
    """Whether two blocks overlap or touch."""
    return all(
        low <= other_high + SPACING and other_low <= high + SPACING
        for low, high, other_low, other_high in zip(one.min, one.max, other.min, other.max, strict=True)
    )


def is_clear(block: Block, surface: Surface | None) -> bool:
    """Whether all particles of the block keep their distance from the solid."""
    if surface is None:
        return True
    with torch.no_grad():
        return bool((surface.distance(torch.from_numpy(block.positions())) > CLEAR).all())


def gravity(random: Random) -> tuple[float, float, float]:
    """The usual one, or another strength, or tilted by up to TILT: a third each."""
    strength, tilt = 9.81, 0.0
    choice = random.integers(3)
    if choice == 1:
        strength *= random.uniform(*STRENGTH)
    elif choice == 2:
        tilt = np.radians(random.uniform(0.0, TILT))
    around = random.uniform(0.0, 2 * np.pi)
    direction = np.array([np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), -np.cos(tilt)])
    return tuple((strength * direction).tolist())
