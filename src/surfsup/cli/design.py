"""`surfsup design`: optimize the shape of a vessel for where the water goes."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup.cli.locks import hold_lock
from surfsup.cli.options import Resume, Seed
from surfsup.cli.progress import ProgressDisplay, progress_bar
from surfsup.cli.status import RESUMABLE, after_interrupt
from surfsup.errors import Interrupted

if TYPE_CHECKING:
    from surfsup.design.optimize import Progress
    from surfsup.design.run import DesignRun


def design(
    task: Annotated[str, typer.Argument(metavar="bowl|funnel|latent", help="The shape to optimize.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Output folder.")],
    start: Annotated[
        list[str] | None, typer.Option(help="Initial radii R1,R2 in meters; repeatable, with a folder per start.")
    ] = None,
    deepsdf: Annotated[
        Path | None, typer.Option(help="For latent: a file of 'surfsup fit deepsdf'; chairs by default.")
    ] = None,
    shape: Annotated[str | None, typer.Option(help="For latent: name of the initial shape.")] = None,
    iterations: Annotated[int, typer.Option(min=1, help="Maximum number of gradient steps.")] = 100,
    frames: Annotated[
        int | None, typer.Option(min=1, help="Frames of a rollout; 50 by default, 75 for funnel.")
    ] = None,
    smoothing: Annotated[
        float,
        typer.Option(
            "--smooth", min=0, help="Shift the water's start at random by this many meters in each iteration."
        ),
    ] = 0.0,
    seed: Seed = 0,
    resume: Resume = False,
    baselines: Annotated[bool, typer.Option("--baselines", help="Compare with CMA-ES and random search.")] = False,
    no_verification: Annotated[
        bool, typer.Option("--no-verification", help="Omit the verification in the reference solver.")
    ] = False,
    no_video: Annotated[bool, typer.Option("--no-video", help="Omit the video.")] = False,
) -> None:
    """Optimize a shape by gradients through the solver.

    The reward of a task says where the water should go. The reference solver verifies the best design.

    Example: surfsup design bowl -o out/bowl
    """
    from surfsup.design.optimize import optimize
    from surfsup.design.plots import plot_runs, require_matplotlib
    from surfsup.design.task_options import tasks_from_options
    from surfsup.optim.stopping import Stop
    from surfsup.splishsplash import solver
    from surfsup.viewing.graphics import require_graphics

    require_matplotlib()
    if not no_video:
        require_graphics()
    if not no_verification:
        solver.check_installed()
    tasks = tasks_from_options(task, out, start, frames, deepsdf, shape)
    hold_lock(out)
    runs: list[DesignRun] = []
    with Stop() as stop:
        for folder, design_task in tasks:
            with progress_bar(folder.name) as bar:
                report = partial(show_progress, bar)
                run = optimize(design_task, folder, iterations, smoothing, seed, resume, stop, report)
            if not run.done:
                raise Interrupted(RESUMABLE)
            runs.append(run)
    with after_interrupt(f"the optimization is finished and kept in {out}; --resume makes the rest"):
        for run in runs:
            finish(run, baselines, no_verification, no_video)
    if len(runs) > 1:
        typer.echo(f"all starts    {plot_runs(runs, out / 'starts.png')}")


def show_progress(bar: ProgressDisplay, progress: Progress) -> None:
    """Show the progress of a run on the bar."""
    bar.description = f"reward {progress.reward:.4f}, {progress.values}"
    bar(progress.iteration, progress.iterations, progress.seconds_left)


def finish(run: DesignRun, baselines: bool, no_verification: bool, no_video: bool) -> None:
    """Write plot, shapes, verification and video of a finished run, and print its results."""
    from surfsup.design.baselines import compare_with_baselines
    from surfsup.design.history import PATIENCE
    from surfsup.design.plots import plot_runs
    from surfsup.design.shape_files import write_shape
    from surfsup.design.task import format_values
    from surfsup.design.verification import verify
    from surfsup.design.video import write_design_video

    folder, best = run.folder, run.designs[run.best]
    typer.echo(f"{run.task.name}: reward {run.rewards[0]:.4f} at {format_values(run.designs[0])}")
    if run.converged:
        typer.echo(f"  converged after {len(run.rewards)} designs: the last {PATIENCE} improved nothing")
    if run.best == 0:
        typer.echo("  best  the first design: no iteration improved it; more --iterations or another --start may")
    else:
        typer.echo(f"  best  {run.rewards[run.best]:.4f} at {format_values(best)}, iteration {run.best}")
    typer.echo(f"  last  {run.rewards[-1]:.4f} at {format_values(run.designs[-1])}")
    if (remedy := run.remedy()) is not None:
        typer.echo(remedy)
    files = write_shape(run.task.surface(best, run.task.initial_state()), folder, "best")
    typer.echo(f"shape         {', '.join(map(str, files))}")
    typer.echo(f"plot          {plot_runs([run], folder / 'history.png')}")
    if not no_verification:
        with progress_bar("verifying in the reference solver") as bar:
            typer.echo(verify(run, bar).text())
    if baselines:
        with progress_bar("searching without gradients") as bar:
            typer.echo(compare_with_baselines(run, not no_verification, bar))
    if not no_video:
        with progress_bar("rendering the video") as bar:
            typer.echo(f"video         {write_design_video(run, folder / 'design.mp4', bar)}")
