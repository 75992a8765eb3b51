"""The options that several verbs share, each with its type and its line of help."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from surfsup.optim.stopping import Stop


def positive_length(meters: float) -> float:
    """Check the length of an option in meters.

    Raises:
        typer.BadParameter: it is not above zero or not finite.
    """
    if not 0 < meters < float("inf"):
        raise typer.BadParameter(f"{meters} is not a length in meters above 0")
    return meters


def stop_after(time_limit: str) -> Stop:
    """A stop condition for the value of ``--time``, which is empty for no limit.

    Raises:
        InputError: the value is not a duration.
    """
    from surfsup.optim.stopping import Stop, parse_duration

    return Stop(parse_duration(time_limit) if time_limit else float("inf"))


def split_vectors(arguments: list[str]) -> list[str]:
    """Arguments in which a vector of three numbers may be one word: ``--at 0,0,1`` becomes ``--at 0 0 1``."""
    words: list[str] = []
    for argument in arguments:
        option, _, value = argument.partition("=")
        if option in VECTOR_OPTIONS and value:
            words += [option, *value.split(",")]
        elif words and words[-1] in VECTOR_OPTIONS:
            words += argument.split(",")
        else:
            words.append(argument)
    return words


Vector = tuple[float, float, float]
VECTOR_OPTIONS = ("--at", "--block-min", "--block-max", "--container")
SimulatorName = Annotated[
    str, typer.Option("--simulator", help="Name of a simulator (dfsph, surfsup, gns, ...) or a weights file.")
]
NoCollisions = Annotated[bool, typer.Option("--no-collisions", help="Turn collision handling off.")]
NoVideos = Annotated[bool, typer.Option("--no-video", help="Omit the videos.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON, for programs.")]
Device = Annotated[str | None, typer.Option(help="cpu or cuda; by default a GPU if there is one.")]
Workers = Annotated[int | None, typer.Option(help="Parallel simulations on this machine; 2 by default.")]
Scheduler = Annotated[
    str | None, typer.Option(help="Address of a dask scheduler with its own workers: tcp://host:port.")
]
Near = Annotated[
    float | None,
    typer.Option(
        callback=lambda value: None if value is None else positive_length(value),
        help="Meters; particles closer to the solid count for Chamfer Surface. Six particle radii by default.",
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of all random numbers.")]
TimeLimit = Annotated[str, typer.Option("--time", help="Stop after this time: 90s, 30m, 2h.")]
Resume = Annotated[bool, typer.Option("--resume", help="Resume from the checkpoint.")]
Threads = Annotated[int, typer.Option(min=1, help="Threads of torch.")]
Overrides = Annotated[
    list[str] | None, typer.Argument(metavar="key=value", help="Values that replace those of the configuration.")
]
SurfaceFile = Annotated[Path, typer.Option("-o", "--out", help="The new file of the surface, .safetensors.")]
UpAxis = Annotated[Literal["y", "z"] | None, typer.Option(help="Upward axis of the mesh file.")]
