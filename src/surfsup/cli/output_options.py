"""The options about the output folder of a simulation."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup.cli.locks import hold_lock
from surfsup.cli.options import AsJson
from surfsup.cli.progress import progress_bar
from surfsup.cli.status import after_interrupt

if TYPE_CHECKING:
    from surfsup.exporting.export import Export
    from surfsup.io.output_folder import OutputFolder, Summary


@dataclass(frozen=True)
class OutputOptions:
    """The output folder and the files to omit; the help texts describe the fields."""

    out: Annotated[Path | None, typer.Option("-o", "--out", help="Output folder; out/NAME by default.")] = None
    no_page: Annotated[bool, typer.Option("--no-page", help="Omit page.html.")] = False
    no_video: Annotated[bool, typer.Option("--no-video", help="Omit video.mp4.")] = False
    export: Annotated[str | None, typer.Option(metavar="FORMAT", help="Export too; see surfsup export.")] = None
    export_fps: Annotated[float, typer.Option(help="Frames per second of the export.")] = 24.0
    as_json: AsJson = False

    def interrupted(self, source: Path) -> Path:
        """The trajectory of the run of ``source`` that was interrupted: beside an older one, or alone."""
        folder = self.out or Path("out") / source.stem
        beside = folder / "trajectory.new.h5"
        return beside if beside.exists() else folder / "trajectory.h5"

    def create_folder(self, source: Path, particles: int, frames: int) -> OutputFolder:
        """Create the output folder of a simulation of ``source``, and keep other runs out of it.

        Raises:
            InputError: the folder is unusable, another run is writing into it, or this machine cannot render the
                video or write the export.
        """
        from surfsup.io.output_folder import OutputFolder
        from surfsup.viewing.graphics import require_graphics

        if not self.no_video:
            require_graphics()
        if self.export:
            from surfsup.exporting.formats import check_export

            check_export(self.export, self.export_fps)
        folder = OutputFolder(self.out or Path("out") / source.stem, particles, frames)
        hold_lock(folder.path)
        return folder

    def finish(self, folder: OutputFolder, summary: Summary, excluded: int) -> None:
        """Write page, video and export, then print what the folder contains.

        Args:
            folder: the folder with the trajectory.
            summary: the summary of the simulation.
            excluded: number of particles without a place at the start.
        """
        with after_interrupt(
            f"the whole trajectory is kept in {folder.trajectory}; for its pictures there are the verbs view and render"
        ):
            if not self.no_page:
                from surfsup.viewing.trajectory_page import write_trajectory_page

                with progress_bar("writing the page") as bar:
                    write_trajectory_page(folder.trajectory, folder.page, bar)
            if not self.no_video:
                from surfsup.viewing.trajectory_pictures import write_trajectory_video

                with progress_bar("rendering the video") as bar:
                    write_trajectory_video(folder.trajectory, folder.video, bar)
            done = self._export(folder)
        files = {"trajectory": folder.trajectory}
        files |= {} if self.no_page else {"page": folder.page}
        files |= {} if self.no_video else {"video": folder.video}
        if self.as_json:
            exported = [] if done is None else [str(file) for file in done.files]
            result = {
                **asdict(summary),
                "excluded": excluded,
                "files": {name: str(file) for name, file in files.items()},
            }
            typer.echo(json.dumps({**result, "exported": exported}, indent=2))
            return
        if summary.entered or summary.left:
            typer.echo(f"{summary.entered} particles entered through taps, {summary.left} left through drains")
        typer.echo(
            f"{summary.particles} particles, {summary.frames} frames in {summary.seconds:.1f} s "
            f"({summary.start_up:.1f} s to start, {summary.ms_per_frame:.1f} ms per frame, "
            f"{summary.writing:.1f} s to write); {summary.penetrations} in the solid, "
            f"{summary.out_of_container} out of the container"
            + ("" if summary.crossings is None else f", {summary.crossings} passed through a solid")
        )
        for name, file in files.items():
            remark = "  (open it in a browser, no network needed)" if name == "page" else ""
            typer.echo(f"{name:10}  {file}{remark}")
        if done is not None:
            from surfsup.cli.export import print_export

            print_export(done)

    def _export(self, folder: OutputFolder) -> Export | None:
        """Write the export, if one was requested."""
        if self.export is None:
            return None
        from surfsup.exporting.export import export

        with progress_bar(f"exporting {self.export}") as bar:
            return export(
                folder.trajectory, self.export, folder.path / "export", self.export_fps, overwrite=True, progress=bar
            )
