"""`surfsup fit siren`: one shape as a network."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.fit_options import OutFile, Overrides, Resume, Threads, TimeLimit, UpAxis
from surfsup.cli.fit_run import carry_out, stop_after
from surfsup.cli.options import Seed


def siren(
    source: Annotated[
        Path, typer.Argument(metavar="INPUT", help="A mesh, a cloud of points with normals, or a scene file.")
    ],
    out: OutFile,
    overrides: Overrides = None,
    up: UpAxis = None,
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
    from surfsup.fitting.siren_fit import SirenConfig, SirenFit
    from surfsup.fitting.siren_input import read_input
    from surfsup.fitting.siren_result import as_text, errors_of, surface_of
    from surfsup.sdf.neural.siren import save_siren

    torch.set_num_threads(threads)
    config = config_of(SirenConfig, [*(overrides or []), f"seed={seed}"])
    stop = stop_after(time_limit)
    folder = fit_folder(out, resume)
    target, shape = read_input(source, up, config.samples, config.seed)
    fitting = SirenFit(config, target, folder)

    def write() -> list[str]:
        told = []
        surface, mesh = surface_of(fitting, {"input": source.name, "command": f"surfsup fit siren {source.name}"})
        if shape is not None:
            errors = errors_of(surface, mesh, shape, config.seed)
            surface.about["errors"] = as_text(errors)
            told.append(errors.text())
            if errors.parts > 1:
                warnings.warn(f"{out}: its mesh has {errors.parts} separate parts", stacklevel=1)
        save_siren(out, surface)
        return [*told, f"written to {out}; pour water on it with: surfsup simulate {out}"]

    carry_out(fitting, stop, resume, write)
