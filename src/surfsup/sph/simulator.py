"""The one interface of every learned simulator: a start, a step, a rollout."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from itertools import islice
from typing import ClassVar, Generic, Protocol, TypeVar

import torch
from torch import Tensor, nn

from surfsup.sph.state import Environment


class Sizes(Protocol):
    """What every simulator's architecture, a dataclass, has."""

    @property
    def width(self) -> int:
        """Channels of every particle."""

    @property
    def layers(self) -> int:
        """Steps of message passing."""

    @property
    def radius(self) -> float:
        """Connectivity radius in meters."""


class FluidState(Protocol):
    """What every simulator's state tells of the fluid at the end of a frame."""

    @property
    def positions(self) -> Tensor:
        """(N, 3), meters."""

    @property
    def velocities(self) -> Tensor:
        """(N, 3), m/s."""


StateType = TypeVar("StateType", bound=FluidState)


class Simulator(nn.Module, ABC, Generic[StateType]):
    """Moves fluid particles frame by frame; what it needs to remember of the fluid is its own kind of state.

    Attributes:
        kind: the name under which its weights are saved.
        architecture_type: the dataclass of its sizes; it is made from one of these.
        architecture: its sizes.
    """

    kind: ClassVar[str]
    architecture_type: ClassVar[type]

    def __init__(self, architecture: Sizes) -> None:
        super().__init__()
        self.architecture = architecture

    @property
    @abstractmethod
    def past(self) -> int:
        """How many frames before the present one a state tells of."""

    @abstractmethod
    def start(self, positions: Tensor, velocities: Tensor, environment: Environment) -> StateType:
        """The state of particles (N, 3) at the start of a scene, whose unseen past, where it matters, was a free fall.

        Args:
            positions: (N, 3), meters.
            velocities: (N, 3), m/s.
            environment: gives gravity.
        """

    @abstractmethod
    def state_after(self, positions: Tensor, velocities: Tensor) -> StateType:
        """The state at the last of consecutive true frames.

        Args:
            positions: (past + 1, N, 3), meters.
            velocities: (past + 1, N, 3), m/s at the ends of the frames.
        """

    @abstractmethod
    def step(
        self, state: StateType, environment: Environment, handle_collisions: bool = True
    ) -> tuple[StateType, Tensor]:
        """The state one step later, and which particles (N,) the guard had to move."""

    def between(
        self, before: StateType, after: StateType, environment: Environment, handle_collisions: bool
    ) -> Iterator[tuple[StateType, Tensor]]:
        """The frames that a step passes over; none where a step is a frame."""
        return iter(())

    @torch.no_grad()
    def rollout(
        self, state: StateType, environment: Environment, frames: int, handle_collisions: bool = True
    ) -> Iterator[tuple[StateType, Tensor]]:
        """Frame 0 and the frames after it, one at a time: each state and which particles were guarded."""
        yield from islice(self._every_frame(state, environment, handle_collisions), frames)

    def _every_frame(
        self, state: StateType, environment: Environment, handle_collisions: bool
    ) -> Iterator[tuple[StateType, Tensor]]:
        yield state, torch.zeros(len(state.positions), dtype=torch.bool, device=state.positions.device)
        while True:
            before = state
            state, moved = self.step(before, environment, handle_collisions)
            yield from self.between(before, state, environment, handle_collisions)
            yield state, moved
