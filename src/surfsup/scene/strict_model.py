"""The base of everything a scene file describes: unknown keys are refused and values are validated."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from surfsup.errors import InputError
from surfsup.scene.validation_error import format_validation_error

# Single precision resolves particles of 15 mm up to here: at 10 km its numbers are 1 mm apart.
MAX_LENGTH = 1e4  # meters
MAX_SPEED = 1e4  # m/s, also for gravity in m/s²
MAX_COORDINATE = 1e8  # meters, for the place of a mesh in the coordinates of the Earth
Length = Annotated[float, Field(gt=0, le=MAX_LENGTH, allow_inf_nan=False)]
Density = Annotated[float, Field(ge=1, le=1e5, allow_inf_nan=False)]  # kg/m³
Finite = Annotated[float, Field(ge=-1e30, le=1e30, allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]
Position = Annotated[float, Field(ge=-MAX_LENGTH, le=MAX_LENGTH, allow_inf_nan=False)]
PositionVector = tuple[Position, Position, Position]
Speed = Annotated[float, Field(ge=-MAX_SPEED, le=MAX_SPEED, allow_inf_nan=False)]
Velocity = tuple[Speed, Speed, Speed]
Degrees = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Coordinate = Annotated[float, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE, allow_inf_nan=False)]
Place = tuple[Coordinate, Coordinate, Coordinate]
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

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    @for_callers_only
    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            name = type(self).__name__
            raise InputError(f"{name}: {format_validation_error(error, type(self))}") from None
