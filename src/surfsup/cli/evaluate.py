"""`surfsup evaluate`: the errors of a simulator on data sets."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.locks import hold_lock
from surfsup.cli.options import Device, Near, NoCollisions, NoVideos
from surfsup.cli.progress import progress_bar
from surfsup.cli.status import after_interrupt
from surfsup.io.trajectory_path import trajectory_files
from surfsup.learned.simulator_names import require_simulator


def evaluate(
    simulator_name: Annotated[
        str,
        typer.Argument(metavar="SIMULATOR", help="Name of a simulator (dfsph, surfsup, gns, ...) or a weights file."),
    ],
    data: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Folders of held-out trajectories.")],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder of the report; out/report-SIMULATOR by default.")
    ] = None,
    no_collisions: NoCollisions = False,
    scenes: Annotated[
        int | None, typer.Option(min=1, help="Use only the first trajectories of each folder, this many.")
    ] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="Use only the first frames, this many.")] = None,
    near: Near = None,
    device: Device = None,
    no_video: NoVideos = False,
) -> None:
    """Evaluate a simulator on held-out trajectories.

    The trajectories are those of the reference solver. The report shows their floor, if there is one.

    Example: surfsup evaluate dfsph data/test -o out/report
    """
    require_simulator(simulator_name)
    for folder in data:
        trajectory_files(folder)
    from surfsup.evaluation import report
    from surfsup.evaluation.domain_warnings import domain_warnings
    from surfsup.evaluation.evaluate import evaluate as evaluate_simulator
    from surfsup.evaluation.load_trajectories import find_data_sets, load_references
    from surfsup.evaluation.page import write_page
    from surfsup.evaluation.table import evaluation_text
    from surfsup.evaluation.videos import missing_graphics, select_examples, write_videos
    from surfsup.learned.loading import load_simulator
    from surfsup.scene import NEAR_SURFACE_DISTANCE
    from surfsup.sph.device import choose_device

    simulator, card = load_simulator(simulator_name)
    name = card.name if card else simulator_name
    device = choose_device(device)
    sets = find_data_sets(data, scenes)
    with progress_bar("reading the references") as bar:
        references, skipped = load_references(sets, bar, frames)
    for warning in domain_warnings(card.training_domain if card else None, references).values():
        warnings.warn(warning, stacklevel=1)
    threshold = NEAR_SURFACE_DISTANCE * references[0].scene.units.length if near is None else near
    folder = out or Path("out") / f"report-{name}{'-no-collisions' if no_collisions else ''}"
    hold_lock(folder)
    with progress_bar(f"evaluating {name}") as bar:
        results = evaluate_simulator(simulator, name, references, folder, device, not no_collisions, threshold, bar)
    settings = report.EvaluationSettings(name, card, not no_collisions, threshold, scenes, frames)
    content = report.evaluation_report(settings, sets, results, skipped, folder)
    report.write_json(folder / "report.json", content)
    typer.echo(evaluation_text(settings, results, sets, skipped))
    examples, missing = ([], None) if no_video else (select_examples(results), missing_graphics())
    if missing:
        typer.echo(missing)
    write_page(folder / "report.html", content, no_videos=missing)
    if examples and not missing:  # rendering takes minutes; after an interrupt the page above remains
        kept = f"the report is kept without videos in {folder}"
        with after_interrupt(kept), progress_bar("rendering the videos") as bar:
            write_videos(folder, examples, name, bar)
        write_page(folder / "report.html", content, examples)
    typer.echo(f"numbers       {folder / 'report.json'}")
    typer.echo(f"trajectories  {folder / 'trajectories'}")
    typer.echo(f"page          {folder / 'report.html'}  (open it in a browser, no network needed)")
