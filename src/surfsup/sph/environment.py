"""Everything that acts on the particles from outside: solid, container, gravity."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.errors import InputError
from surfsup.native.dispatch import tensors_requiring_grad
from surfsup.scene import Scene
from surfsup.scene.flush import with_flush_solids
from surfsup.scene.solids import Solids, build_solids
from surfsup.sdf import Surface, Transformed
from surfsup.sph.boundary.boundary_map import BoundaryMap
from surfsup.sph.collision_surface import for_collisions
from surfsup.sph.impulses import Impulses
from surfsup.sph.liquid import LiquidForces, Mixture
from surfsup.sph.moving import FrameMotion, MovingSolids
from surfsup.sph.state import MixtureState, ParticleState


class HostVectors(NamedTuple):
    """Corners of the container (3,) in meters and gravity (3,) in m/s²."""

    lower: Tensor
    upper: Tensor
    gravity: Tensor


@dataclass(frozen=True)
class Environment:
    """Solid, container and gravity. They are constant; if one changes, make a new environment.

    Attributes:
        surface: the solid that stands still, or None; with the true distance beside edges of parts that are cut off.
        lower, upper: (3,) corners of the container, meters.
        gravity: (3,), m/s².
        boundary_map: the solid's volume map. None without a solid, and for solids whose shape requires a gradient:
            these act through distance and normal alone.
        moving: what moves, or None.
        motion: its poses before and after the next frame, see :meth:`at_frame`.
        unmoved: the same without that motion and those impulses; None without either.
        solids: all solids; None where forces on them are never requested.
        impulses: of the next frame, to which the solver adds; None where they are not requested.
        liquid: what flows, or None for the solver's own water. Particles of a mixture are a :class:`MixtureState`.
        supplied_energy: that taps have brought into the fluid and the next frame may release, mean J/kg.
    """

    surface: Surface | None
    lower: Tensor
    upper: Tensor
    gravity: Tensor
    boundary_map: BoundaryMap | None = None
    moving: MovingSolids | None = None
    motion: FrameMotion | None = None
    unmoved: Environment | None = None
    solids: Solids | None = None
    impulses: Impulses | None = None
    supplied_energy: float = 0.0
    liquid: LiquidForces | Mixture | None = None

    def __getstate__(self) -> dict[str, object]:
        """The fields alone: cached native objects can be neither copied nor pickled."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def of(
        cls,
        scene: Scene,
        surface: Surface | None,
        device: torch.device | str = "cpu",
        solids: Solids | None = None,
    ) -> Environment:
        """The environment of a scene in the units of the simulators (:class:`surfsup.scene.Units`).

        Args:
            scene: the scene, converted (:meth:`surfsup.scene.Units.scene_to_solver`).
            surface: what stands still in it.
            device: of the tensors.
            solids: all solids, if they were built before.

        Raises:
            InputError: a flush solid is too thin.
        """
        assert scene.units.same, "convert the scene first"
        container = scene.container
        if solids is None and scene.moves:
            solids = build_solids(scene)
        if solids is not None and (fitted := with_flush_solids(solids)) is not solids:
            solids, surface = fitted, fitted.still
        return cls(
            None if surface is None else surface_on(for_collisions(surface), device),
            torch.tensor(container.lower, device=device),
            torch.tensor(container.upper, device=device),
            torch.tensor(scene.gravity, device=device),
            None if surface is None or tensors_requiring_grad(surface) else BoundaryMap.of(surface, container),
            MovingSolids(solids) if solids is not None and solids.move else None,
            solids=solids,
            liquid=LiquidForces.of_scene(scene),
        )

    def moved(self, motion: FrameMotion) -> Environment:
        """The same, for a frame with ``motion``."""
        return replace(self, motion=motion, unmoved=self.base)

    def measured(self) -> Environment:
        """The same, for a frame whose impulses on the solids are requested."""
        assert self.solids is not None, "the environment was made without its solids"
        return replace(self, impulses=Impulses(self.solids), unmoved=self.base)

    def supplied(self, energy: float) -> Environment:
        """The same, for a frame that may release an ``energy`` that taps have brought, mean J/kg."""
        return replace(self, supplied_energy=energy, unmoved=self.base)

    @property
    def base(self) -> Environment:
        """The environment of the scene, one object for all its frames."""
        return self.unmoved or self

    def at_frame(self, number: int) -> Environment:
        """The same for the step from frame ``number`` to the next, as the scene describes the motion.

        Raises:
            InputError: a rigid body moves, of which the scene describes the start alone.
        """
        if self.moving is not None:
            self.moving.solids.require_described()
        return self if self.moving is None else self.moved(self.moving.of_frame(number))

    def transformed_by(self, matrix: Tensor) -> Environment:
        """The same, rotated or mirrored by an orthogonal ``matrix`` (3, 3) that maps axes onto axes.

        Raises:
            InputError: something moves.
        """
        if self.moving is not None:
            raise InputError("a scene with moving solids has no mirrored copies")
        corners = torch.stack([matrix @ self.lower, matrix @ self.upper])
        return Environment(
            None if self.surface is None else Transformed(self.surface, matrix).to(matrix.device),
            corners.amin(dim=0),
            corners.amax(dim=0),
            matrix @ self.gravity,
            None if self.boundary_map is None else self.boundary_map.rotated(matrix),
            liquid=self.liquid,
        )

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) in meters and normal (N, 3) of the solid; infinite and zero without one."""
        if self.surface is None:
            return torch.full_like(points[:, 0], torch.inf), torch.zeros_like(points)
        return self.surface.distance_and_normal(points)

    @cached_property
    def on_host(self) -> HostVectors:
        """Container and gravity on the CPU, for kernels that take them by value."""
        return HostVectors(*(vector.detach().cpu() for vector in (self.lower, self.upper, self.gravity)))

    def masses_of(self, state: ParticleState) -> np.ndarray | None:
        """The masses (N,) float32 of the particles of a mixture, in units of one of the scene's density; else None.

        Raises:
            InputError: the state does not say which liquid each particle is.
        """
        if not isinstance(self.liquid, Mixture):
            return None
        if not isinstance(state, MixtureState):
            raise InputError("the scene has several liquids, which this use of the solver does not know")
        return self.liquid.masses_of(state.liquids)

    @property
    def requires_grad(self) -> bool:
        """Whether any tensor of the solid requires a gradient."""
        return bool(tensors_requiring_grad(self.surface))

    @cached_property
    def native_solid(self) -> native.Solid | None:
        """The solid in C++ with its parameters of the first call; None for kinds without C++ code."""
        return None if self.surface is None else self.surface.native_solid()


def surface_on(surface: Surface, device: torch.device | str) -> Surface:
    """The surface on a device: a copy, unless it is there already or carries gradients.

    Moving a surface in place would move it for all its users; files and maps are made where it was.
    """
    if torch.device(device).type == "cpu" or tensors_requiring_grad(surface):
        return surface.to(device)
    return deepcopy(surface).to(device)
