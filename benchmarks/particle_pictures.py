"""Exported particles in the programs that read them: VTK's readers, NumPy, and splashsurf, from VTK and from BGEO.

    surfsup simulate examples/knot.obj -o out/knot
    python benchmarks/particle_pictures.py out/knot

Exports the trajectory as VTK, NPZ and BGEO and draws one frame four times: the particles as VTK's reader of legacy
files has them, which is ParaView's, colored by their speed; those of NumPy; and the surfaces that splashsurf's own
command makes of the VTK and the BGEO files. All are drawn by VTK. Writes `docs/images/export-particles.png`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyvista
from PIL import Image

import surfsup as sf
from record import ROOT

SIZE, FRAME = (400, 360), 17
COMMAND = "from pysplashsurf import run_pysplashsurf; run_pysplashsurf()"
PARAMETERS = ["--particle-radius=0.015", "--smoothing-length=2.0", "--cube-size=0.7", "--normals=on",
              "--mesh-smoothing-weights=on", "--mesh-smoothing-iters=20", "--normals-smoothing-iters=8"]  # fmt: skip


def main() -> None:
    """Export, open and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trajectory", type=Path)
    parser.add_argument("-o", "--out", type=Path, default=ROOT / "docs" / "images" / "export-particles.png")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for form in ("vtk", "npz", "bgeo"):
            sf.export(arguments.trajectory, form, folder, fps=24)
        sf.export(arguments.trajectory, "vtk", folder, fps=24, what="solid")
        solid = pyvista.read(folder / "solid.vtk")
        pictures = [picture(shape, solid) for shape in shapes(folder)]
    joined = Image.fromarray(np.hstack(pictures))
    joined.quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(arguments.out, optimize=True)


def shapes(folder: Path) -> list[pyvista.DataSet]:
    """One frame as each program has it."""
    particles = pyvista.read(folder / f"particles.{FRAME:04d}.vtk")
    with np.load(folder / f"particles.{FRAME:04d}.npz") as archive:
        by_numpy = pyvista.PolyData(archive["positions"])
        by_numpy["velocity"] = archive["velocities"]
    surfaces = [surface(folder / f"particles.{FRAME:04d}.{suffix}") for suffix in ("vtk", "bgeo")]
    return [particles, by_numpy, *surfaces]


def surface(particles: Path) -> pyvista.DataSet:
    """The surface that splashsurf's command makes of a file of particles."""
    out = particles.with_name(f"splashsurf-{particles.suffix[1:]}.vtk")
    command = [sys.executable, "-c", COMMAND, "reconstruct", particles, *PARAMETERS, "--output-file", out]
    subprocess.run(command, check=True, capture_output=True)
    return pyvista.read(out)


def picture(shape: pyvista.DataSet, solid: pyvista.DataSet) -> np.ndarray:
    """Particles or a surface, and the solid, drawn by VTK."""
    plotter = pyvista.Plotter(off_screen=True, window_size=SIZE)
    plotter.set_background("white", top="lightsteelblue")
    plotter.add_mesh(solid, color="peru", smooth_shading=True)
    if "velocity" in shape.point_data:
        shape["speed"] = np.linalg.norm(shape["velocity"], axis=1)
        plotter.add_mesh(shape, scalars="speed", cmap="viridis", style="points", point_size=5.0,
                         render_points_as_spheres=True, show_scalar_bar=False)  # fmt: skip
    else:
        plotter.add_mesh(shape, color="deepskyblue", opacity=0.75, smooth_shading=True)
    plotter.camera_position = [(1.7, -2.6, 1.5), (0, 0, 0.3), (0, 0, 1)]
    plotter.camera.zoom(1.35)
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return np.asarray(image)


if __name__ == "__main__":
    main()
