"""`surfsup fit deepsdf`: many shapes as one network."""

from __future__ import annotations

from typing import Annotated

import typer

from surfsup.cli.fit_options import FitOptions, run_and_write
from surfsup.cli.locks import hold_lock
from surfsup.cli.options import stop_after
from surfsup.cli.progress import progress_bar


def deepsdf(
    source: Annotated[
        str, typer.Argument(metavar="FOLDER", help="Meshes, a category of ShapeNetCore, or 'chairs' or 'bowls'.")
    ],
    options: FitOptions,
    count: Annotated[
        int | None, typer.Option("--shapes", "-n", min=1, help="Number of shapes; by default all, or 500.")
    ] = None,
) -> None:
    """Fit one network to many shapes.

    Each shape gets a latent code. The shapes are a folder of meshes, or procedural ones.

    Example: surfsup fit deepsdf chairs --shapes 500 -o chairs.safetensors --time 2h
    """
    from surfsup.fitting.deepsdf_fit import (
        DeepSdfConfig,
        DeepSdfFit,
        fitted_shapes,
        load_samples,
        sample_shapes,
        save_samples,
    )
    from surfsup.fitting.fit import fit_folder
    from surfsup.fitting.shape_set import open_shape_set
    from surfsup.sdf.neural.deepsdf import save_deepsdf

    config = options.configure(DeepSdfConfig)
    stop = stop_after(options.time_limit)
    folder = fit_folder(options.out, options.resume)
    hold_lock(folder)
    if options.resume:
        samples = load_samples(folder)
    else:
        shapes = open_shape_set(source, options.up, count)
        with progress_bar(f"sampling {len(shapes.names)} shapes") as bar:
            samples = sample_shapes(shapes, config.seed, bar)
        save_samples(folder, samples)
    fit = DeepSdfFit(config, samples, folder)

    def write() -> list[str]:
        save_deepsdf(options.out, fitted_shapes(fit, {"input": source, "command": f"surfsup fit deepsdf {source}"}))
        return [
            f"{len(samples.names)} shapes; mean error of the clamped distance {fit.best_score:.2e} in a cube of side 2",
            f"written to {options.out}; pour water on one with: "
            f"surfsup simulate {options.out} --shape {samples.names[0]}",
        ]

    run_and_write(fit, stop, options.resume, write)
