"""`surfsup fit`: networks that are surfaces."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.options import Seed
from surfsup.cli.status import INTERRUPTED
from surfsup.progress import bar, fitting_line

fit = typer.Typer(help="Fit networks that are surfaces: a SIREN to one shape, a DeepSDF to many.")

TimeLimit = Annotated[str, typer.Option("--time", help="Stop after so long: 90s, 30m, 2h.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on from where the last one stopped.")]
Threads = Annotated[int, typer.Option(min=1, help="Threads of torch.")]
Overrides = Annotated[list[str] | None, typer.Argument(metavar="key=value")]
OutFile = Annotated[Path, typer.Option("-o", "--out", help="The file of the surface, .safetensors.")]


@fit.command()
def siren(
    source: Annotated[
        Path, typer.Argument(metavar="INPUT", help="A mesh, a cloud of points with normals, or a scene file.")
    ],
    out: OutFile,
    overrides: Overrides = None,
    up: Annotated[str | None, typer.Option(help="The input's own upward axis, y or z.")] = None,
    time_limit: TimeLimit = "",
    resume: Resume = False,
    seed: Seed = 0,
    threads: Threads = 1,
) -> None:
    """Fit a network of sine layers to a mesh, to a cloud of points with normals (PLY, XYZ), or to a scene's solid.

    Example: surfsup fit siren dragon.obj --up y -o dragon.safetensors --time 15m --threads 2
    """
    import torch

    from surfsup.fitting.fit import config_of
    from surfsup.fitting.folder import fit_folder
    from surfsup.fitting.loop import Diverged, run
    from surfsup.fitting.siren_fit import SirenConfig, SirenFit
    from surfsup.fitting.siren_input import read_input
    from surfsup.fitting.siren_result import as_text, errors_of, surface_of
    from surfsup.sdf.siren import save_siren
    from surfsup.training.config import seconds_of
    from surfsup.training.stopping import Stop

    torch.set_num_threads(threads)
    config = config_of(SirenConfig, [*(overrides or []), f"seed={seed}"])
    stop = Stop(seconds_of(time_limit) if time_limit else float("inf"))
    folder = fit_folder(out, resume)
    target, shape = read_input(source, up, config.seed)
    fitting = SirenFit(config, target, folder)
    if resume:
        fitting.resume()
    failed: Diverged | None = None
    with stop, fitting_line() as tell:
        try:
            run(fitting, stop, tell)
        except Diverged as error:
            failed = error
        if fitting.best:
            about = {"input": source.name, "command": f"surfsup fit siren {source.name}"}
            surface, mesh = surface_of(fitting, about)
            if shape is not None:
                errors = errors_of(surface, mesh, shape, config.seed)
                surface.about["errors"] = as_text(errors)
            save_siren(out, surface)
    if failed is not None:
        raise failed
    if shape is not None:
        typer.echo(errors.text())
        if errors.parts > 1:
            warnings.warn(f"{out}: its mesh has {errors.parts} separate parts", stacklevel=1)
    typer.echo(f"{fitting.step} of {config.steps} steps in {fitting.processor_seconds:.0f} s of processor time")
    typer.echo(f"written to {out}; pour water on it with: surfsup simulate {out}")
    if stop.signalled:
        raise typer.Exit(INTERRUPTED)


@fit.command()
def deepsdf(
    source: Annotated[
        str, typer.Argument(metavar="FOLDER", help="Meshes, a category of ShapeNetCore, or 'chairs' or 'bowls'.")
    ],
    out: OutFile,
    overrides: Overrides = None,
    count: Annotated[int | None, typer.Option("--shapes", "-n", min=1, help="How many shapes; all, or 500.")] = None,
    up: Annotated[str | None, typer.Option(help="The meshes' own upward axis, y or z.")] = None,
    time_limit: TimeLimit = "",
    resume: Resume = False,
    seed: Seed = 0,
    threads: Threads = 1,
) -> None:
    """Fit one network and a latent code each to many shapes: a folder of meshes, or the project's own.

    Example: surfsup fit deepsdf chairs --shapes 500 -o chairs.safetensors --time 2h
    """
    import torch

    from surfsup.fitting.deepsdf_fit import DeepSdfConfig, DeepSdfFit, draw_samples, shapes_of
    from surfsup.fitting.fit import config_of
    from surfsup.fitting.folder import fit_folder
    from surfsup.fitting.loop import Diverged, run
    from surfsup.fitting.sample_file import load_samples, save_samples
    from surfsup.fitting.shape_set import shape_set
    from surfsup.sdf.deepsdf import save_deepsdf
    from surfsup.training.config import seconds_of
    from surfsup.training.stopping import Stop

    torch.set_num_threads(threads)
    config = config_of(DeepSdfConfig, [*(overrides or []), f"seed={seed}"])
    stop = Stop(seconds_of(time_limit) if time_limit else float("inf"))
    folder = fit_folder(out, resume)
    if resume:
        samples = load_samples(folder)
    else:
        shapes = shape_set(source, up, count)
        with bar(f"sampling {len(shapes.names)} shapes") as done:
            samples = draw_samples(shapes, config.seed, done)
        save_samples(folder, samples)
    fitting = DeepSdfFit(config, samples, folder)
    if resume:
        fitting.resume()
    failed: Diverged | None = None
    with stop, fitting_line() as tell:
        try:
            run(fitting, stop, tell)
        except Diverged as error:
            failed = error
        if fitting.best:
            save_deepsdf(out, shapes_of(fitting, {"input": source, "command": f"surfsup fit deepsdf {source}"}))
    if failed is not None:
        raise failed
    typer.echo(
        f"{len(samples.names)} shapes; mean error of the clamped distance {fitting.least:.2e} of a cube of side 2"
    )
    typer.echo(f"{fitting.step} of {config.steps} steps in {fitting.processor_seconds:.0f} s of processor time")
    typer.echo(f"written to {out}; pour water on one with: surfsup simulate {out} --shape {samples.names[0]}")
    if stop.signalled:
        raise typer.Exit(INTERRUPTED)
