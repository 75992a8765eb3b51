"""`surfsup sweep`: many scenes that differ in some values."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup.cli.options import Scheduler, SimulatorName, Workers
from surfsup.cli.progress import progress_bar
from surfsup.cli.scene_options import SceneOptions
from surfsup.cli.status import FAULT, after_interrupt
from surfsup.errors import InputError
from surfsup.learned.simulator_names import require_simulator

if TYPE_CHECKING:
    from surfsup.scene import Scene


def sweep(
    scenes: Annotated[
        list[Path],
        typer.Argument(metavar="SURFACE|SCENE.yaml...", help="Scene files, or surfaces that water falls on."),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder of the sweep.")],
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUES",
            help="A key of the scenes and its values, first:last:count or value,value,...; repeatable.",
        ),
    ] = None,
    simulator: SimulatorName = "dfsph",
    workers: Workers = None,
    scheduler: Scheduler = None,
    no_pictures: Annotated[bool, typer.Option("--no-pictures", help="Omit contact-sheet.png.")] = False,
) -> None:
    """Simulate scenes with every combination of some values.

    A second call adds the missing simulations.

    Example: surfsup sweep scene.yaml --vary gravity.2=-9.81:-1.62:4 --vary particle_radius=0.01,0.015 -o out/gravity
    """
    for path in scenes:
        SceneOptions(path).check()
    require_simulator(simulator)
    from surfsup.sweep.run import sweep as run_sweep
    from surfsup.sweep.variation import Variation
    from surfsup.viewing.graphics import require_graphics

    variations = [Variation.parse(text) for text in vary or []]
    by_name = {path.stem: read_scene(path) for path in scenes}
    if len(by_name) < len(scenes):
        raise InputError("two scenes have the same name; the folders of their cases would be the same")
    if not no_pictures:
        require_graphics()
    kept = f"the finished simulations are kept in {out}; the same command adds the others"
    with after_interrupt(kept):
        with progress_bar("simulating") as bar:
            done = run_sweep(by_name, variations, out, simulator, workers, scheduler, bar)
        if done.finished and not no_pictures:
            from surfsup.sweep.contact_sheet import write_contact_sheet

            with progress_bar("drawing") as bar:
                sheet = write_contact_sheet(done.folder, done.finished, bar)
    typer.echo(f"{len(done.finished)} of {len(done.cases)} simulations in {out}")
    for table in done.tables:
        typer.echo(f"table    {out / table.name}")
    if done.finished and not no_pictures:
        typer.echo(f"pictures {out / sheet.name}")
    for name, message in list(done.errors.items())[:5]:
        typer.echo(f"surfsup: {name}: {message}", err=True)
    if done.errors:
        raise typer.Exit(FAULT)


def read_scene(path: Path) -> Scene:
    """A scene file, or the scene of water on a surface."""
    from surfsup.scene import Container, Scene
    from surfsup.scene.from_surface import Placement, scene_from_surface

    if path.suffix.lower() in (".yaml", ".yml"):
        return Scene.load(path)
    scene, _ = scene_from_surface(path, Placement(), Container(), None, 800)
    return scene
