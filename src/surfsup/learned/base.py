"""The base of learned simulators: a simulator whose weights are trained."""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

from torch import nn

from surfsup.sph.simulator import Simulator, StateType


class Architecture(Protocol):
    """The sizes that the architectures of all learned simulators have. An architecture is a dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def width(self) -> int:
        """Channels of a particle."""
        ...

    @property
    def layers(self) -> int:
        """Steps of message passing."""
        ...


class LearnedSimulator(nn.Module, Simulator[StateType]):
    """A simulator with weights.

    Attributes:
        kind: name under which the weights are saved.
        architecture_type: dataclass of its sizes, the only argument of its constructor.
        architecture: its sizes.
    """

    kind: ClassVar[str]
    architecture_type: ClassVar[type]

    def __init__(self, architecture: Architecture) -> None:
        super().__init__()
        self.architecture = architecture
