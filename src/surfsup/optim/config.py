"""The options that every optimization has, and ``key=value`` overrides of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from surfsup.errors import InputError
from surfsup.scene.safe_yaml import parse_yaml
from surfsup.scene.validation_error import format_validation_error

Count = Annotated[int, Field(ge=1)]
NonNegativeInt = Annotated[int, Field(ge=0)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Decay = Annotated[float, Field(ge=0, lt=1)]


class OptimizationConfig(BaseModel):
    """The options of every optimization; subclasses add their own.

    Attributes:
        steps: optimizer steps, the length of the learning-rate schedule.
        learning_rate, final_learning_rate: at the end of the warm-up and at the last step.
        schedule: decay between the two, a cosine or an exponential; or the inverse square root of the step, which does
            not depend on ``steps`` and has ``final_learning_rate`` as its lower bound.
        warm_up: steps of the linear rise before the decay.
        clip: the largest gradient norm; a longer gradient is scaled down to it.
        averaging: decay of the moving average of the weights. The averaged weights are validated and kept.
        validate_every: steps between validations.
        seed: seed of the initial weights and of the batches.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    steps: Count
    learning_rate: Positive
    final_learning_rate: NonNegative
    schedule: Literal["cosine", "exponential", "inverse-sqrt"] = "cosine"
    warm_up: NonNegativeInt
    clip: Positive = 1.0
    averaging: Decay
    validate_every: Count
    seed: NonNegativeInt = 0


Config = TypeVar("Config", bound=OptimizationConfig)


def parse_config(kind: type[Config], data: dict[str, Any], source: str) -> Config:
    """The options in ``data``.

    Raises:
        InputError: a key is unknown, or a value is out of range; the message starts with ``source``.
    """
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{source}: {format_validation_error(error, kind)}") from None


def parse_overrides(overrides: Iterable[str]) -> dict[str, Any]:
    """Parse ``key=value`` overrides; each value is YAML.

    Raises:
        InputError: an override is not of that form.
    """
    data = {}
    for override in overrides:
        key, equals, value = override.partition("=")
        if not equals:
            raise InputError(f"'{override}' is not of the form key=value")
        data[key] = parse_yaml(value, override)
    return data
