"""The pictures of the examples in the docs, and the one that moves at the top, from trajectories.

    surfsup simulate examples/knot.obj -o out/knot
    surfsup examples honey -o out/honey
    surfsup examples boat -o out/boat
    surfsup examples pour-from-a-cup -o out/pour
    surfsup examples water-wheel -o out/wheel
    surfsup examples oil-and-water -o out/oil
    python examples/robot_pours.py -o out/robot.h5
    python benchmarks/example_pictures.py hero out/knot/trajectory.h5
    python benchmarks/example_pictures.py honey out/honey/trajectory.h5
    python benchmarks/example_pictures.py boat out/boat/trajectory.h5
    python benchmarks/example_pictures.py pour-from-a-cup out/pour/trajectory.h5
    python benchmarks/example_pictures.py water-wheel out/wheel/trajectory.h5
    python benchmarks/example_pictures.py oil-and-water out/oil/trajectory.h5
    python benchmarks/example_pictures.py robot out/robot.h5
    python benchmarks/example_pictures.py sheet out/knot/trajectory.h5 -o sheet.png     # 12 frames of any trajectory

A strip shows some frames side by side. It is not compressed with losses; the moving picture is, at a quality at which
blocks do not show.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from record import ROOT
from surfsup.io.trajectory import Trajectory
from surfsup.viewing.camera import DEFAULT_DIRECTION, ViewDirection
from surfsup.viewing.shadow_maps import FULL_LIGHT
from surfsup.viewing.trajectory_pictures import Moment, TrajectoryRenderer

IMAGES = ROOT / "docs" / "images"
HERO_SIZE, HERO_FRAMES, HERO_STRIDE, HERO_QUALITY = (640, 480), 80, 8, 88
SHEET, SHEET_COLUMNS = 12, 4
COLORS = 256  # of a strip


@dataclass(frozen=True)
class Strip:
    """Frames side by side.

    Attributes:
        seconds: of the frames.
        size: (width, height) of each in pixels.
        direction: of the camera.
    """

    seconds: tuple[float, ...]
    size: tuple[int, int]
    direction: ViewDirection = DEFAULT_DIRECTION


STRIPS = {
    "boat": Strip((0.9, 2.9), (620, 368), ViewDirection(-59.83, 21.91, 1.02)),
    "honey": Strip((0.5, 1.2, 2.4, 3.9), (400, 460), ViewDirection(-59.83, 21.91, 1.3)),
    "pour-from-a-cup": Strip((0.0, 3.3, 3.9, 4.5), (400, 420), ViewDirection(-70.0, 24.0, 1.1)),
    "water-wheel": Strip((1.0, 2.2), (640, 520), ViewDirection(-72.0, 14.0, 1.05)),
    "oil-and-water": Strip((0.6, 1.2, 3.9), (440, 360)),
    "robot": Strip((0.3, 3.05, 3.4), (480, 400), ViewDirection(-80.0, 10.0, 1.1)),
}


def strip(trajectory: Trajectory, shown: Strip) -> Image.Image:
    """The frames of a strip side by side."""
    renderer = TrajectoryRenderer(trajectory, shown.size, shown.direction)
    last = len(trajectory) - 1
    frames = [min(last, round(second / trajectory.frame_time)) for second in shown.seconds]
    pictures = [renderer.render(frame, light=FULL_LIGHT) for frame in frames]
    renderer.close()
    image = Image.fromarray(np.hstack(pictures))
    # Dithering needs a palette: without it smooth colors become bands.
    return image.quantize(palette=image.quantize(COLORS), dither=Image.Dither.FLOYDSTEINBERG)


def sheet(trajectory: Trajectory) -> Image.Image:
    """Frames from the first to the last, row by row."""
    renderer = TrajectoryRenderer(trajectory, (480, 360))
    frames = np.linspace(0, len(trajectory) - 1, SHEET).round().astype(int).tolist()
    pictures = list(renderer.render_many(Moment(frame, trajectory.positions[frame]) for frame in frames))
    renderer.close()
    rows = [np.hstack(pictures[first : first + SHEET_COLUMNS]) for first in range(0, SHEET, SHEET_COLUMNS)]
    return Image.fromarray(np.vstack(rows))


def write_hero(trajectory: Trajectory, path: Path) -> None:
    """The picture that moves, in real time."""
    renderer = TrajectoryRenderer(trajectory, HERO_SIZE)
    frames = range(0, HERO_STRIDE * HERO_FRAMES, HERO_STRIDE)
    pictures = [
        Image.fromarray(picture)
        for picture in renderer.render_many(Moment(frame, trajectory.positions[frame]) for frame in frames)
    ]
    renderer.close()
    duration = round(1000 * HERO_STRIDE * trajectory.frame_time)
    pictures[0].save(
        path, save_all=True, append_images=pictures[1:], duration=duration, loop=0, quality=HERO_QUALITY, method=6
    )


def main() -> None:
    """Draw one picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=["hero", "sheet", *STRIPS])
    parser.add_argument("trajectory", type=Path)
    parser.add_argument("-o", "--out", type=Path)
    arguments = parser.parse_args()
    suffix = "webp" if arguments.name == "hero" else "png"
    out = arguments.out or IMAGES / f"{arguments.name}.{suffix}"
    with Trajectory(arguments.trajectory) as trajectory:
        if arguments.name == "hero":
            write_hero(trajectory, out)
        elif arguments.name == "sheet":
            sheet(trajectory).save(out)
        else:
            strip(trajectory, STRIPS[arguments.name]).save(out, optimize=True)
    print(f"{out}  {out.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
