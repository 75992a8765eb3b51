"""`surfsup generate` and `surfsup floor`: data sets and how near a model can come to them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.options import Scheduler, Seed, Workers
from surfsup.cli.progress import paced_bar


def generate(
    recipe: Annotated[str, typer.Argument(help="Which scenes.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder of the data set.")],
    n: Annotated[int, typer.Option("-n", help="How many scenes.")],
    seed: Seed = 0,
    frames: Annotated[int | None, typer.Option(min=1, help="Frames of every scene; else as the recipe says.")] = None,
    source: Annotated[Path | None, typer.Option(help="What the recipe makes surfaces of: meshes, heights.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Make a data set with the reference solver; started again, it makes what is missing.

    Example: surfsup generate prim-shapes -o data/train -n 60 --seed 1
    """
    from surfsup.datasets.generation.generate import generate as make

    with paced_bar(f"simulating {n} scenes of {recipe}") as tell:
        paths = make(recipe, out, n, seed, frames, source, workers, scheduler, tell)
    typer.echo(f"{len(paths)} trajectories in {out}; dataset.yaml there tells of them")


def floor(
    data: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the reference solver's trajectories.")],
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Run the reference three times more for each trajectory, from starts 1 mm away: how near can a model come?

    Example: surfsup floor data/test
    """
    from surfsup.datasets.generation.floor import floor as run_again

    with paced_bar(f"running {data} again") as tell:
        made = run_again(data, workers, scheduler, tell)
    typer.echo(f"{len(made)} trajectories in {data / 'floor'}")
