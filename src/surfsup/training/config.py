"""The configuration of a training run: simulator, optimizer, phases."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import fields
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, field_validator, model_validator

from surfsup.errors import InputError, did_you_mean
from surfsup.learned.base import Architecture
from surfsup.learned.message_passing.architecture import SIZES
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.registry import LEARNED_SIMULATORS
from surfsup.optim.config import (
    Count,
    Decay,
    NonNegative,
    NonNegativeInt,
    OptimizationConfig,
    Positive,
    parse_config,
    parse_overrides,
)
from surfsup.scene.safe_yaml import parse_yaml

Share = Annotated[float, Field(ge=0, le=1)]

ARCHITECTURE_KEYS = ("width", "layers", "radius", "surface_particles")


class Phase(BaseModel):
    """A part of training.

    Attributes:
        until: share of all steps at which the phase ends.
        pushforward: largest number of the model's own steps before a loss (push-forward). A rollout continues from loss
            to loss, without gradient between them, until it is that long.
        scene_starts: share of the windows that begin at the start of their scene, as a rollout does; they get no noise.
        noise: largest standard deviation of the noise on the initial state, meters.
        noise_decades: powers of ten by which the noise of a window may be smaller; it is drawn log-uniformly.
        handle_collisions: whether the model's own steps before a loss end with collision handling.
        displaced: share of the windows in which a patch of water begins inside the solid or beyond a wall; only for
            message-passing simulators.
        density: weight of the density term; only message-passing simulators have one.
        small_errors: weight of the term for small errors.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    until: Share
    pushforward: NonNegativeInt = 0
    scene_starts: Share = 0.0
    noise: NonNegative = 1e-4
    noise_decades: NonNegative = 2.0
    handle_collisions: bool = True
    displaced: Share = 0.0
    density: NonNegative = 0.0
    small_errors: NonNegative = 0.0


class TrainingConfig(OptimizationConfig):
    """The configuration of a training run.

    Attributes:
        kind: the kind of simulator; a key of ``surfsup.learned.registry.LEARNED_SIMULATORS``.
        size: 'paper' or 'small', width and layers of a message-passing simulator.
        width, layers, radius, surface_particles: single sizes of the architecture; by default those of ``size``, else
            those of the kind.
        batch: windows a step, over all processes.
        optimizer: Adam, or SOAP, which needs fewer steps and more time for each.
        precision: '32', or 'bf16' for the matrix products of a message-passing network.
        validation_scenes, validation_frames: number and length of the rollouts of a validation.
        validation_collisions: whether these rollouts have collision handling.
        phases: the phases, in order.
    """

    kind: str
    size: Literal["paper", "small"] | None = None
    width: Count | None = None
    layers: Count | None = None
    radius: Positive | None = None
    surface_particles: Count | None = None
    batch: Count = 2
    steps: Count = 40_000
    optimizer: Literal["adam", "soap"] = "adam"
    learning_rate: Positive = 2e-3
    final_learning_rate: NonNegative = 2e-5
    warm_up: NonNegativeInt = 200
    averaging: Decay = 0.999
    precision: Annotated[Literal["32", "bf16"], BeforeValidator(str)] = "32"
    validate_every: Count = 4_000
    validation_scenes: Count = 5
    validation_frames: Count = 300
    validation_collisions: bool = True
    phases: Annotated[list[Phase], Field(min_length=1)]

    @field_validator("kind")
    @classmethod
    def _kind_exists(cls, kind: str) -> str:
        if kind not in LEARNED_SIMULATORS:
            hint = did_you_mean(kind, LEARNED_SIMULATORS)
            raise ValueError(f"there is no kind '{kind}'{hint}; kinds are {', '.join(LEARNED_SIMULATORS)}")
        return kind

    @field_validator("phases")
    @classmethod
    def _phases_are_in_order(cls, phases: list[Phase]) -> list[Phase]:
        ends = [phase.until for phase in phases]
        if any(later <= earlier for earlier, later in pairwise(ends)):
            raise ValueError(f"each 'until' must be above the one before, but they are {ends}")
        return phases

    @model_validator(mode="after")
    def _options_fit_the_kind(self) -> TrainingConfig:
        kind = LEARNED_SIMULATORS[self.kind]
        sizes = {field.name for field in fields(kind.architecture_type)}
        unknown = [name for name in self._given_sizes() if name not in sizes]
        if unknown:
            raise ValueError(f"'{unknown[0]}' is not a size of kind '{self.kind}'; leave it out")
        passes_messages = issubclass(kind, MessagePassingSimulator)
        if not passes_messages:
            if self.size is not None:
                raise ValueError(f"kind '{self.kind}' has no named sizes; give 'width' and 'layers'")
            if self.precision != "32":
                raise ValueError(f"kind '{self.kind}' computes in precision 32 only")
            for name in ("density", "displaced"):
                if any(getattr(phase, name) > 0 for phase in self.phases):
                    raise ValueError(f"'{name}' is not for kind '{self.kind}'; leave it out of the phases")
        _ = self.architecture  # raises ValueError where a size is out of range
        return self

    def _given_sizes(self) -> dict[str, Any]:
        return {name: value for name in ARCHITECTURE_KEYS if (value := getattr(self, name)) is not None}

    @property
    def architecture(self) -> Architecture:
        """The architecture of the simulator."""
        named = {} if self.size is None else SIZES[self.size]
        return LEARNED_SIMULATORS[self.kind].architecture_type(**{**named, **self._given_sizes()})

    def phase(self, step: int) -> Phase:
        """The phase of ``step``."""
        return self.phases[self._phase_number(step)]

    def first_step_of_phase(self, step: int) -> int:
        """The first step of the phase of ``step``."""
        number = self._phase_number(step)
        return math.ceil(self.phases[number - 1].until * self.steps) if number else 0

    def _phase_number(self, step: int) -> int:
        ends = (phase.until * self.steps for phase in self.phases[:-1])
        return sum(step >= end for end in ends)


def load_config(name: str, overrides: Iterable[str] = ()) -> TrainingConfig:
    """Load the preset ``name``, or the YAML file at that path, and apply ``key=value`` overrides.

    Raises:
        InputError: there is no such preset or file, a key is unknown, or a value is out of range.
    """
    return parse_config(TrainingConfig, load_mapping(name) | parse_overrides(overrides), name)


def load_mapping(name: str) -> dict[str, Any]:
    """The keys and values of a preset or YAML file, on top of those of the preset that its key ``like`` names.

    Raises:
        InputError: there is no such preset or file, or it is not a mapping.
    """
    folder = files("surfsup.training") / "presets"
    presets = sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))
    path = Path(name)
    if name in presets:
        text = (folder / f"{name}.yaml").read_text()
    elif path.is_file():
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not text"
            raise InputError(f"{path}: cannot be read as a configuration: {reason}") from None
    else:
        hint = did_you_mean(name, presets)
        raise InputError(f"there is no training preset or file '{name}'{hint}; presets are {', '.join(presets)}")
    data = parse_yaml(text, name) or {}
    if not isinstance(data, dict):
        raise InputError(f"{name}: a configuration is a mapping with at least the keys 'kind' and 'phases'")
    base = data.pop("like", None)
    if base is None:
        return data
    if base not in presets or base == name:
        raise InputError(f"{name}: like: there is no preset '{base}'; presets are {', '.join(presets)}")
    return {**load_mapping(base), **data}
