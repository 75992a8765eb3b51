"""Container, solids and gravity as Warp's kernels take them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import torch
import warp as wp
from torch import Tensor

from surfsup import warp_runtime as runtime
from surfsup.sph.boundary.boundary_map import BoundaryMap
from surfsup.sph.boundary.density import plane_fraction_table
from surfsup.sph.boundary.shape_functions import CELL_NODES, local_coordinates
from surfsup.sph.boundary.walls import wall_cells
from surfsup.sph.environment import Environment
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.warp_engine.kernels.boundary import NO_SOLID, PLANE, VOLUME_MAP, boundary_kernels
from surfsup.warp_runtime import Precision

REACH = np.array([[-KERNEL_SUPPORT], [KERNEL_SUPPORT]], np.float32)  # of a solid, beyond the corners of its box
NO_WALL = 1e6  # meters: corners so far away are no walls


@dataclass(frozen=True)
class Boundary:
    """Container, solids and gravity.

    Attributes:
        solid: how what stands still is given: ``NO_SOLID``, ``PLANE`` or ``VOLUME_MAP``.
        inputs: of ``evaluate_boundary``, from ``lower`` to ``nodes``.
        acceleration: (3,) gravity on the CPU, m/s².
        bodies: of each solid that moves, the inputs of ``add_moving_solid`` from ``lower`` to ``nodes``.
        walls: of a container that moves, the inputs of ``add_moving_walls`` from ``lower`` to ``table``; else None.
    """

    solid: int
    inputs: list[Any]
    acceleration: Tensor
    bodies: list[list[Any]]
    walls: list[Any] | None

    @property
    def walls_alone(self) -> list[Any]:
        """:attr:`inputs` without a solid."""
        return [*self.inputs[:4], NO_SOLID, *self.inputs[5:]]

    @property
    def solid_alone(self) -> list[Any]:
        """:attr:`inputs` without walls."""
        vec3 = type(self.inputs[0])
        return [vec3(-NO_WALL), vec3(NO_WALL), *self.inputs[2:]]

    @property
    def moves(self) -> bool:
        """Whether anything moves."""
        return bool(self.bodies) or self.walls is not None


def boundary_of(environment: Environment, precision: Precision, like: Tensor) -> Boundary:
    """The boundary of an environment, on the device and in the precision of ``like``."""
    device, dtype = like.device, like.dtype
    vec3 = precision.vec3
    lower, upper, acceleration = environment.on_host
    cell = wall_cells(lower, upper)
    corners = [vec3(*value.tolist()) for value in (lower, upper, cell)]
    table, places = tables_on(precision, device, dtype)
    solid = NO_SOLID if environment.surface is None else PLANE
    grid = [boundary_kernels(precision).Map(), places, None, None]
    if environment.boundary_map is not None:
        solid, grid = VOLUME_MAP, map_inputs(environment.boundary_map, precision, device, dtype)
    bodies, walls = [], None
    if environment.moving is not None:
        for body in environment.moving.bodies:
            box = [vec3(*corner.tolist()) for corner in body.box + REACH]
            bodies.append([*box, *map_inputs(body.boundary_map, precision, device, dtype)])
        if environment.moving.solids.container is not None:
            walls, corners = [*corners, table], [vec3(-NO_WALL), vec3(NO_WALL), corners[2]]
    volume_map, *rest = grid
    return Boundary(solid, [*corners, table, solid, volume_map, *rest], acceleration, bodies, walls)


def map_inputs(boundary_map: BoundaryMap, precision: Precision, device: torch.device, dtype: torch.dtype) -> list[Any]:
    """The inputs of kernels that read a volume map: its grid, the places of a cell's nodes, cell indices and nodes."""
    tables, struct = boundary_map.tables, boundary_kernels(precision).Map()
    struct.lower, struct.cell = precision.vec3(*tables.lower.tolist()), precision.vec3(*tables.cell.tolist())
    struct.rotation = precision.mat33(*boundary_map.rotation.ravel().tolist())
    struct.resolution = wp.vec3i(*tables.resolution.tolist())
    *_, indices, values = tables.on(device, dtype)
    places = tables_on(precision, device, dtype)[1]
    return [struct, places, runtime.to_warp(indices, wp.int32), runtime.to_warp(values.flatten(1), precision.real)]


@cache
def tables_on(precision: Precision, device: torch.device, dtype: torch.dtype) -> tuple[Any, Any]:
    """The volume fractions of a plane solid, and the places of a map cell's nodes."""
    places = torch.from_numpy(local_coordinates(CELL_NODES)).to(device, dtype)
    table = torch.from_numpy(plane_fraction_table()).to(device, dtype)
    return runtime.to_warp(table, precision.real), runtime.to_warp(places, precision.vec3)
