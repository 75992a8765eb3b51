"""`surfsup view` and `surfsup render`: page, video and pictures of a trajectory."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.progress import progress_bar

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


def render(
    trajectory: TrajectoryFile,
    frame: Annotated[int | None, typer.Option(min=0, help="Render a picture of this frame instead.")] = None,
) -> None:
    """Render the video of a trajectory.

    With --frame it renders a picture of one frame. Both are written next to the trajectory.

    Example: surfsup render out/bunny/trajectory.h5 --frame 120
    """
    from surfsup.viewing.graphics import require_graphics
    from surfsup.viewing.trajectory_pictures import write_frame_picture, write_trajectory_video

    require_graphics()
    if frame is not None:
        output = write_frame_picture(trajectory, trajectory.with_name(f"frame-{frame:05d}.png"), frame)
    else:
        with progress_bar("rendering the video") as bar:
            output = write_trajectory_video(trajectory, trajectory.with_name("video.mp4"), bar)
    typer.echo(f"written to {output}")
