"""What a training run is: the model, the steps it takes, the schedule."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, field_validator, model_validator

from surfsup.errors import InputError
from surfsup.learned.message_passing.architecture import SIZES
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.registry import KINDS
from surfsup.scene.validation_message import one_line
from surfsup.scene.yaml_text import parse_yaml
from surfsup.sph.simulator import Sizes

Count = Annotated[int, Field(ge=1)]
Share = Annotated[float, Field(ge=0, le=1)]
Amount = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Above = Annotated[float, Field(gt=0, allow_inf_nan=False)]

ARCHITECTURE = (
    "width",
    "layers",
    "radius",
    "messages",
    "history",
    "stride",
    "surface_particles",
)  # what may be a kind's sizes


class Phase(BaseModel):
    """A part of training with its own kind of step.

    Attributes:
        until: share of all steps at which the phase ends.
        unseen: after up to how many of the model's own steps a loss is taken (push-forward): rollouts go on from loss
            to loss until they have gone so far, without gradient from one to the next.
        unroll: steps that the loss is taken over, with gradient through all of them.
        starts: share of the windows that begin where their scene does, as every rollout; these get no noise.
        noise: meters; largest spread of the noise on the first state.
        density: weight of the density term; the convolution has none.
        calm: weight of the term on small errors; only the convolution has one.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    until: Share
    unseen: Annotated[int, Field(ge=0)] = 0
    unroll: Count = 1
    starts: Share = 0.0
    noise: Amount = 1e-4
    density: Amount = 0.0
    calm: Amount = 0.0


