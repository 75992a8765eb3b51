"""`surfsup fit siren`: one shape as a network."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.fit_options import MIN_STEP_SHARE, FitOptions, run_and_write
from surfsup.cli.locks import hold_lock
from surfsup.cli.options import stop_after


def siren(
    source: Annotated[
        Path, typer.Argument(metavar="INPUT", help="A mesh, a point cloud with normals, or a scene file.")
    ],
    options: FitOptions,
) -> None:
    """Fit a network of sine layers to one shape.

    The shape is a mesh, a point cloud with normals (PLY, XYZ), or the solid of a scene.

    Example: surfsup fit siren dragon.obj --up y -o dragon.safetensors --time 15m --threads 2
    """
    from surfsup.fitting.fit import fit_folder
    from surfsup.fitting.siren_fit import SirenConfig, SirenFit
    from surfsup.fitting.siren_input import load_target
    from surfsup.fitting.siren_result import fitted_surface, measure_errors
    from surfsup.sdf.neural.siren import save_siren

    config = options.configure(SirenConfig)
    stop = stop_after(options.time_limit)
    folder = fit_folder(options.out, options.resume)
    hold_lock(folder)
    typer.echo("sampling the shape; the fit begins after that, and so does --time", err=True)
    target, shape = load_target(source, options.up, config.samples, config.seed)
    fit = SirenFit(config, target, folder)

    def write() -> list[str]:
        lines = []
        surface, mesh = fitted_surface(fit, {"input": source.name, "command": f"surfsup fit siren {source.name}"})
        if shape is not None:
            errors = measure_errors(surface, mesh, shape, config.seed)
            surface.about["errors"] = errors.rounded()
            lines.append(errors.text())
            if errors.parts > 1:
                warnings.warn(f"{options.out}: its mesh has {errors.parts} separate parts", stacklevel=1)
        save_siren(options.out, surface)
        rough = fit.step < MIN_STEP_SHARE * fit.config.steps
        use = "" if rough else f"; pour water on it with: surfsup simulate {options.out}"
        return [*lines, f"written to {options.out}{use}"]

    run_and_write(fit, stop, options.resume, write)
