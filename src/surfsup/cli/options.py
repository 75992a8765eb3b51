"""The options that several verbs share, each with its type and its line of help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def length(meters: float) -> float:
    """A length that an option gives.

    Raises:
        typer.BadParameter: it is not above zero or not finite.
    """
    if not 0 < meters < float("inf"):
        raise typer.BadParameter(f"{meters} is not a length in meters above 0")
    return meters


Vector = tuple[float, float, float]
Source = Annotated[
    Path,
    typer.Argument(
        metavar="SURFACE|SCENE.yaml", help="A mesh, a neural surface (one's own, or coral, chairs, bowls), a scene."
    ),
]
Out = Annotated[Path | None, typer.Option("-o", "--out", help="Output folder; out/NAME by default.")]
Frames = Annotated[int | None, typer.Option(min=1, help="Frames of 0.005 s; 800 by default.")]
Fit = Annotated[float, typer.Option(help="Largest extent that the mesh is scaled to, in meters.")]
NoFit = Annotated[bool, typer.Option("--no-fit", help="Take the mesh as it is, in meters.")]
Up = Annotated[str | None, typer.Option(help="The mesh's own upward axis, y or z.")]
Turn = Annotated[float, typer.Option(help="Turn the mesh by so many degrees about z.")]
At = Annotated[Vector | None, typer.Option(help="Where the mesh's foot goes, in meters.")]
BlockMin = Annotated[Vector | None, typer.Option(help="Lower corner of the block of water.")]
BlockMax = Annotated[Vector | None, typer.Option(help="Upper corner of the block of water.")]
ShapeName = Annotated[str | None, typer.Option("--shape", help="Which shape of a DeepSDF's file.")]
ContainerSize = Annotated[Vector | None, typer.Option("--container", help="Sides of the container; 1 1 2.")]
NoPage = Annotated[bool, typer.Option("--no-page", help="Leave out page.html.")]
NoVideo = Annotated[bool, typer.Option("--no-video", help="Leave out video.mp4.")]
NoVideos = Annotated[bool, typer.Option("--no-video", help="Leave out the videos of the page.")]
Model = Annotated[str | None, typer.Option(help="A shipped model's name or a .safetensors file.")]
Device = Annotated[str | None, typer.Option(help="cpu or cuda; a GPU is taken where there is one.")]
Workers = Annotated[int | None, typer.Option(help="Simulations side by side on this machine; 2 by default.")]
Scheduler = Annotated[str | None, typer.Option(help="A dask scheduler whose workers do it: tcp://host:port.")]
Near = Annotated[
    float, typer.Option(callback=length, help="Meters; particles nearer to the solid count for Chamfer Surface.")
]
Seed = Annotated[int, typer.Option(min=0, help="Where random choices start.")]
