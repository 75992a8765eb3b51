"""The scene that a command line speaks of: a scene file, or a surface and options."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from surfsup.cli.options import Vector
from surfsup.errors import InputError

if TYPE_CHECKING:
    from surfsup.scene import Scene


def read_scene(
    source: Path,
    frames: int | None,
    fit: float | None,
    up: str | None,
    turn: float,
    at: Vector | None,
    block_min: Vector | None,
    block_max: Vector | None,
    container: Vector | None,
    shape: str | None,
) -> Scene:
    """The scene file ``source``, or the scene of water on the surface in ``source``; says how that was placed."""
    from surfsup.scene import Scene
    from surfsup.scene.mesh_scene import Placing, pour_on
    from surfsup.scene.scene import checked_block, checked_container

    if source.suffix.lower() in (".yaml", ".yml"):
        placed = up or turn or at or block_min or block_max or container or shape
        if placed:
            raise InputError(f"{source}: a scene file places everything itself; change it there, not by options")
        scene = Scene.load(source)
        return scene if frames is None else scene.with_frames(frames)
    if (block_min is None) != (block_max is None):
        raise InputError("--block-min and --block-max go together")
    block = checked_block(block_min, block_max) if block_min and block_max else None
    placing = Placing(fit, up, turn, at or (0.0, 0.0, 0.0), shape)
    scene, said = pour_on(source, placing, checked_container(container), block, frames or 800)
    typer.echo(said)
    return scene
