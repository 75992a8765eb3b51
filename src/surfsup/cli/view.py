"""`surfsup view` and `surfsup render`: page, video and pictures of a trajectory."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup.cli.progress import progress_bar

if TYPE_CHECKING:
    from surfsup.viewing.camera import ViewDirection

TrajectoryFile = Annotated[Path, typer.Argument(metavar="TRAJECTORY", help="A trajectory.h5.")]


def view(trajectory: TrajectoryFile) -> None:
    """Write the page of a trajectory.

    The page is written next to the trajectory.

    Example: surfsup view out/bunny/trajectory.h5
    """
    from surfsup.viewing.trajectory_pictures import write_trajectory_page

    with progress_bar("writing the page") as bar:
        page = write_trajectory_page(trajectory, trajectory.with_name("page.html"), bar)
    typer.echo(f"open {page} in a browser")


def parse_size(text: str) -> tuple[int, int]:
    """Width and height of a value such as 1280x720.

    Raises:
        typer.BadParameter: it is something else.
    """
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if match is None:
        raise typer.BadParameter(f"'{text}' is no size in pixels such as 1280x720", param_hint="--size")
    return int(match[1]), int(match[2])


def parse_direction(text: str) -> ViewDirection:
    """The direction of a value such as 30,20 or 30,20,1.5.

    Raises:
        typer.BadParameter: it is something else.
        InputError: a number is out of range.
    """
    from surfsup.viewing.camera import ViewDirection

    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3):
        raise typer.BadParameter(
            f"'{text}' is no direction: azimuth and elevation in degrees, and perhaps a zoom, such as -60,22,1.5",
            param_hint="--camera",
        )
    return ViewDirection(*numbers)


def render(
    trajectory: TrajectoryFile,
    frame: Annotated[int | None, typer.Option(min=0, help="Render a picture of this frame instead.")] = None,
    fps: Annotated[float | None, typer.Option(help="Pictures per second, in real time; 25 by default.")] = None,
    every: Annotated[int | None, typer.Option(min=1, help="Show every n-th frame; 1 is slow motion.")] = None,
    size: Annotated[str, typer.Option(metavar="WIDTHxHEIGHT", help="Pixels.")] = "960x720",
    camera: Annotated[
        str, typer.Option(metavar="AZIMUTH,ELEVATION[,ZOOM]", help="Degrees; -90,5 looks from the front.")
    ] = "-59.83,21.91",
    turntable: Annotated[bool, typer.Option("--turntable", help="The camera goes around once.")] = False,
) -> None:
    """Render the video of a trajectory.

    With --frame it renders a picture of one frame. Both are written next to the trajectory.

    Example: surfsup render out/bunny/trajectory.h5 --fps 60 --size 1280x720 --turntable
    """
    from surfsup.viewing.graphics import require_graphics
    from surfsup.viewing.trajectory_pictures import write_frame_picture, write_trajectory_video
    from surfsup.viewing.video_settings import VideoSettings

    settings = VideoSettings(parse_size(size), fps, every, parse_direction(camera), turntable)
    require_graphics()
    if frame is not None:
        picture = trajectory.with_name(f"frame-{frame:05d}.png")
        output = write_frame_picture(trajectory, picture, frame, settings)
    else:
        with progress_bar("rendering the video") as bar:
            output = write_trajectory_video(trajectory, trajectory.with_name("video.mp4"), bar, settings)
    typer.echo(f"written to {output}")
