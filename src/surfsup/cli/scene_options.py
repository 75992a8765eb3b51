"""The options that describe a scene."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from surfsup.cli.options import UpAxis, Vector
from surfsup.errors import InputError

if TYPE_CHECKING:
    from surfsup.scene import Scene

Frame = TypeVar("Frame")

SCENE_SUFFIXES = (".yaml", ".yml")
FOR_SCENE_FILES = ("source", "frames", "duration", "fps", "particle_radius", "restart")


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
    frames: Annotated[int | None, typer.Option(min=1, help="Number of frames; 800 by default.")] = None
    duration: Annotated[float | None, typer.Option(help="Seconds, instead of --frames.")] = None
    fps: Annotated[float | None, typer.Option(help="Frames per second; 200 by default with particles of 15 mm.")] = None
    particle_radius: Annotated[
        float | None, typer.Option(help="Particle radius in meters, 0.001 to 0.1; 0.015 by default.")
    ] = None
    restart: Annotated[
        Path | None,
        typer.Option(help="A trajectory or its folder; the scene begins with its last frame, and its time continues."),
    ] = None
    fit: Annotated[
        float | None, typer.Option(help="Largest extent of the scaled surface in meters; 0.7 by default.")
    ] = None
    no_fit: Annotated[bool, typer.Option("--no-fit", help="Keep the coordinates of the file, in meters.")] = False
    up: UpAxis = None
    thicken: Annotated[
        float | None, typer.Option(help="Thickness in meters of the walls that sheets of a mesh become.")
    ] = None
    turn: Annotated[float, typer.Option(help="Rotation of the surface about z in degrees.")] = 0.0
    at: Annotated[
        Vector | None,
        typer.Option(metavar="X Y Z", help="Where the scaled surface stands, in meters; 0 0 0 by default."),
    ] = None
    block_min: Annotated[
        Vector | None,
        typer.Option(metavar="X Y Z", help="Lower corner of the block of water in meters: -0.2 -0.2 1 or -0.2,-0.2,1."),
    ] = None
    block_max: Annotated[
        Vector | None, typer.Option(metavar="X Y Z", help="Upper corner of the block of water in meters.")
    ] = None
    container: Annotated[
        Vector | None,
        typer.Option(metavar="X Y Z", help="Sides of the container in meters; 1 1 2 by default."),
    ] = None
    shape: Annotated[str | None, typer.Option(help="Name of the shape in a DeepSDF with several.")] = None

    def check(self) -> None:
        """Look for what is wrong that can be seen without the libraries, which take two seconds to load.

        Raises:
            InputError: there is no such file, a scene file is none as a whole, or an option does not apply.
        """
        if self.source.suffix.lower() in SCENE_SUFFIXES:
            from surfsup.scene.scene_file import check_scene_file

            options = [field for field in fields(self) if field.name not in FOR_SCENE_FILES]
            given = [option.name for option in options if getattr(self, option.name) != option.default]
            if given:
                option = f"--{given[0].replace('_', '-')}"
                raise InputError(f"{self.source}: a scene file places everything itself; omit {option}")
            check_scene_file(self.source)
            return
        from surfsup.sdf.neural.shipped_surfaces import require_surface

        if (self.block_min is None) != (self.block_max is None):
            one, other, example = ("min", "max", "0.2 0.2 1.4") if self.block_min else ("max", "min", "-0.2 -0.2 1")
            raise InputError(
                f"--block-{one} is one corner of the block of water; give the opposite one, too, as in "
                f"--block-{other} {example}"
            )
        require_surface(self.source)

    def read(self) -> Scene:
        """Read the scene file, or build the scene of water on the surface and print how the surface is placed.

        Raises:
            InputError: a file is unusable, or an option does not apply.
        """
        self.check()
        from surfsup.scene import PARTICLE_RADIUS, Block, Container, Scene
        from surfsup.scene.from_surface import DEFAULT_FIT, Placement, scene_from_surface

        if self.source.suffix.lower() in SCENE_SUFFIXES:
            return self._with_changes(Scene.load(self.source))
        block = Block(self.block_min, self.block_max) if self.block_min and self.block_max else None
        container = Container(size=self.container) if self.container else Container()
        fit = DEFAULT_FIT if self.fit is None else self.fit
        at = self.at or (0.0, 0.0, 0.0)
        placement = Placement(None if self.no_fit else fit, self.up, self.turn, at, self.shape, self.thicken)
        radius = self.particle_radius or PARTICLE_RADIUS
        scene, summary = scene_from_surface(self.source, placement, container, block, self.frames or 800, radius)
        typer.echo(summary, err=True)
        return self._with_changes(scene)

    @contextmanager
    def named(self) -> Iterator[None]:
        """Within it, what is wrong with the scene is said with the name of its file."""
        try:
            yield
        except InputError as error:
            if self.source.suffix.lower() not in SCENE_SUFFIXES or str(self.source) in str(error):
                raise
            raise InputError(f"{self.source}: {error}") from None

    def named_while(self, frames: Iterator[Frame]) -> Iterator[Frame]:
        """The frames, likewise: a map of the solid is made when the first of them is computed."""
        with self.named():
            yield from frames

    def _with_changes(self, scene: Scene) -> Scene:
        from surfsup.io.trajectory_path import trajectory_path

        return scene.with_changes(
            particle_radius=self.particle_radius,
            fps=self.fps,
            duration=self.duration,
            frames=self.frames,
            restart=None if self.restart is None else trajectory_path(self.restart).resolve(),
        )
