"""The interface of every simulator: the DFSPH solver and the learned ones."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from itertools import count, islice
from typing import ClassVar, Generic, Protocol, Self, TypeVar

import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.sph.environment import Environment


class FluidState(Protocol):
    """What the states of all simulators have in common: the particles at the end of a frame."""

    @property
    def positions(self) -> Tensor:
        """(N, 3), meters."""
        ...

    @property
    def velocities(self) -> Tensor:
        """(N, 3), m/s."""
        ...


StateType = TypeVar("StateType", bound=FluidState)


class Simulator(ABC, Generic[StateType]):
    """Advances particles frame by frame. Each simulator has its own type of state.

    Attributes:
        history_length: number of frames before the present one that a state holds.
        knows_moving_solids: whether solids and container may move.
        knows_taps: whether the number of particles may change from frame to frame; its state is then positions and
            velocities alone.
        knows_liquids: whether it knows viscosity, surface tension and adhesion.
        measures_forces: whether it computes the forces of the fluid on solids.
    """

    history_length: ClassVar[int]
    knows_moving_solids: ClassVar[bool] = False
    knows_taps: ClassVar[bool] = False
    knows_liquids: ClassVar[bool] = False
    measures_forces: ClassVar[bool] = False

    @abstractmethod
    def initial_state(self, positions: Tensor, velocities: Tensor, environment: Environment) -> StateType:
        """The state of particles at the start of a scene. A history is filled by free fall.

        Args:
            positions: (N, 3), meters.
            velocities: (N, 3), m/s.
            environment: provides gravity.
        """

    @abstractmethod
    def state_from_frames(self, positions: Tensor, velocities: Tensor) -> StateType:
        """The state at the last of consecutive frames of a trajectory.

        Args:
            positions: (history_length + 1, N, 3), meters.
            velocities: (history_length + 1, N, 3), m/s at the ends of the frames.
        """

    @abstractmethod
    def step(
        self, state: StateType, environment: Environment, handle_collisions: bool = True
    ) -> tuple[StateType, Tensor]:
        """The state one frame later, and which particles (N,) collision handling moved."""

    def to(self, device: torch.device | str) -> Self:
        """The simulator on a device. A simulator without weights computes where the state is."""
        return self

    @torch.no_grad()
    def rollout(
        self, state: StateType, environment: Environment, frames: int, handle_collisions: bool = True
    ) -> Iterator[tuple[StateType, Tensor]]:
        """Frame 0 and the frames after it: each state, and which particles (N,) collision handling moved."""
        yield from islice(self._all_frames(state, environment, handle_collisions), frames)

    def _all_frames(
        self, state: StateType, environment: Environment, handle_collisions: bool
    ) -> Iterator[tuple[StateType, Tensor]]:
        yield state, torch.zeros(len(state.positions), dtype=torch.bool, device=state.positions.device)
        self.check_knows(environment)
        for number in count():
            state, collided = self.step(state, environment.at_frame(number), handle_collisions)
            yield state, collided

    def check_knows(self, environment: Environment) -> None:
        """Refuse an environment with moving solids or a liquid that the simulator does not know.

        Raises:
            InputError: it does not know one of them.
        """
        if environment.liquid is not None and not self.knows_liquids:
            raise InputError(
                f"{type(self).__name__} knows no liquid but water as the solver has it; use the simulator dfsph, or "
                "omit 'liquid'"
            )
        if environment.moving is not None and not self.knows_moving_solids:
            raise InputError(f"{type(self).__name__} does not know moving solids; use the simulator dfsph")
