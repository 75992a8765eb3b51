"""What the simulator knows of the fluid at the end of a frame, and of all that is around it.

Of the past it knows nothing: the reference solver, started anew from places and velocities, goes on as it would have.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.native.dispatch import tensors_requiring_grad
from surfsup.scene import FRAME_TIME, Scene
from surfsup.sdf import Surface, Transformed
from surfsup.sph.boundary.map_interpolation import SolidMap

SOLVER_STEPS = 5  # of 1 ms in a frame; the solver's semi-implicit Euler steps shape what a frame's data means
STEP_TIME = FRAME_TIME / SOLVER_STEPS


@dataclass(frozen=True)
class ParticleState:
    """The fluid at the end of a frame.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s at the end of the frame, not the frame's mean.
    """

    positions: Tensor
    velocities: Tensor

    def ballistic(self, gravity: Tensor) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) in meters and velocities (N, 3) in m/s one frame later if only ``gravity`` (3,) acts."""
        return (
            self.positions + FRAME_TIME * self.velocities + free_fall_drop(gravity),
            self.velocities + FRAME_TIME * gravity,
        )

    def moved_to(self, positions: Tensor, velocities: Tensor) -> ParticleState:
        """The state one frame later."""
        return ParticleState(positions, velocities)

    def detach(self) -> ParticleState:
        """The same state without its gradients."""
        return replace(self, **{name: value.detach() for name, value in vars(self).items()})


def free_fall_lag(gravity: Tensor) -> Tensor:
    """How far a free fall of one frame stays behind its end velocity times the frame time, meters.

    With n semi-implicit steps of h: end velocity v, displacement n·h·v - (n(n-1)/2)·h²·g.
    """
    return SOLVER_STEPS * (SOLVER_STEPS - 1) / 2 * STEP_TIME**2 * gravity


def free_fall_drop(gravity: Tensor) -> Tensor:
    """What gravity adds to a frame's displacement to the start velocity's share: n(n+1)/2·h²·g, meters."""
    return SOLVER_STEPS * (SOLVER_STEPS + 1) / 2 * STEP_TIME**2 * gravity


@dataclass(frozen=True)
class Environment:
    """All that acts on the fluid from outside, and does not change: where it does, make another.

    Attributes:
        surface: the solid, or None.
        lower, upper: (3,) corners of the container, meters.
        gravity: (3,), m/s².
        boundary_map: the solid as the solver feels it; None where there is none, or where its shape wants a gradient, which
            goes by distance and normal alone.
    """

    surface: Surface | None
    lower: Tensor
    upper: Tensor
    gravity: Tensor
    boundary_map: SolidMap | None = None

    def __getstate__(self) -> dict[str, object]:
        """What makes it up, without what was made for the native code, which can be neither copied nor pickled."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def of(cls, scene: Scene, surface: Surface | None, device: torch.device | str = "cpu") -> Environment:
        """What a scene puts around its fluid."""
        container = scene.container
        return cls(
            None if surface is None else on_device(surface, device),
            torch.tensor(container.lower, device=device),
            torch.tensor(container.upper, device=device),
            torch.tensor(scene.gravity, device=device),
            None if surface is None or tensors_requiring_grad(surface) else SolidMap.of(surface, container),
        )

    def transformed_by(self, matrix: Tensor) -> Environment:
        """The same turned or mirrored by an orthogonal ``matrix`` (3, 3) that maps axes onto axes."""
        corners = torch.stack([matrix @ self.lower, matrix @ self.upper])
        return Environment(
            None if self.surface is None else Transformed(self.surface, matrix).to(matrix.device),
            corners.amin(dim=0),
            corners.amax(dim=0),
            matrix @ self.gravity,
            None if self.boundary_map is None else self.boundary_map.turned(matrix),
        )

    @cached_property
    def as_arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gravity and the corners of the container, (3,) each, for the native code; they share the tensors' memory."""
        return self.gravity.numpy(), self.lower.numpy(), self.upper.numpy()

    def asked(self) -> native.Solid | Callable[..., None] | None:
        """Whom the native code asks for distances: the solid in C++ or, where it has none, :meth:`write_look`."""
        if self.surface is None:
            return None
        # Where there is no map the solid's shape may change from one time to the next.
        return (self.surface.native_solid() if self.boundary_map is None else self.native_solid) or self.write_look

    @cached_property
    def native_solid(self) -> native.Solid | None:
        """The solid in C++, as it was when this was first asked for."""
        return None if self.surface is None else self.surface.native_solid()

    def write_look(self, points: np.ndarray, distance: np.ndarray, normal: np.ndarray | None) -> None:
        """Write distance (N,) and, unless that is None, unit normal (N, 3) of the solid from ``points`` (N, 3)."""
        own = torch.from_numpy(points.copy())  # a surface may keep what it was asked; that memory is used again
        if normal is None:
            distance[:] = self.surface.distance(own).numpy()
        else:
            distance[:], normal[:] = (value.numpy() for value in self.surface.distance_and_normal(own))

    def records_gradients(self) -> bool:
        """Whether any parameter of the solid wants a gradient."""
        return bool(tensors_requiring_grad(self.surface))

    def recording(self) -> list[Tensor]:
        """The parameters of the solid that want a gradient, each once."""
        return tensors_requiring_grad(self.surface)

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) in meters and normal (N, 3) of the solid; infinite where there is none."""
        if self.surface is None:
            return torch.full_like(points[:, 0], torch.inf), torch.zeros_like(points)
        return self.surface.distance_and_normal(points)


def on_device(surface: Surface, device: torch.device | str) -> Surface:
    """The surface there: itself where it must be, to carry gradients, or may be; else a copy.

    To move a surface moves it for all who hold it, and files and maps are made where it was.
    """
    if torch.device(device).type == "cpu" or tensors_requiring_grad(surface):
        return surface.to(device)
    return deepcopy(surface).to(device)
