"""The options that describe a scene."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup.cli.options import UpAxis, Vector
from surfsup.errors import InputError

if TYPE_CHECKING:
    from surfsup.scene import Scene

FOR_SCENE_FILES = ("source", "frames")


@dataclass(frozen=True)
class SceneOptions:
    """A scene file, or a surface and its placement; the help texts describe the fields."""

    source: Annotated[
        Path,
        typer.Argument(
            metavar="SURFACE|SCENE.yaml",
            help="A mesh, a neural surface (a file, or coral, chairs, bowls), or a scene file.",
        ),
    ]
    frames: Annotated[int | None, typer.Option(min=1, help="Frames of 0.005 s; 800 by default.")] = None
    fit: Annotated[
        float | None, typer.Option(help="Largest extent of the scaled surface in meters; 0.7 by default.")
    ] = None
    no_fit: Annotated[bool, typer.Option("--no-fit", help="Keep the coordinates of the file, in meters.")] = False
    up: UpAxis = None
    thicken: Annotated[
        float | None, typer.Option(help="Thickness in meters of the walls that sheets of a mesh become.")
    ] = None
    turn: Annotated[float, typer.Option(help="Rotation of the surface about z in degrees.")] = 0.0
    at: Annotated[Vector | None, typer.Option(help="Where the scaled surface stands, in meters; 0 0 0 by default.")] = (
        None
    )
    block_min: Annotated[Vector | None, typer.Option(help="Lower corner of the block of water in meters.")] = None
    block_max: Annotated[Vector | None, typer.Option(help="Upper corner of the block of water in meters.")] = None
    container: Annotated[Vector | None, typer.Option(help="Sides of the container in meters; 1 1 2 by default.")] = None
    shape: Annotated[str | None, typer.Option(help="Name of the shape in a DeepSDF with several.")] = None

    def read(self) -> Scene:
        """Read the scene file, or build the scene of water on the surface and print how the surface is placed.

        Raises:
            InputError: a file is unusable, or an option does not apply.
        """
        from surfsup.scene import Block, Container, Scene
        from surfsup.scene.from_surface import DEFAULT_FIT, Placement, scene_from_surface

        if self.source.suffix.lower() in (".yaml", ".yml"):
            options = [field for field in fields(self) if field.name not in FOR_SCENE_FILES]
            given = [option.name for option in options if getattr(self, option.name) != option.default]
            if given:
                option = f"--{given[0].replace('_', '-')}"
                raise InputError(f"{self.source}: a scene file places everything itself; omit {option}")
            scene = Scene.load(self.source)
            return scene if self.frames is None else scene.with_frames(self.frames)
        if (self.block_min is None) != (self.block_max is None):
            raise InputError("give both --block-min and --block-max, or neither")
        block = Block(self.block_min, self.block_max) if self.block_min and self.block_max else None
        container = Container(size=self.container) if self.container else Container()
        fit = DEFAULT_FIT if self.fit is None else self.fit
        at = self.at or (0.0, 0.0, 0.0)
        placement = Placement(None if self.no_fit else fit, self.up, self.turn, at, self.shape, self.thicken)
        scene, summary = scene_from_surface(self.source, placement, container, block, self.frames or 800)
        typer.echo(summary)
        return scene
