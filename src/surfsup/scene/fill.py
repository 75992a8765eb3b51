"""Water that fills a shape, or a vessel up to a level."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch
from pydantic import model_validator

from surfsup.errors import InputError
from surfsup.scene.shapes import Shape
from surfsup.scene.strict_model import Finite, StrictModel, Vector
from surfsup.sdf import Surface

CELLS_PER_SPACING = 2  # of the grid on which the inside of a vessel is found
# Radii from the solid to the center of a particle that collision handling keeps out of it: narrower gaps are closed.
FLOW_CLEARANCE = 4 / 3
MAX_CELLS = 60_000_000
CHUNK = 1_000_000  # points per query of a solid
BISECTIONS = 6


class Fill(StrictModel):
    """Water inside a shape, or inside the solid's hollows, on a cubic lattice.

    Attributes:
        surface: the shape of the water; None for the hollows of the scene's solid.
        below: the water's level in meters; required without ``surface``.
        seed: a point of the hollow to fill; None fills all hollows that hold water.
        velocity: initial velocity in m/s.
        settle: whether the water comes to rest before the scene begins.

    Examples:
        >>> import surfsup as sf
        >>> bowl = sf.Transformed(sf.Bowl(0.3), translation=(0, 0, 0.36))
        >>> scene = sf.Scene(surface=bowl, fluid=[Fill(below=0.3)])
        >>> round(float(scene.initial_particles(bowl).positions[:, 2].max()), 3)
        0.285
        >>> drop = Fill(surface={"sphere": {"radius": 0.1}, "at": (0, 0, 1)}, velocity=(0, 0, -1))
        >>> len(sf.Scene(fluid=[drop]).initial_particles(None).positions)
        159
    """

    surface: Shape | None = None
    below: Finite | None = None
    seed: Vector | None = None
    velocity: Vector = (0.0, 0.0, 0.0)
    settle: bool = False

    @model_validator(mode="after")
    def check_region(self) -> Fill:
        """Require a shape or a level, and a seed only for a vessel."""
        if self.surface is None and self.below is None:
            raise ValueError("needs a surface (the shape of the water), or below (the level in a vessel, in meters)")
        if self.surface is not None and self.seed is not None:
            raise ValueError("takes a seed only without a surface: a seed chooses the vessel")
        return self

    def positions(self, shape: Surface | None, solid: Surface | None, radius: float) -> np.ndarray:
        """Particle positions (N, 3) float32 in meters, before those too close to the solid are left out.

        Args:
            shape: the shape of the water, if the entry has one.
            solid: the scene's solid.
            radius: of the particles, meters.

        Raises:
            InputError: the region is empty, or water would run out of it.
        """
        if shape is not None:
            return shape_lattice(shape, self.below, radius)
        assert self.below is not None
        if solid is None:
            raise InputError("fluid: a fill without a surface needs a vessel, but the scene has no solid")
        return Vessel(solid, self.below, radius).lattice(self.seed)


def shape_lattice(shape: Surface, below: float | None, radius: float) -> np.ndarray:
    """The lattice sites (N, 3) in ``shape``, as many as its volume holds; those of a level have their top at it.

    Raises:
        InputError: no particle fits.
    """
    lower, upper = shape.bounds().double().numpy()
    top = upper[2] if below is None else min(below, upper[2])
    count = np.prod(np.maximum(1, (upper - lower) / (2 * radius)))
    if not np.isfinite(count) or count > MAX_CELLS:
        raise InputError(f"fluid: the fill's shape would need a grid of {count:.3g} particles; enlarge particle_radius")
    sites = lattice(lower, np.array([upper[0], upper[1], top]), radius)
    inside = distances(shape, sites) <= 0
    if not inside.any():
        level = "" if below is None else f" below {below:.3g} m"
        raise InputError(
            f"fluid: the fill's shape holds no particle{level}: it reaches from {lower[2]:.3g} to {upper[2]:.3g} m, "
            f"and particles are {2 * radius:.3g} m apart"
        )
    return sites[inside]


def lattice(lower: np.ndarray, upper: np.ndarray, radius: float) -> np.ndarray:
    """Sites (N, 3) float32 a spacing apart in a box: centered in x and y, the highest a radius below its top."""
    spacing = 2 * radius
    axes = []
    for low, high in zip(lower[:2], upper[:2], strict=True):
        sites = max(1, round((high - low) / spacing))
        axes.append((low + high) / 2 + spacing * (np.arange(sites) - (sites - 1) / 2))
    axes.append(np.arange(upper[2] - radius, lower[2], -spacing)[::-1])
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)


def distances(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Signed distances (N,) of ``points`` (N, 3) float32, meters."""
    parts = np.array_split(points, max(1, len(points) // CHUNK))
    with torch.no_grad():
        return np.concatenate([surface.distance(torch.from_numpy(part)).numpy() for part in parts])


class Vessel:
    """The hollows of a solid below a level, on a grid of its signed distance.

    A hollow is a region for the centers of particles that neither the solid's sides nor its bottom let out. The grid
    is the solid's bounding box up to the level; a region that touches its sides or its bottom is open.

    Args:
        solid: the solid.
        level: height of the water in meters.
        radius: of the particles, meters.

    Raises:
        InputError: the solid is above the level, or the grid would be too large.
    """

    def __init__(self, solid: Surface, level: float, radius: float) -> None:
        self.solid, self.level, self.radius = solid, level, radius
        self.cell = 2 * radius / CELLS_PER_SPACING
        self.lower, self.upper = solid.bounds().detach().double().numpy()
        if level <= self.lower[2] + 2 * radius:
            raise InputError(
                f"fluid: nothing holds water below {level:.3g} m: the solid begins at {self.lower[2]:.3g} m"
            )
        self.top = min(level, self.upper[2] + 4 * radius)  # water above the rim runs over it
        self.shape = np.ceil((np.append(self.upper[:2], self.top) - self.lower) / self.cell).astype(int) + 1
        if self.shape.astype(float).prod() > MAX_CELLS:
            raise InputError(
                f"fluid: finding the inside of the solid would need a grid of {self.shape.astype(float).prod():.3g} "
                "cells; enlarge particle_radius, or give the water's own surface"
            )
        points = self.points(np.indices(self.shape).reshape(3, -1).T)
        self.distance = distances(solid, points.astype(np.float32)).reshape(self.shape)

    def points(self, cells: np.ndarray) -> np.ndarray:
        """The grid points (N, 3) of ``cells`` (N, 3): centered on the solid in x and y, the highest at the level."""
        side = self.cell * (self.shape - 1)
        return np.append((self.lower + self.upper - side)[:2] / 2, self.top - side[2]) + self.cell * cells

    def lattice(self, seed: Vector | None) -> np.ndarray:
        """The lattice sites (N, 3) of the hollow that contains ``seed``, or of all hollows.

        Raises:
            InputError: there is none, or water would run out.
        """
        from scipy import ndimage

        regions, count = ndimage.label(self.distance >= FLOW_CLEARANCE * self.radius)
        is_open = np.zeros(count + 1, dtype=bool)
        is_open[[0, *open_regions(regions)]] = True
        if seed is not None:
            number = regions[self.seed_cell(seed)]
            if number == 0:
                raise InputError(
                    f"fluid: the seed {format_point(seed)} is inside the solid, or closer to it than a particle"
                )
            if is_open[number]:
                raise self.leak_error(seed)
            numbers = np.array([number])
        else:
            if is_open.all():
                raise InputError(
                    f"fluid: the solid holds no water below {self.level:.3g} m: it has no hollow there, or the hollow "
                    "is open; a seed, a point in the hollow, makes the message say where the water would run out"
                )
            numbers = np.flatnonzero(~is_open)
        boxes = ndimage.find_objects(regions)
        return np.concatenate([self.sites(regions, number, boxes[number - 1]) for number in numbers])

    def sites(self, regions: np.ndarray, number: int, box: tuple[slice, slice, slice]) -> np.ndarray:
        """The lattice sites (N, 3) of a region, which is in the ``box`` of the grid's cells."""
        first, last = np.array([[side.start, side.stop - 1] for side in box]).T
        low, high = self.points(np.stack([first, last]))
        sites = lattice(low - self.radius, np.append(high[:2] + self.radius, high[2]), self.radius)
        nearest = np.round((sites - self.points(np.zeros((1, 3)))) / self.cell).astype(int).clip(first, last)
        return sites[regions[tuple(nearest.T)] == number]

    def seed_cell(self, seed: Vector) -> tuple[int, int, int]:
        """The grid cell of a seed.

        Raises:
            InputError: it is above the level or beside the solid.
        """
        x, y, z = np.round((np.array(seed) - self.points(np.zeros((1, 3)))[0]) / self.cell).astype(int)
        if seed[2] > self.level:
            raise InputError(f"fluid: the seed {format_point(seed)} is above the level of {self.level:.3g} m")
        if not all(0 <= index < size for index, size in zip((x, y, z), self.shape, strict=True)):
            raise InputError(
                f"fluid: the seed {format_point(seed)} is outside the solid, which reaches from "
                f"{format_point(self.lower)} to {format_point(self.upper)} m; nothing there holds the water"
            )
        return int(x), int(y), int(z)

    def leak_error(self, seed: Vector) -> InputError:
        """The error for an open region: it names the narrowest place of the widest way out."""
        from scipy import ndimage

        start = self.seed_cell(seed)
        closed, leaking = float(self.distance.max()), FLOW_CLEARANCE * self.radius
        for _ in range(BISECTIONS):
            clearance = (closed + leaking) / 2
            regions, _ = ndimage.label(self.distance >= clearance)
            if regions[start] and regions[start] in open_regions(regions):
                leaking = clearance
            else:
                closed = clearance
        regions, _ = ndimage.label(self.distance >= leaking)
        inner, _ = ndimage.label(self.distance >= closed)
        # With a little more clearance the way out falls into a part inside and a part outside; the leak is between.
        way_out = regions == regions[start]
        inside = inner == inner[start] if inner[start] else np.zeros_like(way_out)
        inside[start] = True
        outside = way_out & np.isin(inner, list(open_regions(inner)))
        border = np.ones_like(way_out)
        border[1:-1, 1:-1, 1:] = False
        outside |= way_out & border
        steps = ndimage.distance_transform_edt(~inside) + ndimage.distance_transform_edt(~outside)
        place = np.unravel_index(np.argmin(np.where(way_out & ~inside, steps, np.inf)), way_out.shape)
        return InputError(
            f"fluid: the hollow around the seed is open below {self.level:.3g} m: water would run out near "
            f"{format_point(self.points(np.array(place)))} m; lower the level, or close the gap"
        )


def open_regions(regions: np.ndarray) -> set[int]:
    """Numbers of the labeled ``regions`` that touch the sides or the bottom of the grid."""
    faces: Iterator[np.ndarray] = iter((regions[0], regions[-1], regions[:, 0], regions[:, -1], regions[:, :, 0]))
    return {int(number) for face in faces for number in np.unique(face)} - {0}


def format_point(point: Vector | np.ndarray) -> str:
    """A point for a message."""
    return "(" + ", ".join(f"{value:.3g}" for value in point) + ")"
