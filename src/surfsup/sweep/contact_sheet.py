"""The contact sheet of a sweep: a small picture of every case, with its varied values below."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from surfsup.io.atomic_file import atomic_file
from surfsup.io.trajectory import Trajectory
from surfsup.sweep.case import Case
from surfsup.viewing.label import label
from surfsup.viewing.shadow_maps import FULL_LIGHT
from surfsup.viewing.trajectory_pictures import TrajectoryRenderer

SIZE = (320, 240)  # pixels of a picture
COLUMNS = 5
MOMENTS = (0.5, 0.75, 1.0)  # of the duration
SAME = 0.1  # particle radii; cases look the same whose water differs by less in place and extent
WHITE = 255


def write_contact_sheet(
    folder: Path, cases: Sequence[Case], progress: Callable[[int, int], None] = lambda done, total: None
) -> Path:
    """Draw the water of every finished case at the same part of its time; returns the path of the sheet.

    That is half of it, or later, where some cases would look the same. A picture that is there already is used again.

    Raises:
        InputError: this machine cannot render off screen.
    """
    tiles, moment = [], distinct_moment(folder, cases)
    for number, case in enumerate(cases, start=1):
        tiles.append(label(picture_of(folder / case.name, moment), caption(case)))
        progress(number, len(cases))
    columns = min(COLUMNS, len(tiles))
    blank = np.full_like(tiles[0], WHITE)
    tiles += [blank] * (math.ceil(len(tiles) / columns) * columns - len(tiles))
    rows = [np.hstack(tiles[first : first + columns]) for first in range(0, len(tiles), columns)]
    sheet = folder / "contact-sheet.png"
    with atomic_file(sheet) as partial:
        Image.fromarray(np.vstack(rows)).save(partial, format="PNG")
    return sheet


def distinct_moment(folder: Path, cases: Sequence[Case]) -> float:
    """The first of MOMENTS at which no two cases look the same, or the last one."""
    for moment in MOMENTS:
        waters = np.array([water_of(folder / case.name, moment) for case in cases])
        apart = np.abs(waters[:, None] - waters).max(axis=2)
        if (apart[~np.eye(len(cases), dtype=bool)] > SAME).all():
            return moment
    return MOMENTS[-1]


def water_of(folder: Path, moment: float) -> np.ndarray:
    """Middle and extent (6,) of the water of a case, in particle radii; zeros without water."""
    with Trajectory(folder / "trajectory.h5") as trajectory:
        frame = frame_at(trajectory, moment)
        positions = trajectory.positions[frame][trajectory.ids(frame)] / trajectory.radius
    if not len(positions):
        return np.zeros(6)
    return np.concatenate([positions.mean(axis=0), positions.std(axis=0)])


def frame_at(trajectory: Trajectory, moment: float) -> int:
    """The frame at a part of the duration."""
    return round(moment * (len(trajectory) - 1))


def picture_of(folder: Path, moment: float) -> np.ndarray:
    """The picture (height, width, 3) uint8 of a case at a part of its duration."""
    picture = folder / f"picture-{100 * moment:.0f}.png"
    if picture.exists():
        return np.asarray(Image.open(picture).convert("RGB"))
    with Trajectory(folder / "trajectory.h5") as trajectory:
        renderer = TrajectoryRenderer(trajectory, SIZE)
        image = renderer.render(frame_at(trajectory, moment), light=FULL_LIGHT)
        renderer.close()
    with atomic_file(picture) as partial:
        Image.fromarray(image).save(partial, format="PNG")
    return image


def caption(case: Case) -> str:
    """The varied values of a case, keys shortened to their last word."""
    values = [
        f"{short(key)} {value:.4g}" if isinstance(value, float) else f"{short(key)} {value}"
        for key, value in case.values.items()
    ]
    return ", ".join(values) or case.name


def short(key: str) -> str:
    """The last word of a key with the numbers that follow it: ``gravity.2`` stays, ``fluid.0.block`` is ``block``."""
    steps = key.split(".")
    words = [number for number, step in enumerate(steps) if not step.isdecimal()]
    return ".".join(steps[words[-1] :]) if words else key