class TrainingConfig(BaseModel):
    """One training run.

    Attributes:
        kind: of simulator; one of ``surfsup.learned.registry.KINDS``.
        size: width and layers by name, 'paper' or 'small'; only the message-passing kinds have such.
        width, layers, radius, messages, history, stride, surface_particles: the architecture's; what is left out is as
            ``size`` says, else the kind's own default.
        batch: windows a step, over all processes.
        steps: of the optimizer, over which the schedule runs.
        stop: step to stop at before the schedule ends; None runs it to its end.
        optimizer: Adam, or SOAP, which costs more a step and needs fewer.
        learning_rate, final_learning_rate: of the optimizer, at the start and at the end.
        schedule: from one to the other by a cosine, or exponentially as the paper has it.
        warm_up: steps over which the learning rate rises.
        clip: the largest norm of the gradient; a longer one is shortened.
        averaging: decay of the moving average of the weights, which is what is judged and kept.
        precision: '32', or 'bf16' for the message-passing networks' large products.
        judge_every: steps between rollouts on the validation scenes.
        judge_scenes, judge_frames: how many scenes and how far.
        phases: what the steps are like, in order.
        seed: of the initial weights, the windows and the noise.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: str = "convolution"
    size: Literal["paper", "small"] | None = None
    width: Count | None = None
    layers: Count | None = None
    radius: Above | None = None
    messages: Count | None = None
    history: Count | None = None
    stride: Count | None = None
    surface_particles: Count | None = None
    batch: Count = 2
    steps: Count = 40_000
    stop: Count | None = None
    optimizer: Literal["adam", "soap"] = "adam"
    learning_rate: Above = 2e-3
    final_learning_rate: Amount = 2e-5
    schedule: Literal["cosine", "exponential"] = "cosine"
    warm_up: Annotated[int, Field(ge=0)] = 200
    clip: Above = 1.0
    averaging: Share = 0.999
    precision: Annotated[Literal["32", "bf16"], BeforeValidator(str)] = "32"
    judge_every: Count = 4_000
    judge_scenes: Count = 5
    judge_frames: Count = 300
    phases: Annotated[list[Phase], Field(min_length=1)]
    seed: Annotated[int, Field(ge=0)] = 0

    @field_validator("kind")
    @classmethod
    def _is_known(cls, kind: str) -> str:
        if kind not in KINDS:
            raise ValueError(f"there is no kind '{kind}'{nearest(kind, KINDS)}; kinds are {', '.join(KINDS)}")
        return kind

    @field_validator("phases")
    @classmethod
    def _rises(cls, phases: list[Phase]) -> list[Phase]:
        ends = [phase.until for phase in phases]
        if any(later <= earlier for earlier, later in pairwise(ends)):
            raise ValueError(f"each 'until' must be above the one before, but they are {ends}")
        return phases

    @model_validator(mode="after")
    def _fits_its_kind(self) -> TrainingConfig:
        kind = KINDS[self.kind]
        given = [name for name in ARCHITECTURE if getattr(self, name) is not None]
        strange = [name for name in given if name not in kind.architecture_type.__dataclass_fields__]
        if strange:
            raise ValueError(f"'{strange[0]}' is no size of kind '{self.kind}'; leave it out")
        passes_messages = issubclass(kind, MessagePassingSimulator)
        if not passes_messages:
            if self.size is not None:
                raise ValueError(f"kind '{self.kind}' has no sizes by name; give 'width' and 'layers'")
            if self.precision != "32":
                raise ValueError(f"kind '{self.kind}' computes in precision 32 only")
        missing = "calm" if passes_messages else "density"
        if any(getattr(phase, missing) > 0 for phase in self.phases):
            raise ValueError(f"kind '{self.kind}' has no {missing} term; leave '{missing}' out of the phases")
        _ = self.architecture
        return self

    @property
    def architecture(self) -> Sizes:
        """The sizes of the model."""
        given = {name: value for name in ARCHITECTURE if (value := getattr(self, name)) is not None}
        named = {} if self.size is None else SIZES[self.size]
        return KINDS[self.kind].architecture_type(**{**named, **given})

    @property
    def last_step(self) -> int:
        """How many steps are done in all."""
        return min(self.steps, self.stop or self.steps)

    def phase(self, step: int) -> Phase:
        """The phase that ``step`` belongs to."""
        return self.phases[self._number_of_phase(step)]

    def first_step(self, step: int) -> int:
        """The first step of the phase that ``step`` belongs to."""
        number = self._number_of_phase(step)
        return math.ceil(self.phases[number - 1].until * self.steps) if number else 0

    def _number_of_phase(self, step: int) -> int:
        ends = (phase.until * self.steps for phase in self.phases[:-1])
        return sum(step >= end for end in ends)


def load_config(name: str, overrides: list[str] | None = None) -> TrainingConfig:
    """The preset ``name``, or the YAML file of that path, with ``key=value`` overrides applied.

    Raises:
        InputError: no such preset or file, an unknown key, or a value out of range.
    """
    data = mapping_of(name) | values_of(overrides or [])
    try:
        return TrainingConfig.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{name}: {one_line(error, TrainingConfig)}") from None


def values_of(overrides: Iterable[str]) -> dict[str, Any]:
    """The keys and values of ``key=value`` overrides, each value read as YAML.

    Raises:
        InputError: one is not of that form.
    """
    data = {}
    for override in overrides:
        key, equals, value = override.partition("=")
        if not equals:
            raise InputError(f"'{override}' is not of the form key=value")
        data[key] = parse_yaml(value, override)
    return data


def mapping_of(name: str) -> dict[str, Any]:
    """The keys and values of a preset or file, on top of those of the preset that its key ``like`` names.

    Raises:
        InputError: no such preset or file, or it is no mapping.
    """
    folder = files("surfsup.training") / "presets"
    known = sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))
    path = Path(name)
    if name in known:
        text = (folder / f"{name}.yaml").read_text()
    elif path.is_file():
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not text"
            raise InputError(f"{path}: cannot be read as a configuration: {reason}") from None
    else:
        hint = nearest(name, known)
        raise InputError(f"there is no training preset or file '{name}'{hint}; presets are {', '.join(known)}")
    data = parse_yaml(text, name) or {}
    if not isinstance(data, dict):
        raise InputError(f"{name}: a configuration is a mapping with at least the key 'phases'")
    base = data.pop("like", None)
    if base is None:
        return data
    if base not in known or base == name:
        raise InputError(f"{name}: like: there is no preset '{base}'; presets are {', '.join(known)}")
    return {**mapping_of(base), **data}


def nearest(name: str, known: Iterable[str]) -> str:
    """A question to put after the name that may have been meant, empty where none is near."""
    near = difflib.get_close_matches(name, list(known), n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def seconds_of(text: str) -> float:
    """A length of time such as ``90s``, ``30m`` or ``1.5h`` in seconds.

    Raises:
        InputError: it is not of that form, or not above zero.
    """
    units = {"s": 1, "m": 60, "h": 3600}
    try:
        seconds = float(text[:-1]) * units[text[-1]]
    except (KeyError, ValueError, IndexError):
        seconds = 0.0
    if not 0 < seconds < float("inf"):
        raise InputError(f"'{text}' is not a length of time; write for example 90s, 30m or 1.5h")
    return seconds
