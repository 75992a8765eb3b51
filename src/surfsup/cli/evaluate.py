"""`surfsup evaluate`: a model judged on data sets."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.options import Device, Near, NoVideos
from surfsup.cli.progress import bar


def evaluate(
    model: Annotated[str, typer.Argument(help="A shipped model's name or a .safetensors file.")],
    data: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Folders of held-out trajectories.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder of the report; out/report-MODEL.")] = None,
    no_guard: Annotated[bool, typer.Option("--no-guard", help="Judge the network without the guard.")] = False,
    first_scenes: Annotated[
        int | None, typer.Option("--scenes", min=1, help="By so many trajectories of each folder; all by default.")
    ] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="By so many of their frames; all by default.")] = None,
    near: Near = 0.09,
    device: Device = None,
    no_video: NoVideos = False,
) -> None:
    """Judge a model on held-out trajectories of the reference solver, beside their floor where there is one.

    Example: surfsup evaluate fast data/test -o out/report
    """
    from surfsup.evaluation import report
    from surfsup.evaluation.evaluate import evaluate as judge
    from surfsup.evaluation.load_trajectories import data_sets, usable_truths
    from surfsup.evaluation.page import write_page
    from surfsup.evaluation.table import evaluation_text
    from surfsup.evaluation.unseen import unseen
    from surfsup.evaluation.videos import examples, why_no_videos, write_videos
    from surfsup.learned import weights_file
    from surfsup.simulation import choose_device

    simulator, card = weights_file.load(weights_file.find(model))
    where = choose_device(device)
    sets = data_sets(data, first_scenes)
    with bar("reading the truth") as tell:
        truths, skipped = usable_truths(sets, tell, frames)
    for strange in unseen(card.seen, truths).values():
        warnings.warn(strange, stacklevel=1)
    folder = out or Path("out") / f"report-{card.name}{'-no-guard' if no_guard else ''}"
    report.make_folder(folder)
    with bar(f"judging '{card.name}'") as tell:
        scenes = judge(simulator, card.name, truths, folder, where, not no_guard, near, tell)
    subject = report.Subject(card, not no_guard, near, first_scenes, frames)
    found = report.evaluation_report(subject, sets, scenes, skipped, folder)
    report.write_json(folder / "report.json", found)
    typer.echo(evaluation_text(subject, scenes, sets, skipped))
    shown, missing = ([], None) if no_video else (examples(scenes), why_no_videos())
    if missing:
        typer.echo(missing)
    write_page(folder / "report.html", found, no_videos=missing)
    if shown and not missing:  # they take minutes: whoever interrupts them still has the page
        with bar("drawing the videos") as tell:
            write_videos(folder, shown, card.name, tell)
        write_page(folder / "report.html", found, shown)
    typer.echo(f"numbers       {folder / 'report.json'}")
    typer.echo(f"trajectories  {folder / 'trajectories'}")
    typer.echo(f"page          {folder / 'report.html'}  (open it in a browser, no network needed)")
