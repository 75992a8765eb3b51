"""What a training run is: the architecture, the data it asks for, the schedule."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from surfsup.errors import InputError
from surfsup.scene.complaints import one_line
from surfsup.scene.text import parse_yaml

Count = Annotated[int, Field(ge=1)]
Share = Annotated[float, Field(ge=0, le=1)]
Amount = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Phase(BaseModel):
    """A part of training with its own kind of step.

    Attributes:
        until: share of all steps at which the phase ends.
        unseen: up to so many frames are rolled out first, without gradient (push-forward).
        unroll: frames that the loss is taken over, with gradient through all of them.
        noise: metres; largest spread of the noise on the first state.
        energy: weight of the energy term.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    until: Share
    unseen: Annotated[int, Field(ge=0)] = 0
    unroll: Count = 1
    noise: Amount = 1e-4
    energy: Amount = 0.0


class TrainingConfig(BaseModel):
    """One training run.

    Attributes:
        width, layers, radius: the architecture's.
        batch: windows a step.
        steps: of the optimiser, over which the schedule runs.
        stop: step to stop at before the schedule ends; None runs it to its end.
        learning_rate, final_learning_rate: of Adam, at the start and, by a cosine, at the end.
        warm_up: steps over which the learning rate rises.
        averaging: decay of the moving average of the weights, which is what is judged and kept.
        judge_every: steps between rollouts on the validation scenes.
        judge_scenes, judge_frames: how many scenes and how far.
        phases: what the steps are like, in order.
        seed: of the initial weights, the windows and the noise.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    width: Count = 32
    layers: Count = 5
    radius: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 0.061
    batch: Count = 2
    steps: Count = 40_000
    stop: Count | None = None
    learning_rate: Amount = 2e-3
    final_learning_rate: Amount = 2e-5
    warm_up: Count = 200
    averaging: Share = 0.999
    judge_every: Count = 4_000
    judge_scenes: Count = 5
    judge_frames: Count = 300
    phases: Annotated[list[Phase], Field(min_length=1)]
    seed: Annotated[int, Field(ge=0)] = 0

    @property
    def last_step(self) -> int:
        """How many steps are done in all."""
        return min(self.steps, self.stop or self.steps)

    def phase(self, step: int) -> Phase:
        """The phase that ``step`` belongs to."""
        for phase in self.phases:
            if step < phase.until * self.steps:
                return phase
        return self.phases[-1]


def load_config(name: str, overrides: list[str] | None = None) -> TrainingConfig:
    """The preset ``name``, or the YAML file of that path, with ``key=value`` overrides applied.

    Raises:
        InputError: no such preset or file, an unknown key, or a value out of range.
    """
    presets = files("surfsup.training") / "presets"
    known = sorted(entry.name.removesuffix(".yaml") for entry in presets.iterdir() if entry.name.endswith(".yaml"))
    path = Path(name)
    if name in known:
        text = (presets / f"{name}.yaml").read_text()
    elif path.is_file():
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not text"
            raise InputError(f"{path}: cannot be read as a configuration: {reason}") from None
    else:
        raise InputError(f"there is no training preset or file '{name}'; presets are {', '.join(known)}")
    data = parse_yaml(text, name) or {}
    if not isinstance(data, dict):
        raise InputError(f"{name}: a configuration is a mapping with at least the key 'phases'")
    for override in overrides or []:
        key, equals, value = override.partition("=")
        if not equals:
            raise InputError(f"'{override}' is not of the form key=value")
        data[key] = parse_yaml(value, override)
    try:
        return TrainingConfig.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{name}: {one_line(error, TrainingConfig)}") from None


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
