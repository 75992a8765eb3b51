"""`surfsup fit code` and `surfsup fit between`: the latent code of a shape, and shapes between two codes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.options import Seed, SurfaceFile, UpAxis
from surfsup.cli.progress import progress_bar

ShapesFile = Annotated[
    Path, typer.Argument(metavar="SHAPES", help="A DeepSDF: a file of 'surfsup fit deepsdf', or chairs or bowls.")
]


def code(
    shapes: ShapesFile,
    source: Annotated[Path, typer.Argument(metavar="MESH", help="A shape that the DeepSDF was not fitted to.")],
    out: SurfaceFile,
    up: UpAxis = None,
    seed: Seed = 0,
) -> None:
    """Reconstruct a shape by optimizing its latent code.

    The DeepSDF was fitted to other shapes.

    Example: surfsup fit code chairs.safetensors stool.obj -o stool.safetensors
    """
    import numpy as np

    from surfsup.fitting.deepsdf_fit import sample_shape
    from surfsup.fitting.exact_shape import ExactMesh
    from surfsup.fitting.reconstruct import reconstruct
    from surfsup.sdf import DeepSdf, load_deepsdf, load_mesh, save_deepsdf

    deepsdf = load_deepsdf(shapes)
    points, distance = sample_shape(ExactMesh(load_mesh(source, up=up)), np.random.default_rng(seed))
    with progress_bar(f"optimizing the code of {source.stem}") as bar:
        result = reconstruct(deepsdf, points, distance, seed, bar)
    about = {"input": source.name, "shapes": shapes.name, "seed": seed, "error": result.error}
    save_deepsdf(out, DeepSdf(deepsdf.network, result.code[None], [source.stem], about, str(out)))
    typer.echo(
        f"mean error of the clamped distance {result.error:.2e} in a cube of side 2; started from '{result.nearest}'"
    )
    typer.echo(f"written to {out}; pour water on it with: surfsup simulate {out}")


def between(
    shapes: ShapesFile,
    first: Annotated[str, typer.Argument(metavar="FIRST", help="Name of the first shape.")],
    second: Annotated[str, typer.Argument(metavar="LAST", help="Name of the last shape.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Output folder; out/FIRST-LAST by default.")] = None,
    steps: Annotated[int, typer.Option(min=2, help="Number of shapes, including the first and the last.")] = 9,
    whole: Annotated[
        bool, typer.Option("--whole", help="Pass through known shapes, so that every step is one closed mesh.")
    ] = False,
) -> None:
    """Show the shapes between two latent codes.

    The folder gets a page with a slider, a strip of pictures, and the meshes.

    Example: surfsup fit between chairs chair-0007 chair-0134 --whole -o out/chairs
    """
    from surfsup.fitting.connected_path import interpolate_connected
    from surfsup.fitting.interpolate import interpolate
    from surfsup.sdf import load_deepsdf
    from surfsup.viewing.graphics import require_graphics
    from surfsup.viewing.slider import render_solid, write_slider, write_strip

    require_graphics()
    deepsdf = load_deepsdf(shapes)
    ends = deepsdf.code(first), deepsdf.code(second)
    folder = out or Path("out") / f"{first}-{second}"
    folder.mkdir(parents=True, exist_ok=True)
    pictures, captions, shares = [], [], []
    solids = interpolate_connected(deepsdf, first, second, steps) if whole else interpolate(deepsdf, *ends, steps)
    with progress_bar(f"from {first} to {second}") as bar:
        for number, solid in enumerate(solids):
            pictures.append(render_solid(solid.mesh))
            state = "one closed mesh" if solid.whole else f"{solid.parts} parts{'' if solid.closed else ', not closed'}"
            captions.append(f"{solid.fraction:.0%} of the way: {state}")
            shares.append(f"{solid.fraction:.0%}")
            if solid.mesh is not None:
                solid.mesh.export(folder / f"step-{number}.ply")
            bar(number + 1, steps)
    write_slider(folder / "page.html", pictures, captions, f"From {first} to {second}")
    write_strip(folder / "strip.png", pictures, [first, *shares[1:-1], second])
    for caption in captions:
        typer.echo(caption)
    typer.echo(f"page   {folder / 'page.html'}  (open it in a browser, no network needed)")
    typer.echo(f"strip  {folder / 'strip.png'}")
