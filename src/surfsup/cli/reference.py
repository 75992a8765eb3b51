"""`surfsup reference`: water by the reference solver."""

from __future__ import annotations

from typing import Annotated

import typer

from surfsup.cli.options import (
    At,
    BlockMax,
    BlockMin,
    ContainerSize,
    Fit,
    Frames,
    NoFit,
    NoPage,
    NoVideo,
    Out,
    ShapeName,
    Source,
    Turn,
    Up,
)
from surfsup.cli.progress import bar
from surfsup.cli.results import open_folder, show
from surfsup.cli.scene_source import read_scene


def reference(
    source: Source,
    out: Out = None,
    frames: Frames = None,
    fit: Fit = 0.7,
    no_fit: NoFit = False,
    up: Up = None,
    turn: Turn = 0.0,
    at: At = None,
    block_min: BlockMin = None,
    block_max: BlockMax = None,
    container: ContainerSize = None,
    shape: ShapeName = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the solver.")] = 1,
    no_page: NoPage = False,
    no_video: NoVideo = False,
) -> None:
    """Simulate the same scene with SPlisHSPlasH, the ground truth.

    Example: surfsup reference bunny.obj -o out/bunny-truth
    """
    from surfsup.io.trajectory import Provenance
    from surfsup.splishsplash import solver
    from surfsup.splishsplash.compressed_start import warn_of_pressed_water

    scene = read_scene(source, frames, None if no_fit else fit, up, turn, at, block_min, block_max, container, shape)
    surface = scene.build_surface()
    start = scene.start(surface)
    solver.require()
    warn_of_pressed_water(scene, start)
    folder = open_folder(out, source, scene, start, pictures=not no_video)
    with bar("simulating with SPlisHSPlasH") as tell:
        summary = folder.record(
            scene,
            surface,
            start,
            solver.simulate(scene, surface, start, threads),
            Provenance(solver.NAME),
            "cpu",
            tell,
        )
    show(folder, summary, start.left_out, no_page, no_video)
