"""`surfsup compare`: the errors of one trajectory against another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.options import Near
from surfsup.cli.progress import progress_bar
from surfsup.io.trajectory_path import existing_trajectory


def compare(
    prediction: Annotated[
        Path,
        typer.Argument(
            metavar="TRAJECTORY", help="The trajectory to evaluate, or its folder.", callback=existing_trajectory
        ),
    ],
    reference: Annotated[
        Path,
        typer.Argument(
            metavar="REFERENCE", help="The reference, of the same scene, or its folder.", callback=existing_trajectory
        ),
    ],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="A JSON file for the numbers and curves.")] = None,
    near: Near = None,
) -> None:
    """Evaluate one trajectory against another.

    Both are of the same scene. The table shows the floor of the reference, if there is one.

    Example: surfsup compare out/bunny out/bunny-reference
    """
    from surfsup.evaluation.pair import evaluate_pair
    from surfsup.evaluation.report import make_folder, write_json

    with progress_bar("comparing") as bar:
        pair = evaluate_pair(prediction, reference, near, bar)
    typer.echo(pair.text())
    if out is not None:
        make_folder(out.parent)
        write_json(out, pair.report())
        typer.echo(f"written to {out}")
