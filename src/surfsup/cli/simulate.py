"""`surfsup simulate`: water by the learned simulator."""

from __future__ import annotations

import warnings
from typing import Annotated

import typer

from surfsup.cli.options import (
    At,
    BlockMax,
    BlockMin,
    ContainerSize,
    Device,
    Fit,
    Frames,
    Model,
    NoFit,
    NoPage,
    NoVideo,
    Out,
    Seed,
    ShapeName,
    Source,
    Turn,
    Up,
)
from surfsup.cli.progress import bar
from surfsup.cli.results import open_folder, show
from surfsup.cli.scene_source import read_scene


def simulate(
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
    model: Model = None,
    device: Device = None,
    seed: Seed = 0,
    no_guard: Annotated[bool, typer.Option("--no-guard", help="Let the network's own penetration show.")] = False,
    no_page: NoPage = False,
    no_video: NoVideo = False,
) -> None:
    """Pour water on a surface with the learned simulator.

    Example: surfsup simulate bunny.obj -o out/bunny
    """
    from surfsup.io.trajectory import Provenance
    from surfsup.learned import weights_file
    from surfsup.simulation import choose_device
    from surfsup.simulation import simulate as frames_of

    simulator, card = weights_file.load(weights_file.find(model or weights_file.DEFAULT_MODEL))
    where = choose_device(device)
    scene = read_scene(source, frames, None if no_fit else fit, up, turn, at, block_min, block_max, container, shape)
    if card.seen is not None and (strange := card.seen.warning(scene)) is not None:
        warnings.warn(strange, stacklevel=1)
    surface = scene.build_surface()
    start = scene.start(surface)
    folder = open_folder(out, source, scene, start, pictures=not no_video)
    with bar(f"simulating with '{card.name}'") as tell:
        summary = folder.record(
            scene,
            surface,
            start,
            frames_of(simulator, scene, surface, start, where, handle_collisions=not no_guard),
            Provenance(card.name, seed),
            where,
            tell,
        )
    show(folder, summary, start.left_out, no_page, no_video)
