"""`surfsup fit deepsdf`: many shapes as one network."""

from __future__ import annotations

from typing import Annotated

import typer

from surfsup.cli.fit_options import OutFile, Overrides, Resume, Threads, TimeLimit, UpAxis
from surfsup.cli.fit_run import carry_out, stop_after
from surfsup.cli.options import Seed
from surfsup.cli.progress import bar


def deepsdf(
    source: Annotated[
        str, typer.Argument(metavar="FOLDER", help="Meshes, a category of ShapeNetCore, or 'chairs' or 'bowls'.")
    ],
    out: OutFile,
    overrides: Overrides = None,
    count: Annotated[int | None, typer.Option("--shapes", "-n", min=1, help="How many shapes; all, or 500.")] = None,
    up: UpAxis = None,
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
    from surfsup.fitting.sample_file import load_samples, save_samples
    from surfsup.fitting.shape_set import shape_set
    from surfsup.sdf.neural.deepsdf import save_deepsdf

    torch.set_num_threads(threads)
    config = config_of(DeepSdfConfig, [*(overrides or []), f"seed={seed}"])
    stop = stop_after(time_limit)
    folder = fit_folder(out, resume)
    if resume:
        samples = load_samples(folder)
    else:
        shapes = shape_set(source, up, count)
        with bar(f"sampling {len(shapes.names)} shapes") as done:
            samples = draw_samples(shapes, config.seed, done)
        save_samples(folder, samples)
    fitting = DeepSdfFit(config, samples, folder)

    def write() -> list[str]:
        save_deepsdf(out, shapes_of(fitting, {"input": source, "command": f"surfsup fit deepsdf {source}"}))
        return [
            f"{len(samples.names)} shapes; mean error of the clamped distance {fitting.least:.2e} of a cube of side 2",
            f"written to {out}; pour water on one with: surfsup simulate {out} --shape {samples.names[0]}",
        ]

    carry_out(fitting, stop, resume, write)
