"""`surfsup design`: shapes that do what is asked of the water."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup.cli.options import Seed, SimulatorName
from surfsup.cli.progress import progress_bar
from surfsup.cli.status import INTERRUPTED

if TYPE_CHECKING:
    from surfsup.design.run import DesignRun


def design(
    task: Annotated[str, typer.Argument(metavar="bowl|funnel|latent", help="What to design.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Output folder.")],
    start: Annotated[
        list[str] | None, typer.Option(help="Start with R1,R2 in meters; repeated, each start gets a folder.")
    ] = None,
    deepsdf: Annotated[
        Path | None, typer.Option(help="Of latent: a network of `surfsup fit deepsdf`; the shipped chairs.")
    ] = None,
    shape: Annotated[str | None, typer.Option("--shape", help="Of latent: the shape to start with.")] = None,
    iterations: Annotated[int, typer.Option(min=1, help="Steps uphill, at most.")] = 100,
    frames: Annotated[int | None, typer.Option(min=1, help="Frames of a rollout; 50, of the funnel 75.")] = None,
    smooth: Annotated[
        float | None, typer.Option(min=0, help="Meters by which the water's start is moved at random, each time anew.")
    ] = None,
    simulator_name: SimulatorName = "dfsph",
    seed: Seed = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from where the folder's run stopped.")] = False,
    rivals: Annotated[bool, typer.Option("--rivals", help="Compare with CMA-ES and random search.")] = False,
    no_proof: Annotated[bool, typer.Option("--no-proof", help="Leave out the reference solver's verdict.")] = False,
    no_video: Annotated[bool, typer.Option("--no-video", help="Leave out the video.")] = False,
) -> None:
    """Shape a vessel by gradient, so that the water does what is asked; prove it in the reference solver.

    Example: surfsup design bowl -o out/bowl
    """
    from surfsup.design.figure import draw_runs, require_matplotlib
    from surfsup.design.optimize import optimize
    from surfsup.design.paper_tasks import asked_tasks
    from surfsup.learned import weights_file
    from surfsup.optim.stopping import Stop
    from surfsup.splishsplash import solver
    from surfsup.viewing.graphics import require_graphics

    require_matplotlib()
    if not no_video:
        require_graphics()
    if not no_proof:
        solver.check_installed()
    tasks = asked_tasks(task, out, start, frames, deepsdf, shape)
    runs: list[DesignRun] = []
    named = model or weights_file.DEFAULT_MODEL
    with Stop() as stop:
        for folder, one in tasks:
            with design_line(folder.name) as tell:
                run = optimize(one, folder, iterations, named, smooth, seed, resume, stop, tell)
            if not run.done:
                raise typer.Exit(INTERRUPTED)
            runs.append(run)
    for run in runs:
        finish(run, rivals, no_proof, no_video)
    if len(runs) > 1:
        typer.echo(f"all starts    {draw_runs(runs, out / 'starts.png')}")


def finish(run: DesignRun, rivals: bool, no_proof: bool, no_video: bool) -> None:
    """Write figure, shapes, verdict and video of a finished run, and say what came of it."""
    from surfsup.design.figure import draw_runs
    from surfsup.design.film import write_film
    from surfsup.design.record import PATIENCE
    from surfsup.design.shape_files import write_shape
    from surfsup.design.task import told
    from surfsup.design.verdict import compare_rivals, prove

    folder, best = run.folder, run.designs[run.best]
    typer.echo(f"{run.task.name}: reward {run.rewards[0]:.4f} at {told(run.designs[0])}")
    if run.settled:
        typer.echo(f"  settled after {len(run.rewards)} designs: the last {PATIENCE} gained nothing")
    typer.echo(f"  best  {run.rewards[run.best]:.4f} at {told(best)}, iteration {run.best}")
    typer.echo(f"  last  {run.rewards[-1]:.4f} at {told(run.designs[-1])}")
    if (remedy := run.remedy()) is not None:
        typer.echo(remedy)
    files = write_shape(run.task.surface(best, run.task.water()), folder, "best")
    typer.echo(f"shape         {', '.join(str(file) for file in files)}")
    typer.echo(f"figure        {draw_runs([run], folder / 'history.png')}")
    if not no_proof:
        with progress_bar("asking the reference solver") as tell:
            typer.echo(prove(run, tell).text())
    if rivals:
        with progress_bar("searching without gradients") as tell:
            typer.echo(compare_rivals(run, not no_proof, tell))
    if not no_video:
        with progress_bar("drawing the video") as tell:
            typer.echo(f"video         {write_film(run, folder / 'design.mp4', tell)}")
