"""A design task: a parametric shape, a scene, and a reward."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import torch

from surfsup.design.parameter import Parameter, Values
from surfsup.design.reward import Outcome, Reward
from surfsup.design.rollout import last_frame
from surfsup.errors import InputError
from surfsup.scene import SURFACE_CLEARANCE, Scene
from surfsup.sdf import Surface
from surfsup.sph.environment import Environment
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import ParticleState

TOLERANCE = 1e-4  # meters


@dataclass(frozen=True)
class Task:
    """What is designed, and for what.

    Attributes:
        name: for files and titles.
        shape: makes the surface from the values of the parameters, tensors given by name; it is differentiable.
        parameters: by name.
        scene: container, fluid, gravity and the number of frames including the first; its own surface is ignored.
        reward: the objective, to maximize.
        floor: height in meters at which particles land and leave the simulation; None for no floor.
    """

    name: str
    shape: Callable[..., Surface]
    parameters: Mapping[str, Parameter]
    scene: Scene
    reward: Reward
    floor: float | None = None

    def initial_state(self, shift: tuple[float, float] = (0.0, 0.0)) -> ParticleState:
        """The scene's fluid at the start, moved by ``shift`` meters along x and y."""
        start = self.scene.initial_particles(None)
        positions = torch.from_numpy(start.positions) + torch.tensor([*shift, 0.0])
        return ParticleState(positions, torch.from_numpy(start.velocities))

    def surface(self, values: Values, start: ParticleState) -> Surface:
        """The surface with these values.

        Raises:
            InputError: it intersects the fluid at the start or the container.
        """
        surface = self.shape(**values)
        with torch.no_grad():
            lower, upper = surface.bounds().double()
            container = self.scene.container
            corners = torch.tensor([container.lower, container.upper], dtype=torch.float64)
            if bool((lower < corners[0] - TOLERANCE).any() or (upper > corners[1] + TOLERANCE).any()):
                raise InputError(
                    f"{self.name}: the shape leaves the container at {format_values(values)}: it extends from "
                    f"{format_point(lower)} to {format_point(upper)} m, the container from {format_point(corners[0])} "
                    f"to {format_point(corners[1])} m; use narrower bounds or a larger container"
                )
            inside = int((surface.distance(start.positions) < SURFACE_CLEARANCE - TOLERANCE).sum())
        if inside:
            raise InputError(
                f"{self.name}: the shape overlaps the start of {inside} of {len(start.positions)} particles at "
                f"{format_values(values)}; start the water higher or use narrower bounds"
            )
        return surface

    def environment(self, values: Values, start: ParticleState) -> Environment:
        """What acts on the fluid with these values: the solid through distance and normal, as gradients need it.

        Without a volume map, also where no gradient is needed, since rewards of both kinds are compared.

        Raises:
            InputError: the surface intersects the fluid at the start or the container.
        """
        return replace(Environment.of(self.scene, self.surface(values, start)), boundary_map=None)

    def simulate(self, simulator: Simulator[ParticleState], values: Values, start: ParticleState) -> Outcome:
        """The end of the rollout with these values, differentiable with respect to those that require gradients.

        Raises:
            InputError: the surface intersects the fluid at the start or the container.
            SimulationError: the simulation diverged.
        """
        end = last_frame(simulator, self.environment(values, start), start, self.scene.frames - 1, self.floor)
        return Outcome(end.positions, end.landed, values)

    def score(self, outcome: Outcome) -> torch.Tensor:
        """The reward of an outcome, a scalar tensor.

        Raises:
            InputError: the reward is not a scalar tensor, or not finite.
        """
        reward = self.reward(outcome)
        if not isinstance(reward, torch.Tensor) or reward.numel() != 1:
            found = f"a tensor of shape {tuple(reward.shape)}" if isinstance(reward, torch.Tensor) else repr(reward)
            raise InputError(f"{self.name}: the reward is {found}, but must be one number in a tensor")
        if not bool(torch.isfinite(reward.detach()).all()):
            raise InputError(
                f"{self.name}: the reward is {float(reward.detach())} at {format_values(outcome.parameters)}; it must "
                "be finite for every outcome"
            )
        return reward.reshape(())


def format_values(values: Values) -> str:
    """Values on one line: scalars by name, arrays by their size."""
    return ", ".join(
        f"{name} {float(value.detach()):.4g}" if value.ndim == 0 else f"{name} ({value.numel()} numbers)"
        for name, value in values.items()
    )


def format_point(point: torch.Tensor) -> str:
    """A point (3,) in brackets."""
    return "(" + ", ".join(f"{value:.3g}" for value in point.tolist()) + ")"
