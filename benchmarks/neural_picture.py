"""A picture for the page: the mesh that a SIREN was fitted to, the mesh of its zero, and water on the SIREN.

    python benchmarks/neural_picture.py dragon.safetensors dragon.obj trajectory.h5 -o fit.png [--up y] [--frame 150]

The trajectory is one of the same SIREN, for instance of `surfsup simulate dragon.safetensors`.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np
from PIL import Image

from surfsup.fitting.exact_shape import to_cube
from surfsup.io.trajectory import Trajectory
from surfsup.sdf import load_mesh, load_siren
from surfsup.viewing.label import label
from surfsup.viewing.slider import SIZE, render_solid
from surfsup.viewing.trajectory_pictures import TrajectoryRenderer

RESOLUTION = 192  # cells of the extracted mesh along the cube


def main() -> None:
    """Draw the three beside each other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("siren", type=Path)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("trajectory", type=Path)
    parser.add_argument("--frame", type=int, default=150)
    parser.add_argument("--up", choices=("y", "z"))
    parser.add_argument("-o", "--out", type=Path, required=True)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    siren, mesh = load_siren(arguments.siren), load_mesh(arguments.mesh, up=arguments.up)
    mesh.vertices = to_cube(np.asarray(mesh.vertices), siren.normalization)
    extracted = siren.to_mesh(RESOLUTION)
    with Trajectory(arguments.trajectory) as frames:
        renderer = TrajectoryRenderer(frames, SIZE)
        water = renderer.render(arguments.frame)
        renderer.close()
    pictures = [
        label(render_solid(mesh), f"the mesh, {len(mesh.faces):,} triangles"),
        label(render_solid(extracted), f"the zero of the network, {arguments.siren.stat().st_size / 1000:.0f} kB"),
        label(water, "water on the network"),
    ]
    Image.fromarray(np.hstack(pictures)).save(arguments.out)


if __name__ == "__main__":
    main()
