"""The video of a design: the first design's water, how the shape then changes, the best design's water.

The solid is cut open in front, so that the water in it can be seen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import torch

from surfsup.design.parameter import Values
from surfsup.design.proof import learned_frames
from surfsup.design.run import DesignRun
from surfsup.design.task import told
from surfsup.scene import PARTICLE_RADIUS
from surfsup.sdf import Box, Difference, Surface, Transformed, axis_rotation
from surfsup.viewing.label import label
from surfsup.viewing.render import FrameRenderer
from surfsup.viewing.video import write_video

DESIGNS = 24  # that show how the shape changes
MOMENTS = 17  # of the first and of the best design's water
HOLD = 2  # video frames that each picture stays
SIZE = (800, 600)  # pixels
RESOLUTION = 112
FRONT_DEGREES = -30.0  # about z: where the camera of `surfsup.viewing` stands


def write_film(run: DesignRun, path: Path, tell: Callable[[int, int], None]) -> Path:
    """Draw the run as a video at ``path``; returns it.

    Raises:
        InputError: this machine cannot draw.
    """
    chosen = along_the_way(run)
    moments = np.unique(np.linspace(0, run.task.scene.frames - 1, MOMENTS).round().astype(int)).tolist()
    total = HOLD * (2 * len(moments) + len(chosen))
    pictures = (picture for picture in scenes(run, chosen, moments) for _ in range(HOLD))
    write_video(path, pictures, progress=tell, total=total)
    return path


def along_the_way(run: DesignRun) -> list[int]:
    """The numbers of designs up to the best, evenly spaced by how far the shape has changed."""
    places = torch.stack([run.ascent.coordinates.place(design) for design in run.designs[: run.best + 1]])
    traveled = torch.cat([torch.zeros(1), (places[1:] - places[:-1]).norm(dim=1)]).cumsum(0)
    marks = torch.linspace(0, float(traveled[-1]), DESIGNS)
    return torch.searchsorted(traveled, marks).clamp(max=run.best).unique().tolist()


def scenes(run: DesignRun, chosen: list[int], moments: list[int]) -> Iterator[np.ndarray]:
    """The pictures in their order."""
    yield from pour(run, 0, moments)
    for number in chosen:
        yield from pour(run, number, moments[-1:])
    yield from pour(run, run.best, moments)


def pour(run: DesignRun, number: int, moments: list[int]) -> Iterator[np.ndarray]:
    """Pictures of those frames of the water in design ``number``."""
    values, task = run.designs[number], run.task
    renderer = renderer_of(run, values)
    text = f"iteration {number}: reward {run.rewards[number]:.4f}, {told(values)}"
    with torch.no_grad():
        for frame, (positions, _) in enumerate(learned_frames(task, values, run.simulator)):
            if frame in moments:
                yield label(renderer.image(positions), text)
    renderer.close()


def renderer_of(run: DesignRun, values: Values) -> FrameRenderer:
    """A renderer of the cut solid; its camera sees where the water starts, the same for every design."""
    task, water = run.task, run.task.water()
    with torch.no_grad():
        solid = opened(task.surface(values, water)).to_mesh(RESOLUTION)
    return FrameRenderer(solid, task.scene.container.size, PARTICLE_RADIUS, water.positions.numpy(), SIZE)


def opened(surface: Surface) -> Surface:
    """The half of a solid that is behind its middle as the camera sees it."""
    lower, upper = surface.bounds()
    middle, side = (lower + upper) / 2, 2.0 * float((upper - lower).max())
    turn = axis_rotation((0.0, 0.0, 1.0), -FRONT_DEGREES)
    ahead = turn @ torch.tensor([0.0, -side / 2, 0.0])
    return Difference(surface, Transformed(Box((side, side, side)), rotation=turn, translation=middle + ahead))
