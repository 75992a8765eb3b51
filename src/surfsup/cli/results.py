"""The folder that a simulation fills, and what is said of it in the end."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from surfsup.cli.progress import bar

if TYPE_CHECKING:
    from surfsup.io.output_folder import OutputFolder, Summary
    from surfsup.scene import Scene, Start


def open_folder(out: Path | None, source: Path, scene: Scene, start: Start, pictures: bool) -> OutputFolder:
    """The output folder, once it is known that what was asked for can be made here."""
    from surfsup.io.output_folder import OutputFolder
    from surfsup.viewing.graphics import require_graphics

    if pictures:
        require_graphics()
    return OutputFolder(out or Path("out") / source.stem, len(start.positions), scene.frames)


def show(folder: OutputFolder, summary: Summary, left_out: int, no_page: bool, no_video: bool) -> None:
    """Make page and video, and say what was made, how fast, and how to look at it."""
    from surfsup.viewing.trajectory_pictures import write_page_of, write_video_of

    if not no_page:
        with bar("writing the page") as tell:
            write_page_of(folder.trajectory, folder.page, tell)
    if not no_video:
        with bar("drawing the video") as tell:
            write_video_of(folder.trajectory, folder.video, tell)
    if left_out:
        typer.echo(f"{left_out} particles would have started in the solid and were left out")
    typer.echo(
        f"{summary.particles} particles, {summary.frames} frames in {summary.seconds:.1f} s "
        f"({summary.ms_per_frame:.1f} ms a frame); {summary.penetrations} in the solid, "
        f"{summary.out_of_container} out of the container"
    )
    typer.echo(f"trajectory  {folder.trajectory}")
    if not no_page:
        typer.echo(f"page        {folder.page}  (open it in a browser, no network needed)")
    if not no_video:
        typer.echo(f"video       {folder.video}")
