"""`surfsup view` and `surfsup render`: the page, the video and pictures of a trajectory."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.progress import bar


def view(trajectory: Annotated[Path, typer.Argument(help="A trajectory.h5.")]) -> None:
    """Write the page of a trajectory beside it.

    Example: surfsup view out/bunny/trajectory.h5
    """
    from surfsup.viewing.trajectory_pictures import write_page_of

    with bar("writing the page") as tell:
        page = write_page_of(trajectory, trajectory.with_name("page.html"), tell)
    typer.echo(f"open {page} in a browser")


def render(
    trajectory: Annotated[Path, typer.Argument(help="A trajectory.h5.")],
    frame: Annotated[int | None, typer.Option(min=0, help="One picture of this frame instead.")] = None,
) -> None:
    """Write the video of a trajectory beside it, or a picture of one frame.

    Example: surfsup render out/bunny/trajectory.h5 --frame 120
    """
    from surfsup.viewing.graphics import require_graphics
    from surfsup.viewing.trajectory_pictures import write_picture_of, write_video_of

    require_graphics()
    if frame is not None:
        made = write_picture_of(trajectory, trajectory.with_name(f"frame-{frame:05d}.png"), frame)
    else:
        with bar("drawing the video") as tell:
            made = write_video_of(trajectory, trajectory.with_name("video.mp4"), tell)
    typer.echo(f"written to {made}")
