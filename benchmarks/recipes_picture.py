"""The picture of docs/recipes.md: the first frame of trajectories, each under the name of its recipe.

python benchmarks/recipes_picture.py data/prim-shapes-test/00004.h5 data/funnels/00000.h5 -o recipes.png --columns 2
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

from surfsup.io.trajectory import Trajectory
from surfsup.viewing.label import label
from surfsup.viewing.trajectory_pictures import TrajectoryRenderer

SIZE = (340, 340)  # pixels of each


def picture(path: Path) -> np.ndarray:
    """The first frame of a trajectory, with its recipe's name."""
    recipe = yaml.safe_load((path.parent / "dataset.yaml").read_text())["recipe"]
    with Trajectory(path) as frames:
        renderer = TrajectoryRenderer(frames, SIZE)
        image = renderer.render(0)
        renderer.close()
    return label(image, recipe)


def main() -> None:
    """Draw them in rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trajectories", type=Path, nargs="+")
    parser.add_argument("--columns", type=int, default=6)
    parser.add_argument("-o", "--out", type=Path, required=True)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    pictures = [picture(path) for path in arguments.trajectories]
    rows = [pictures[first : first + arguments.columns] for first in range(0, len(pictures), arguments.columns)]
    whole = np.full((len(rows) * SIZE[1], len(rows[0]) * SIZE[0], 3), 255, dtype=np.uint8)
    for row, line in enumerate(rows):
        for column, image in enumerate(line):
            whole[row * SIZE[1] :, column * SIZE[0] :][: SIZE[1], : SIZE[0]] = image
    Image.fromarray(whole).save(arguments.out)


if __name__ == "__main__":
    main()
