"""`surfsup fit code` and `surfsup fit between`: a shape by its latent code, and what lies between two codes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.fit_options import OutFile, UpAxis
from surfsup.cli.options import Seed
from surfsup.cli.progress import bar

ShapesFile = Annotated[Path, typer.Argument(metavar="SHAPES", help="What 'surfsup fit deepsdf' wrote; chairs; bowls.")]


def code(
    shapes: ShapesFile,
    source: Annotated[Path, typer.Argument(metavar="MESH", help="A shape that it was not fitted to.")],
    out: OutFile,
    up: UpAxis = None,
    seed: Seed = 0,
) -> None:
    """Reconstruct a shape that a DeepSDF was not fitted to, by optimizing its latent code.

    Example: surfsup fit code chairs.safetensors stool.obj -o stool.safetensors
    """
    import numpy as np

    from surfsup.fitting.deepsdf_fit import samples_of
    from surfsup.fitting.exact import ExactMesh
    from surfsup.fitting.reconstruct import reconstruct
    from surfsup.sdf import DeepSdf, load_deepsdf, load_mesh, save_deepsdf

    known = load_deepsdf(shapes)
    points, distance = samples_of(ExactMesh(load_mesh(source, up=up)), np.random.default_rng(seed))
    with bar(f"looking for the code of {source.stem}") as tell:
        found = reconstruct(known, points, distance, seed, tell)
    about = {"input": source.name, "shapes": shapes.name, "seed": seed, "error": found.error}
    save_deepsdf(out, DeepSdf(known.network, found.code[None], [source.stem], about, str(out)))
    typer.echo(f"mean error of the clamped distance {found.error:.2e}, in a cube of side 2; began at '{found.nearest}'")
    typer.echo(f"written to {out}; pour water on it with: surfsup simulate {out}")


def between(
    shapes: ShapesFile,
    first: Annotated[str, typer.Argument(help="Name of the shape to begin with.")],
    second: Annotated[str, typer.Argument(help="Name of the shape to end with.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Output folder; out/FIRST-SECOND.")] = None,
    steps: Annotated[int, typer.Option(min=2, help="Shapes to show, both ends among them.")] = 9,
    whole: Annotated[
        bool, typer.Option("--whole", help="Go by way of known shapes, so that every step is one closed mesh.")
    ] = False,
) -> None:
    """Show the shapes between two latent codes: a page with a slider, a strip of pictures, and their meshes.

    Example: surfsup fit between chairs chair-0153 chair-0134 --whole -o out/chairs
    """
    from surfsup.fitting.interpolate import interpolate
    from surfsup.fitting.way import whole_way
    from surfsup.sdf import load_deepsdf
    from surfsup.viewing.graphics import require_graphics
    from surfsup.viewing.slider import picture_of_solid, write_slider, write_strip

    require_graphics()
    known = load_deepsdf(shapes)
    ends = known.code(first), known.code(second)
    folder = out or Path("out") / f"{first}-{second}"
    folder.mkdir(parents=True, exist_ok=True)
    pictures, captions = [], []
    solids = whole_way(known, first, second, steps) if whole else interpolate(known, *ends, steps)
    with bar(f"from {first} to {second}") as tell:
        for number, one in enumerate(solids):
            pictures.append(picture_of_solid(one.mesh))
            state = "one closed mesh" if one.whole else f"{one.parts} parts{'' if one.closed else ', not closed'}"
            captions.append(f"{one.share:.0%} of the way: {state}")
            if one.mesh is not None:
                one.mesh.export(folder / f"step-{number}.ply")
            tell(number + 1, steps)
    write_slider(folder / "page.html", pictures, captions, f"From {first} to {second}")
    write_strip(folder / "strip.png", pictures)
    for caption in captions:
        typer.echo(caption)
    typer.echo(f"page   {folder / 'page.html'}  (open it in a browser, no network needed)")
    typer.echo(f"strip  {folder / 'strip.png'}")
