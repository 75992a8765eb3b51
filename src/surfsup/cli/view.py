"""`surfsup view` and `surfsup render`: page, video and pictures of a trajectory."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup.cli.progress import progress_bar
from surfsup.io.trajectory_path import existing_trajectory

if TYPE_CHECKING:
    from surfsup.viewing.camera import ViewDirection


TrajectoryFile = Annotated[
    Path,
    typer.Argument(metavar="TRAJECTORY", help="A trajectory.h5, or the folder with one.", callback=existing_trajectory),
]


def output_file(out: Path | None, beside: Path, name: str) -> Path:
    """The file to write: ``out``, or the one called ``name`` next to the trajectory ``beside``.

    Raises:
        typer.BadParameter: ``out`` is of another format, or its folder does not exist.
    """
    file = out or beside.with_name(name)
    suffix = Path(name).suffix
    if file.suffix.lower() != suffix:
        picture = "; --frame writes a .png" if suffix == ".mp4" else ""
        raise typer.BadParameter(f"'{file}' does not end in {suffix}{picture}", param_hint="--out")
    if not file.absolute().parent.is_dir():
        raise typer.BadParameter(f"'{file}': there is no folder {file.parent}", param_hint="--out")
    return file


def view(
    trajectory: TrajectoryFile,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="The page; page.html next to the trajectory by default.")
    ] = None,
) -> None:
    """Write the page of a trajectory.

    Example: surfsup view out/bunny
    """
    from surfsup.viewing.trajectory_page import write_trajectory_page

    file = output_file(out, trajectory, "page.html")
    with progress_bar("writing the page") as bar:
        page = write_trajectory_page(trajectory, file, bar)
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
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="An .mp4, or a .png with --frame; next to the trajectory by default."),
    ] = None,
) -> None:
    """Render the video of a trajectory.

    With --frame it renders a picture of one frame.

    Example: surfsup render out/bunny --fps 60 --size 1280x720 --turntable
    """
    from surfsup.viewing.graphics import require_graphics
    from surfsup.viewing.trajectory_pictures import write_frame_picture, write_trajectory_video
    from surfsup.viewing.video_settings import VideoSettings

    settings = VideoSettings(parse_size(size), fps, every, parse_direction(camera), turntable)
    file = output_file(out, trajectory, "video.mp4" if frame is None else f"frame-{frame:05d}.png")
    require_graphics()
    if frame is not None:
        output = write_frame_picture(trajectory, file, frame, settings)
    else:
        with progress_bar("rendering the video") as bar:
            output = write_trajectory_video(trajectory, file, bar, settings)
    typer.echo(f"written to {output}")
