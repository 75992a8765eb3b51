"""The base of everything a scene file describes: unknown keys are refused and values are validated."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from surfsup.errors import InputError
from surfsup.scene.validation_error import format_validation_error

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]
Initializer = TypeVar("Initializer", bound=Callable[..., None])


def for_callers_only(initializer: Initializer) -> Initializer:
    """Mark an ``__init__`` that pydantic does not call when it validates a file.

    It then reports an unknown or missing key by its place. Pydantic's RootModel uses the same mark.
    """
    setattr(initializer, "__pydantic_base_init__", True)  # noqa: B010  functions have no such attribute to a type checker
    return initializer


class StrictModel(BaseModel):
    """A part of a scene file, or of a scene built in Python.

    Raises:
        InputError: a key is unknown or missing, or a value is out of range; one line that names the place.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    @for_callers_only
    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            name = type(self).__name__
            raise InputError(f"{name}: {format_validation_error(error, type(self))}") from None
