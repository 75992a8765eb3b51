"""`surfsup compare`: one trajectory judged by another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.options import Near
from surfsup.cli.progress import bar


def compare(
    judged: Annotated[Path, typer.Argument(metavar="TRAJECTORY", help="What is judged.")],
    truth: Annotated[Path, typer.Argument(metavar="TRUTH", help="What it is judged by, of the same scene.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="A JSON file for the numbers and curves.")] = None,
    near: Near = 0.09,
) -> None:
    """Judge one trajectory by another of the same scene, beside the floor where there is one.

    Example: surfsup compare out/bunny/trajectory.h5 out/bunny-truth/trajectory.h5
    """
    from surfsup.evaluation.pair import judge_pair
    from surfsup.evaluation.report import make_folder, write_json

    with bar("comparing") as tell:
        pair = judge_pair(judged, truth, near, tell)
    typer.echo(pair.text())
    if out is not None:
        make_folder(out.parent)
        write_json(out, pair.report())
        typer.echo(f"written to {out}")
