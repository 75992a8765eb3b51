"""The fluid at the start: blocks on a cubic lattice of particles, and the particles of a scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import field_validator, model_validator

from surfsup.scene.fill import Fill
from surfsup.scene.liquid import Liquid, named_liquid
from surfsup.scene.particle_file import ParticleFile
from surfsup.scene.strict_model import PositionVector, StrictModel, Vector, Velocity, for_callers_only

PARTICLE_RADIUS: float = 0.015  # meters
SPACING: float = 2 * PARTICLE_RADIUS
NEAR_SURFACE_DISTANCE: float = 6 * PARTICLE_RADIUS  # meters; a closer particle is near the surface (SURFSUP supplement)
MAX_PARTICLES = 50_000_000  # per block; their positions alone take 0.6 GB


class Block(StrictModel):
    """A box of fluid, ``Block(min, max, velocity=(0, 0, 0))``.

    Attributes:
        min, max: lower and upper corner in meters.
        velocity: initial velocity in m/s.

    Examples:
        >>> Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7), velocity=(0, 0, -1)).positions().shape
        (125, 3)
    """

    min: PositionVector
    max: PositionVector
    velocity: Velocity = (0.0, 0.0, 0.0)

    @for_callers_only
    def __init__(self, min: PositionVector, max: PositionVector, velocity: Velocity = (0.0, 0.0, 0.0)) -> None:
        super().__init__(min=min, max=max, velocity=velocity)

    @model_validator(mode="after")
    def check_corners(self) -> Block:
        """Require that the lower corner is below the upper one."""
        for axis, low, high in zip("xyz", self.min, self.max, strict=True):
            if low > high:
                raise ValueError(f"min is above max along {axis} ({low:g} and {high:g}); exchange them")
        return self

    def check_particle_count(self, spacing: float) -> None:
        """Require at least one lattice site along each axis, and at most MAX_PARTICLES in all.

        Args:
            spacing: of the particles, meters.

        Raises:
            ValueError: the block is too thin for a particle or holds more.
        """
        sides = [(high - low) / spacing for low, high in zip(self.min, self.max, strict=True)]
        if (count := math.prod(max(1.0, side) for side in sides)) > MAX_PARTICLES:
            radius = spacing / 2 * (count / MAX_PARTICLES) ** (1 / 3)
            raise ValueError(
                f"block would hold more than {MAX_PARTICLES:,} particles of {spacing:g} m, namely {count:.3g}; "
                f"make it smaller, or particle_radius at least {radius:.2g} m"
            )
        for axis, low, high in zip("xyz", self.min, self.max, strict=True):
            if lattice_sites(low, high, spacing) < 1:
                raise ValueError(
                    f"block is {high - low:.3g} m thick along {axis}: "
                    f"it must be at least {2 * spacing:.3g} m to hold a particle"
                )

    def particle_bounds(self, spacing: float = SPACING) -> list[tuple[float, float]]:
        """Coordinates of the first and the last particle along x, y and z in meters."""
        return [
            (low + spacing, low + spacing * lattice_sites(low, high, spacing))
            for low, high in zip(self.min, self.max, strict=True)
        ]

    def positions(self, spacing: float = SPACING) -> np.ndarray:
        """Particle positions (N, 3) float32 in meters, on the lattice of SPlisHSPlasH's fluid blocks.

        Args:
            spacing: of the particles, meters.
        """
        axes = [
            low + spacing * (1 + np.arange(lattice_sites(low, high, spacing)))
            for low, high in zip(self.min, self.max, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)


class Fluid(StrictModel):
    """One entry of ``fluid`` in a scene file: a block, a filled shape or vessel, or the particles of a file.

    Attributes:
        block, fill, particles: exactly one of them.
        liquid: that of the entry, or its name; None for that of the scene.

    Examples:
        >>> import surfsup as sf
        >>> oil = sf.Fluid(block=sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7)), liquid="oil")
        >>> oil.liquid.density
        911.0
    """

    KINDS: ClassVar[tuple[str, ...]] = ("block", "fill", "particles")

    block: Block | None = None
    fill: Fill | None = None
    particles: ParticleFile | None = None
    liquid: Liquid | None = None

    @field_validator("liquid", mode="before")
    @classmethod
    def find_liquid(cls, value: Any) -> Any:
        """Take a name for the liquid that has it."""
        return named_liquid(value)

    @model_validator(mode="after")
    def check_kind(self) -> Fluid:
        """Require exactly one kind."""
        given = [kind for kind in self.KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "none"
            raise ValueError(f"needs exactly one of {', '.join(self.KINDS)}, found {found}")
        return self

    @classmethod
    def of(cls, entry: Fluid | Block | Fill | ParticleFile) -> Fluid:
        """The entry of a block, a fill or a file; an entry stays as it is."""
        if isinstance(entry, Block):
            return cls(block=entry)
        if isinstance(entry, Fill):
            return cls(fill=entry)
        return cls(particles=entry) if isinstance(entry, ParticleFile) else entry

    @property
    def kind(self) -> str:
        """The key of the entry."""
        return next(kind for kind in self.KINDS if getattr(self, kind) is not None)

    @property
    def content(self) -> Block | Fill | ParticleFile:
        """The one that is given."""
        content: Block | Fill | ParticleFile = getattr(self, self.kind)
        return content

    @property
    def speed(self) -> float:
        """The magnitude of the entry's velocity in m/s; 0 for the velocities of a file."""
        return math.hypot(*(self.content.velocity or (0.0, 0.0, 0.0)))

    @property
    def settle(self) -> bool:
        """Whether the water comes to rest before the scene begins."""
        return not isinstance(self.content, Block) and self.content.settle

    def map_files(self, function: Callable[[Path], Path]) -> Fluid:
        """A copy with ``function`` applied to the path of every file."""
        content = self.content
        if isinstance(content, ParticleFile):
            return self.model_copy(update={"particles": content.model_copy(update={"file": function(content.file)})})
        if isinstance(content, Fill) and content.surface is not None:
            fill = content.model_copy(update={"surface": content.surface.map_files(function)})
            return self.model_copy(update={"fill": fill})
        return self


