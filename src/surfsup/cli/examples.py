"""`surfsup examples`: the scenes that ship."""

from __future__ import annotations

from typing import Annotated

import typer

from surfsup.cli.output_options import OutputOptions
from surfsup.cli.scene_options import SceneOptions
from surfsup.cli.simulate import simulate


def names() -> list[str]:
    """The names, for the completion of the shell."""
    from surfsup.scene.examples import example_files

    return list(example_files())


def examples(
    output: OutputOptions,
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="The example to simulate.", autocompletion=names)
    ] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="Number of frames; the scene's by default.")] = None,
) -> None:
    """List the scenes that ship, or simulate one.

    Example: surfsup examples teacup -o out/teacup
    """
    from surfsup.scene.examples import description, example_file, example_files

    if name is not None:
        simulate(SceneOptions(source=example_file(name), frames=frames), output)
        return
    files = example_files()
    width = max(map(len, files), default=0)
    for known, path in files.items():
        typer.echo(f"{known:{width}}  {description(path)}")
    if files:
        typer.echo(f"\nsurfsup examples NAME simulates one; the files are in {next(iter(files.values())).parent}")
