"""What moves in a frame: solids and walls with their poses before and after it.

Within a frame each moves on a straight line at constant speed and turns at constant rate. A frame in which a solid
moves more than a particle radius is computed in pieces, so that the water meets it on its way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.errors import InputError
from surfsup.native.dispatch import needs_gradient, tensors_requiring_grad
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS
from surfsup.scene.pose import Pose, between
from surfsup.scene.solids import CONTAINER, MovingSolid, Solids
from surfsup.sdf import Surface
from surfsup.sph.boundary.boundary_map import BoundaryMap
from surfsup.sph.collision_surface import for_collisions
from surfsup.sph.native_query import PythonQuery, python_query
from surfsup.sph.rigid_steps import Places, interpolated, places_between
from surfsup.sph.state import SUBSTEPS

MAX_PIECES = 100  # of a frame


class MovingBody:
    """A solid that moves: its surface, boundary map and query in its own frame.

    Attributes:
        solid: name, surface and motion.
        box: (2, 3) float32, corners of a box around it in its own frame, meters.

    Raises:
        InputError: a tensor of its shape requires a gradient.
    """

    def __init__(self, solid: MovingSolid) -> None:
        if tensors_requiring_grad(solid.surface):
            raise InputError(f"surface '{solid.name}' moves, so that its shape cannot have gradients; detach it")
        self.solid = solid
        self.box = solid.surface.bounds().detach().cpu().numpy().astype(np.float32)

    def __getstate__(self) -> dict[str, object]:
        """The attributes alone: cached native objects can be neither copied nor pickled."""
        return {"solid": self.solid, "box": self.box}

    @cached_property
    def boundary_map(self) -> BoundaryMap:
        """The boundary volume map of the whole solid."""
        return BoundaryMap.of_whole(self.solid.surface, self.solid.name)

    @cached_property
    def surface(self) -> Surface:
        """The solid as collision handling queries it, on the CPU."""
        return for_collisions(self.solid.surface)

    def surface_on(self, device: torch.device) -> Surface:
        """:attr:`surface` on a device, copied at most once."""
        if device not in self._copies:
            self._copies[device] = self.surface if device.type == "cpu" else deepcopy(self.surface).to(device)
        return self._copies[device]

    @cached_property
    def _copies(self) -> dict[torch.device, Surface]:
        return {}

    @cached_property
    def query(self) -> native.Solid | PythonQuery:
        """The signed distance for C++ code."""
        return self.surface.native_solid() or python_query(self.surface)

    @cached_property
    def corners(self) -> np.ndarray:
        """The corners (8, 3) of the box."""
        return np.array(list(product(*self.box.T.astype(np.float64))))


@dataclass(frozen=True)
class FrameMotion:
    """What moves, with its poses at the start and the end of a frame or of a piece of one.

    Attributes:
        bodies: the solids.
        start, end: poses by name, that of a container that moves too.
        seconds: between start and end.
        traced: (2, 7) the poses of some of them again, with gradients: positions in meters and quaternions.
    """

    bodies: tuple[MovingBody, ...]
    start: Mapping[str, Pose]
    end: Mapping[str, Pose]
    seconds: float = FRAME_TIME
    traced: Mapping[str, Tensor] = field(default_factory=dict)

    def part(self, first: float, last: float) -> FrameMotion:
        """The motion between two fractions of the time."""
        start, end = (
            {name: between(self.start[name], self.end[name], fraction) for name in self.start}
            for fraction in (first, last)
        )
        fractions = torch.tensor([first, last], dtype=torch.float64)
        traced = {name: interpolated(ends[None], fractions)[:, 0] for name, ends in self.traced.items()}
        return replace(self, start=start, end=end, seconds=(last - first) * self.seconds, traced=traced)

    def pieces(self) -> list[FrameMotion]:
        """The motions of the pieces that the frame is computed in: one, or a multiple of the substeps of a frame.

        A piece is as short as makes every solid move at most a particle radius: so far water may miss it, and less
        than the clearance of collision handling.
        """
        radii = max(self.displacements, default=0.0) / PARTICLE_RADIUS
        count = 1 if radii <= 1 else min(SUBSTEPS * math.ceil(radii / SUBSTEPS), MAX_PIECES)
        if count == 1:
            return [self]
        parts = (self.part(number / count, (number + 1) / count) for number in range(count))
        return [replace(part, seconds=self.seconds / count) for part in parts]

    @cached_property
    def displacements(self) -> list[float]:
        """The largest distance that a corner of the box around each solid moves, meters."""
        found = []
        for body in self.bodies:
            start, end = self.start[body.solid.name], self.end[body.solid.name]
            path = body.corners @ (end.matrix - start.matrix).T + (end.position - start.position)
            found.append(math.sqrt((path**2).sum(axis=1).max()))
        return found

    @property
    def requires_grad(self) -> bool:
        """Whether torch is recording gradients and a pose requires one."""
        return needs_gradient(*self.traced.values())

    @property
    def moves_container(self) -> bool:
        """Whether the walls move."""
        return CONTAINER in self.start

    @cached_property
    def ends(self) -> Tensor:
        """The poses (K, 2, 7) at start and end: of the bodies, then of a container that moves."""
        names = [body.solid.name for body in self.bodies] + [CONTAINER] * self.moves_container
        return torch.stack(
            [
                self.traced[name]
                if name in self.traced
                else torch.from_numpy(np.stack([self.start[name].array, self.end[name].array]))
                for name in names
            ]
        )

    @cached_property
    def _places(self) -> dict[int, Places]:
        return {}

    def places(self, count: int) -> Places:
        """Where all is at the start and the end of each of ``count`` substeps."""
        if count not in self._places:
            self._places[count] = places_between(self.ends, count, self.seconds)
        return self._places[count]

    def native(
        self, query_positions: np.ndarray | None = None, query_distance: np.ndarray | None = None, count: int = 0
    ) -> tuple[Any, ...]:
        """The motion as C++ functions take it.

        Args:
            query_positions: (K, N, 3) float32, where each particle last queried each solid, in the solid's frame.
            query_distance: (K, N) float32, the distances there; both are updated. Without them all query again.
            count: number of particles N, needed without them.
        """
        if query_positions is None or query_distance is None:
            query_positions, query_distance = no_query(len(self.bodies), count)
        poses = np.array([[self.start[b.solid.name].array, self.end[b.solid.name].array] for b in self.bodies]).reshape(
            -1, 2, 7
        )
        walls = None
        if self.moves_container:
            walls = np.array([self.start[CONTAINER].array, self.end[CONTAINER].array])
        boxes = np.array([body.box for body in self.bodies], np.float32).reshape(-1, 2, 3)
        return (
            [body.boundary_map.tables.native for body in self.bodies],
            boxes,
            [body.query for body in self.bodies],
            poses,
            query_positions,
            query_distance,
            walls,
        )


class MovingSolids:
    """All that moves in a scene.

    Attributes:
        solids: of the scene.
        bodies: the moving ones with their maps.
    """

    def __init__(self, solids: Solids) -> None:
        self.solids = solids
        self.bodies = tuple(MovingBody(solid) for solid in solids.moving)

    def between(self, start: Mapping[str, Pose], end: Mapping[str, Pose], seconds: float = FRAME_TIME) -> FrameMotion:
        """The motion between poses by name, ``seconds`` apart."""
        return FrameMotion(self.bodies, start, end, seconds)

    def between_tensors(self, ends: Mapping[str, Tensor], seconds: float = FRAME_TIME) -> FrameMotion:
        """The motion between poses that may have gradients, in Warp.

        Args:
            ends: by name, (2, 7) float64: position in meters and quaternion w, x, y, z at the start and at the end.
            seconds: between them.
        """
        start, end = (
            {name: Pose.of(*np.split(poses[row].detach().numpy(), [3])) for name, poses in ends.items()}
            for row in (0, 1)
        )
        return FrameMotion(self.bodies, start, end, seconds, dict(ends))

    def of_frame(self, number: int) -> FrameMotion:
        """The motion from frame ``number`` to the next as the scene describes it."""
        start, end = (self.solids.poses(k * FRAME_TIME) for k in (number, number + 1))
        return self.between(start, end)


def no_query(bodies: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (K, N, 3) and distances (K, N) of a last query so close that all query again."""
    return np.zeros((bodies, count, 3), np.float32), np.zeros((bodies, count), np.float32)
