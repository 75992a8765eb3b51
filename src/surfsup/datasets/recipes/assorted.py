"""The recipe ``assorted``: many kinds of scenes, for training and for evaluation beyond the supplement's sets.

The recipe is ours. A solid of another recipe, at times scaled down or lifted off the floor, or none; a container up to
half as wide again; one or two blocks of water of any shape between a slab and a column, above the solid or standing on
the floor like a dam, at rest or thrown; weaker, stronger or tilted gravity. It has half the usual number of frames: the
purpose is variety.
"""

from __future__ import annotations

import numpy as np
import torch

from surfsup.datasets.recipes.bowls import Bowls
from surfsup.datasets.recipes.chairs import Chairs
from surfsup.datasets.recipes.funnels import Funnels
from surfsup.datasets.recipes.prim_shapes import PrimShapes
from surfsup.datasets.recipes.prim_unions import PrimUnions
from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import WALL_GAP, block_at
from surfsup.scene import SPACING, Block, Container, Scene, Shape
from surfsup.sdf import Surface

SOLIDS = (PrimShapes, PrimUnions, Bowls, Funnels, Chairs)
FRAMES = 400
SIDE = (1.0, 1.5)  # meters of the container, along x and along y
SCALE = (0.5, 1.0)  # of a third of the solids
LIFT = (0.0, 0.3)  # meters, of another third
BLOCK_SIDE = (0.2, 0.6)
PARTICLES = (600, 5000)  # of a block
MAX_SPEED = 2.5  # m/s of a thrown block
STRENGTH = (0.6, 1.4)  # of gravity, relative to 9.81 m/s²
MAX_TILT = 20.0  # degrees
# meters: a lattice that starts closer to a solid is denser than the solver allows, and bursts
SOLID_GAP = 0.036
ATTEMPTS = 50


class Assorted(Recipe):
    """Any solid, any container, any water, any gravity."""

    name = "assorted"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: the kinds of solids alternate, every sixth scene has none, ``random`` has the rest."""
        width, depth = random.uniform(*SIDE, size=2).tolist()
        container = Container(size=(width, depth, 2.0))
        kind = index % (len(SOLIDS) + 1)
        solid: Shape | None = None
        if kind < len(SOLIDS):
            drawn = SOLIDS[kind](self.folder).scene(index, random).surface
            assert isinstance(drawn, Shape)
            solid = scaled_or_lifted(drawn, random)
        surface = None if solid is None else solid.surface(self.folder)
        water: list[Block] = []
        for _ in range(random.integers(1, 3)):
            water += free_block(container, surface, water, random)
        return Scene(container=container, surface=solid, fluid=water, gravity=random_gravity(random), frames=FRAMES)


def scaled_or_lifted(solid: Shape, random: Random) -> Shape:
    """The solid unchanged, scaled down about the middle of the floor, or lifted, with equal probability."""
    choice = random.integers(3)
    if choice == 1:
        return Shape(union=[solid], scale=random.uniform(*SCALE))
    if choice == 2:
        return Shape(union=[solid], at=(0.0, 0.0, random.uniform(*LIFT)))
    return solid


def free_block(container: Container, surface: Surface | None, others: list[Block], random: Random) -> list[Block]:
    """A block of water that touches nothing, as a list; it may be empty only if there are other blocks.

    Raises:
        RuntimeError: the container is full, which no solid of these recipes causes.
    """
    lower, upper = np.add(container.lower, WALL_GAP), np.subtract(container.upper, WALL_GAP)
    for _ in range(ATTEMPTS if others else 100 * ATTEMPTS):
        sides = random.uniform(*BLOCK_SIDE, size=3)
        corner = random.uniform(lower, upper - sides)
        if random.random() < 0.3:
            corner[2] = WALL_GAP
        if not PARTICLES[0] < np.prod(sides) / SPACING**3 < PARTICLES[1]:
            continue
        thrown = random.random() < 0.5
        direction = random.normal(size=3)
        speed = random.uniform(0.0, MAX_SPEED) if thrown else 0.0
        velocity = speed * direction / np.linalg.norm(direction)
        block = block_at(corner, sides).model_copy(update={"velocity": tuple(velocity.tolist())})
        if not any(touch(block, other) for other in others) and is_clear(block, surface):
            return [block]
    if others:
        return []
    raise RuntimeError("no room for water")


def touch(one: Block, other: Block) -> bool:
    """Whether two blocks overlap or touch."""
    return all(
        low <= other_high + SPACING and other_low <= high + SPACING
        for low, high, other_low, other_high in zip(one.min, one.max, other.min, other.max, strict=True)
    )


def is_clear(block: Block, surface: Surface | None) -> bool:
    """Whether all particles of the block are at least SOLID_GAP from the solid."""
    if surface is None:
        return True
    with torch.no_grad():
        return bool((surface.distance(torch.from_numpy(block.positions())) > SOLID_GAP).all())


def random_gravity(random: Random) -> tuple[float, float, float]:
    """Gravity as usual, of another strength, or tilted by up to MAX_TILT, with equal probability, in m/s²."""
    strength, tilt = 9.81, 0.0
    choice = random.integers(3)
    if choice == 1:
        strength *= random.uniform(*STRENGTH)
    elif choice == 2:
        tilt = np.radians(random.uniform(0.0, MAX_TILT))
    azimuth = random.uniform(0.0, 2 * np.pi)
    direction = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), -np.cos(tilt)])
    x, y, z = (strength * direction).tolist()
    return x, y, z
