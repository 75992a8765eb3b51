"""The water pictures of docs/inverse-design.md: first and best design, by the DFSPH solver and by the reference.

python benchmarks/design_picture.py out/design/bowl -o docs/images/design-bowl-water.png
python benchmarks/design_picture.py out/design/funnel --floor 0.06 -o docs/images/design-funnel-water.png

The solids are cut open in front; each of the four is seen in its last frame, as they stand in the design's folder. With
a floor, at which particles are scored, all landed particles lie where they first landed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from surfsup.design.verification import final_positions
from surfsup.design.video import RESOLUTION, cut_open
from surfsup.io.trajectory import Trajectory
from surfsup.scene import PARTICLE_RADIUS
from surfsup.sdf import MeshSurface, load_mesh
from surfsup.viewing.label import label
from surfsup.viewing.renderer import FrameRenderer

DESIGNS = ("first", "best")
SIMULATORS = {"dfsph": "surfsup dfsph", "reference": "SPlisHSPlasH"}
SIZE = (560, 420)  # pixels of each


def picture(folder: Path, design: str, simulator: str, floor: float | None) -> np.ndarray:
    """The last frame of one design's water by one of the simulators."""
    mesh = load_mesh(folder / design / "shape.obj", up="z")
    with torch.no_grad():
        solid = cut_open(MeshSurface(mesh)).to_mesh(RESOLUTION)
    with Trajectory(folder / design / f"{simulator}.h5") as frames:
        size, first = frames.scene.container.size, frames.positions[0]
        renderer = FrameRenderer(solid, size, PARTICLE_RADIUS, first, SIZE)
        image = renderer.render(final_positions(frames.positions, floor)[0].numpy())
        renderer.close()
        return label(image, f"{design}, cut open, {SIMULATORS[simulator]}, frame {len(frames) - 1}")


def main() -> None:
    """Draw the four, a simulator a row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of a verified design")
    parser.add_argument("--floor", type=float, help="height in meters at which particles land")
    parser.add_argument("-o", "--out", type=Path, required=True)
    arguments = parser.parse_args()
    rows = [
        [picture(arguments.folder, design, simulator, arguments.floor) for design in DESIGNS]
        for simulator in SIMULATORS
    ]
    Image.fromarray(np.concatenate([np.concatenate(row, axis=1) for row in rows])).save(arguments.out)


if __name__ == "__main__":
    main()
