"""`surfsup export`: a trajectory in the format of another program."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from surfsup.cli.locks import hold_lock
from surfsup.cli.progress import progress_bar
from surfsup.cli.status import BAD_INPUT
from surfsup.cli.view import TrajectoryFile

if TYPE_CHECKING:
    from surfsup.exporting.export import Export


@dataclass(frozen=True)
class ReconstructionOptions:
    """The parameters of the water's surface; the help texts describe the fields."""

    smoothing_length: Annotated[float, typer.Option(help="Half the kernel's support radius, in particle radii.")] = 2.0
    cube_size: Annotated[float, typer.Option(help="Cells of marching cubes, in particle radii.")] = 0.7
    iso: Annotated[float, typer.Option(help="Density of the surface, relative to water.")] = 0.6
    mesh_smoothing: Annotated[int, typer.Option(help="Smoothing iterations of the vertices.")] = 20
    normal_smoothing: Annotated[int, typer.Option(help="Smoothing iterations of the normals.")] = 8


def export(
    trajectory: TrajectoryFile,
    to: Annotated[
        str, typer.Option("--to", metavar="FORMAT", help="vtk, vtu, ply, bgeo, npz, usd, blender, alembic, obj, glb.")
    ],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder; 'export' beside the trajectory.")] = None,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 24.0,
    what: Annotated[
        Literal["particles", "surface", "solid", "all"] | None,
        typer.Option(help="By default particles; the surface where a format has none; all in a single file."),
    ] = None,
    up: Annotated[
        Literal["y", "z"] | None, typer.Option("--up", help="Upward axis of the files; z unless the format requires y.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an older export in the folder.")] = False,
    *,
    reconstruction: ReconstructionOptions,
) -> None:
    """Write a trajectory for other programs.

    Example: surfsup export out/bunny --to vtk
    """
    from surfsup.exporting.export import export as write_export
    from surfsup.viewing.reconstruction import Reconstruction

    folder = out or trajectory.parent / "export"
    parameters = Reconstruction(**asdict(reconstruction))
    hold_lock(folder)
    with progress_bar(f"exporting {to}") as bar:
        done = write_export(trajectory, to, folder, fps, what, up, parameters, overwrite, bar)
    print_export(done)
    if done.cut_off:
        raise typer.Exit(BAD_INPUT)


def print_export(done: Export) -> None:
    """Print which files to open."""
    for file in done.files:
        count = f"  ({done.frames} frames)" if done.frames and file.stem != "solid" else ""
        typer.echo(f"export      {file}{count}")
