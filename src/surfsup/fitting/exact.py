"""What a solid is before any network: exact distances, normals and points on it, in a cube of side 2."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch

from surfsup.errors import InputError
from surfsup.sdf.mesh.query import MeshQuery, unit
from surfsup.sdf.neural.siren import Cube
from surfsup.sdf.surface import Surface

if TYPE_CHECKING:
    import trimesh

STEP = 2e-3  # of the cube: how far to both sides of a triangle one looks whether it divides in from out
NEAR = 0.1  # |d| of the cube that counts as near
MOST_TRIES = 50  # after which a search for points is given up
FEWEST_DIVIDE = 0.01  # of a mesh's area that must be surface


@dataclass(frozen=True)
class Known:
    """Places and what is known of them.

    Attributes:
        points: (N, 3) in the cube.
        distance: (N,) signed.
        normals: (N, 3) of length one, the gradient of the distance.
    """

    points: np.ndarray
    distance: np.ndarray
    normals: np.ndarray

    def only(self, which: np.ndarray) -> Known:
        """Those of them that ``which`` (a mask or indices) picks."""
        return Known(self.points[which], self.distance[which], self.normals[which])


class Exact(ABC):
    """A solid in the cube of side 2, and points whose distance to it is known exactly.

    Attributes:
        cube: how it was moved and scaled into that.
    """

    cube: Cube

    @abstractmethod
    def on_surface(self, count: int, random: np.random.Generator) -> Known:
        """About ``count`` points spread evenly over the surface.

        Raises:
            InputError: there is no surface.
        """

    @abstractmethod
    def known(self, points: np.ndarray) -> Known:
        """Distance and normal of ``points`` (N, 3), less those of which they are not known."""

    def around(self, count: int, spreads: tuple[float, ...], random: np.random.Generator) -> Known:
        """At most ``count`` points crowded about the surface: on it, moved by normal noise of one of ``spreads``."""
        points = self.on_surface(count, random).points
        spread = random.choice(spreads, size=(len(points), 1))
        return self.known(points + random.normal(size=points.shape) * spread)

    def in_cube(self, count: int, reach: float, random: np.random.Generator) -> Known:
        """At most ``count`` points spread evenly over the cube [-reach, reach]³."""
        return self.known(random.uniform(-reach, reach, size=(count, 3)))

    def near(self, count: int, random: np.random.Generator) -> Known:
        """About ``count`` points spread evenly over what is nearer than :data:`NEAR` to the surface."""
        found: list[Known] = []
        while sum(len(one.points) for one in found) < count and len(found) < MOST_TRIES:
            some = self.in_cube(2 * count, 1.0 + NEAR, random)
            found.append(some.only(np.abs(some.distance) < NEAR))
        joined = joined_of(found)
        return joined.only(np.arange(min(count, len(joined.points))))


class ExactMesh(Exact):
    """A solid given by triangles, which may be open.

    In from out is what the winding number decides. Triangles that do not divide them (inside a solid, doubled, loose)
    are no surface: what is nearest to one of those is left out.

    Args:
        mesh: in its own unit.
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.cube = cube_of(np.asarray(mesh.vertices))
        vertices = into_cube(np.asarray(mesh.vertices), self.cube)
        self.query = MeshQuery(vertices, np.asarray(mesh.faces))
        corners = vertices[self.query.faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        self.cumulated = np.cumsum(area)

    def on_surface(self, count: int, random: np.random.Generator) -> Known:
        """About ``count`` points spread evenly over the surface.

        Raises:
            InputError: no triangle divides an inside from an outside.
        """
        points, faces = self.on_triangles(count, random)
        normals = self.query.face_normals[faces]
        behind, before = self.query.inside(points - STEP * normals), self.query.inside(points + STEP * normals)
        normals = np.where(before[:, None], -normals, normals)
        divides = behind != before
        if divides.mean() < FEWEST_DIVIDE:
            raise InputError("the mesh: hardly a triangle of it divides an inside from an outside; close its holes")
        return Known(points, np.zeros(len(points)), normals).only(divides)

    def on_triangles(self, count: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Points (count, 3) spread evenly over all triangles, and the triangle that each is on (count,)."""
        faces = np.searchsorted(self.cumulated, random.uniform(0, self.cumulated[-1], count))
        first, second = random.uniform(size=(2, count, 1))
        swap = first + second > 1
        first, second = np.where(swap, 1 - first, first), np.where(swap, 1 - second, second)
        corners = self.query.vertices[self.query.faces[faces]]
        points = corners[:, 0] + first * (corners[:, 1] - corners[:, 0]) + second * (corners[:, 2] - corners[:, 0])
        return points, faces

    def known(self, points: np.ndarray) -> Known:
        """Distance and normal of those of ``points`` (N, 3) whose nearest triangle is surface."""
        distance, face, closest = self.query.nearest(points)
        inside = self.query.inside(points)
        normals = self.query.normal(points, distance, face, closest, inside)
        along = self.query.face_normals[face]
        divides = self.query.inside(closest - STEP * along) != self.query.inside(closest + STEP * along)
        return Known(points, np.where(inside, -distance, distance), unit(normals)).only(divides)


class ExactSolid(Exact):
    """A solid whose signed distance is known by a formula, as that of the project's own chairs and bowls.

    Args:
        surface: in its own unit, exact outside.
    """

    def __init__(self, surface: Surface) -> None:
        self.surface = surface
        box = surface.bounds().detach().double().numpy()
        self.cube = cube_of(box)
        self.half = into_cube(box[1:], self.cube)[0]

    def on_surface(self, count: int, random: np.random.Generator) -> Known:
        """About ``count`` points on the surface: places near it, moved onto it along its normal."""
        found: list[Known] = []
        while sum(len(one.points) for one in found) < count:
            reach = self.half + NEAR
            some = self.known(random.uniform(-reach, reach, size=(2 * count, 3)))
            some = some.only(np.abs(some.distance) < NEAR)
            for _ in range(2):
                some = self.known(some.points - some.distance[:, None] * some.normals)
            found.append(some.only(np.abs(some.distance) < STEP))
            if len(found) == MOST_TRIES:
                raise InputError("the solid: no point of its surface was found; is it empty?")
        joined = joined_of(found)
        return joined.only(np.arange(min(count, len(joined.points))))

    def known(self, points: np.ndarray) -> Known:
        """Distance and normal of ``points`` (N, 3)."""
        own = torch.from_numpy(points / self.cube.scale + np.asarray(self.cube.center)).float()
        with torch.no_grad():
            distance, normals = self.surface.distance_and_normal(own)
        return Known(points, self.cube.scale * distance.double().numpy(), normals.double().numpy())


def joined_of(parts: list[Known]) -> Known:
    """All of ``parts``."""
    names = ("points", "distance", "normals")
    return Known(*(np.concatenate([getattr(one, name) for one in parts]) for name in names))


def cube_of(points: np.ndarray) -> Cube:
    """How to move and scale ``points`` (N, 3) so that their box is centered and its longest side is 2."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    center = (lower + upper) / 2
    return Cube(tuple(center.tolist()), float(2 / (upper - lower).max()))


def into_cube(points: np.ndarray, cube: Cube) -> np.ndarray:
    """``points`` (N, 3) moved and scaled into the cube."""
    return (points - np.asarray(cube.center)) * cube.scale