@dataclass(frozen=True)
class InitialParticles:
    """The particles of a scene at its start.

    Attributes:
        block_positions: positions (N, 3) float32 in meters, one array per block.
        block_velocities: velocity in m/s, one per block, or one (N, 3) for each of its particles.
        excluded: number of lattice sites without a particle, because they overlap the solid or another block.
        settle: whether the water of each block comes to rest before the scene begins; empty for none.
        block_liquids: of each block the number of its liquid in :attr:`surfsup.scene.Scene.mixture`, or one (N,) for
            each of its particles; empty in a scene of one liquid.
    """

    block_positions: list[np.ndarray]
    block_velocities: Sequence[Vector | np.ndarray]
    excluded: int
    settle: tuple[bool, ...] = ()
    block_liquids: Sequence[int | np.ndarray] = ()

    @property
    def positions(self) -> np.ndarray:
        """Positions (N, 3) float32 of all particles in meters."""
        return np.concatenate([np.empty((0, 3), np.float32), *self.block_positions])

    @property
    def velocities(self) -> np.ndarray:
        """Velocities (N, 3) float32 of all particles in m/s."""
        return np.concatenate(
            [
                np.empty((0, 3), np.float32),
                *(
                    np.broadcast_to(np.array(velocity, np.float32), positions.shape)
                    for positions, velocity in zip(self.block_positions, self.block_velocities, strict=True)
                ),
            ]
        )

    @property
    def liquids(self) -> np.ndarray | None:
        """The number of the liquid of each particle, (N,) int32; None in a scene of one liquid."""
        if not len(self.block_liquids):
            return None
        pairs = zip(self.block_positions, self.block_liquids, strict=True)
        return np.concatenate([np.broadcast_to(np.asarray(liquid, np.int32), len(block)) for block, liquid in pairs])


def lattice_sites(low: float, high: float, spacing: float = SPACING) -> int:
    """Number of lattice sites along a side from ``low`` to ``high``: the whole spacings in it, minus one.

    SPlisHSPlasH places as many for a side of whole spacings. For other sides it rounds, so that particles may be up to
    half a spacing closer to the face of the block; this function rounds down.
    """
    return int(np.floor((high - low) / spacing + 1e-4)) - 1
