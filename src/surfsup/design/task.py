"""A design task: a shape with parameters, the scene that it stands in, and what is asked of the water."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch

from surfsup.design.parameter import Parameter, Values
from surfsup.design.reward import Outcome, Reward
from surfsup.design.rollout import Water, last_frame
from surfsup.errors import InputError
from surfsup.learned.corrected.simulator import CorrectedSimulator
from surfsup.scene import SURFACE_CLEARANCE, Scene
from surfsup.sdf import Surface
from surfsup.sph.state import Environment


@dataclass(frozen=True)
class Task:
    """What is to be designed.

    Attributes:
        name: of the task, for files and titles.
        shape: the solid of given parameters, each a tensor by its name; gradients flow through it.
        parameters: what may change, by name.
        scene: container, water, gravity and the number of frames, the start among them; its own surface is ignored.
        reward: what is to grow.
        floor: height in meters at which particles leave the simulation; None keeps all.
        smoothing: meters by which the water's start is moved aside at random in each iteration, unless the run says
            otherwise: it smooths a reward that is rough.
    """

    name: str
    shape: Callable[..., Surface]
    parameters: Mapping[str, Parameter]
    scene: Scene
    reward: Reward
    floor: float | None = None
    smoothing: float = 0.0

    def water(self, shift: tuple[float, float] = (0.0, 0.0)) -> Water:
        """The scene's fluid as it starts, moved by ``shift`` meters along x and y."""
        start = self.scene.start(None)
        offset = torch.tensor([*shift, 0.0])
        positions = torch.from_numpy(start.positions) + offset
        return Water(positions, torch.from_numpy(start.particle_velocities), floor=self.floor)

    def surface(self, values: Values, water: Water) -> Surface:
        """The solid of these values.

        Raises:
            InputError: it reaches into the water's start or out of the container.
        """
        surface = self.shape(**values)
        with torch.no_grad():
            lower, upper = surface.bounds().double()
            container = self.scene.container
            room = torch.tensor([container.lower, container.upper], dtype=torch.float64)
            if bool((lower < room[0] - TOLERANCE).any() or (upper > room[1] + TOLERANCE).any()):
                raise InputError(
                    f"{self.name}: the shape reaches out of the container at {told(values)}: it needs "
                    f"{corner(lower)} to {corner(upper)} m, the container is {corner(room[0])} to {corner(room[1])} m; "
                    "give narrower ranges or a larger container"
                )
            inside = int((surface.distance(water.positions) < SURFACE_CLEARANCE - TOLERANCE).sum())
        if inside:
            raise InputError(
                f"{self.name}: the shape swallows the start of {inside} of {len(water.positions)} particles at "
                f"{told(values)}; start the water higher or give narrower ranges"
            )
        return surface

    def simulate(self, simulator: CorrectedSimulator, values: Values, water: Water) -> Outcome:
        """The water's end in the solid of these values, differentiable in those that record gradients.

        Raises:
            InputError: the solid is in the water's way or out of the container.
            SimulationError: the simulation blew up.
        """
        environment = Environment.of(self.scene, self.surface(values, water))
        end = last_frame(simulator, environment, water, self.scene.frames - 1)
        return Outcome(end.positions, end.landed, values)

    def score(self, outcome: Outcome) -> torch.Tensor:
        """The reward of an outcome, a tensor of no dimension.

        Raises:
            InputError: it is no number, or not finite.
        """
        reward = self.reward(outcome)
        if not isinstance(reward, torch.Tensor) or reward.numel() != 1:
            found = f"a tensor of shape {tuple(reward.shape)}" if isinstance(reward, torch.Tensor) else repr(reward)
            raise InputError(f"{self.name}: the reward is {found}, but must be one number in a tensor")
        if not bool(torch.isfinite(reward.detach()).all()):
            raise InputError(
                f"{self.name}: the reward is {float(reward.detach())} at {told(outcome.parameters)}; it must be a "
                "finite number of every outcome"
            )
        return reward.reshape(())


TOLERANCE = 1e-4  # meters


def told(values: Values) -> str:
    """Values as one line: single numbers by name, arrays by their size."""
    return ", ".join(
        f"{name} {float(value.detach()):.4g}" if value.ndim == 0 else f"{name} ({value.numel()} numbers)"
        for name, value in values.items()
    )


def corner(place: torch.Tensor) -> str:
    """A place in meters, in brackets."""
    return "(" + ", ".join(f"{value:.3g}" for value in place.tolist()) + ")"
