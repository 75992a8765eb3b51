"""`surfsup generate` and `surfsup floor`: data sets and their floors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.options import Scheduler, Seed, Workers
from surfsup.cli.progress import progress_bar
from surfsup.cli.status import after_interrupt
from surfsup.errors import InputError, did_you_mean
from surfsup.io.trajectory_path import trajectory_files

# Their modules are slow to import; a test compares the names.
RECIPE_NAMES = (
    "prim-shapes",
    "prim-unions",
    "funnels",
    "bowls",
    "chairs",
    "complex-scenes",
    "mountain",
    "assorted",
    "tanks",
    "hills",
    "stirring",
    "taps",
    "pouring",
    "tilting",
    "fine",
    "honey",
)


def generate(
    recipe: Annotated[
        str,
        typer.Argument(
            metavar="RECIPE",
            help=f"Name of the recipe: {', '.join(RECIPE_NAMES)}.",
            autocompletion=lambda: RECIPE_NAMES,
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder of the data set.")],
    n: Annotated[int, typer.Option("-n", help="Number of scenes.")],
    seed: Seed = 0,
    frames: Annotated[int | None, typer.Option(min=1, help="Frames per scene; by default those of the recipe.")] = None,
    source: Annotated[Path | None, typer.Option(help="Source of the recipe's surfaces: meshes, heights.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Generate a data set with the reference solver.

    A second call adds the missing trajectories.

    Example: surfsup generate prim-shapes -o data/train -n 60 --seed 1
    """
    if recipe not in RECIPE_NAMES:
        hint = did_you_mean(recipe, RECIPE_NAMES)
        raise InputError(f"there is no recipe '{recipe}'{hint}; known are {', '.join(RECIPE_NAMES)}")
    if source is not None and not source.exists():
        raise InputError(f"--source {source}: does not exist")
    from surfsup.datasets.generation.generate import generate as generate_data_set

    kept = f"the finished scenes are kept in {out}; the same command adds the others"
    with after_interrupt(kept), progress_bar(f"simulating {n} scenes of {recipe}") as bar:
        paths = generate_data_set(recipe, out, n, seed, frames, source, workers, scheduler, bar)
    typer.echo(f"{len(paths)} trajectories in {out}; dataset.yaml describes them")


def floor(
    data: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of trajectories of the reference solver.")],
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Measure how far the reference is from itself: repeat each scene of a data set three times.

    The repeats start 1 mm aside. Their errors are the smallest that a simulator can be expected to reach.

    Example: surfsup floor data/test
    """
    trajectory_files(data)
    from surfsup.datasets.generation.floor import simulate_floor

    kept = f"the finished repeats are kept in {data / 'floor'}; the same command adds the others"
    with after_interrupt(kept), progress_bar(f"repeating {data}") as bar:
        paths = simulate_floor(data, workers, scheduler, bar)
    typer.echo(f"{len(paths)} trajectories in {data / 'floor'}")
