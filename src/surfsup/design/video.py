"""The video of a design run: water in the first design, the change of the shape, water in the best design.

The front half of the surface is cut away to show the water inside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import torch

from surfsup.design.parameter import Values
from surfsup.design.run import DesignRun
from surfsup.design.task import format_values
from surfsup.design.verification import simulated_frames
from surfsup.scene import PARTICLE_RADIUS
from surfsup.sdf import Box, Difference, Surface, Transformed, axis_rotation
from surfsup.viewing.label import label
from surfsup.viewing.renderer import FrameRenderer
from surfsup.viewing.video import write_video

DESIGNS = 24  # designs that show the change of the shape
FRAMES = 17  # frames of the first and of the best design's water
REPETITIONS = 2  # video frames for each image
SIZE = (800, 600)  # pixels
RESOLUTION = 112  # cells along the longest side of the surface
CAMERA_DEGREES = -30.0  # direction of the camera of `surfsup.viewing` about z


def write_design_video(run: DesignRun, path: Path, progress: Callable[[int, int], None]) -> Path:
    """Render the run as a video at ``path``; returns the path.

    Args:
        run: a finished run.
        path: of the MP4.
        progress: called with the number of images done and their total.

    Raises:
        InputError: this machine cannot render.
    """
    designs = evenly_spaced_designs(run)
    frames = np.unique(np.linspace(0, run.task.scene.frames - 1, FRAMES).round().astype(int)).tolist()
    total = REPETITIONS * (2 * len(frames) + len(designs))
    images = (image for image in render_run(run, designs, frames) for _ in range(REPETITIONS))
    write_video(path, images, progress=progress, total=total)
    return path


def evenly_spaced_designs(run: DesignRun) -> list[int]:
    """Indices of designs up to the best, evenly spaced along the path through the parameter space."""
    vectors = torch.stack([run.optimizer.space.to_vector(design) for design in run.designs[: run.best + 1]])
    lengths = torch.cat([torch.zeros(1), (vectors[1:] - vectors[:-1]).norm(dim=1)]).cumsum(0)
    targets = torch.linspace(0, float(lengths[-1]), DESIGNS)
    return torch.searchsorted(lengths, targets).clamp(max=run.best).unique().tolist()


def render_run(run: DesignRun, designs: list[int], frames: list[int]) -> Iterator[np.ndarray]:
    """All images in order."""
    yield from render_design(run, 0, frames)
    for number in designs:
        yield from render_design(run, number, frames[-1:])
    yield from render_design(run, run.best, frames)


def render_design(run: DesignRun, number: int, frames: list[int]) -> Iterator[np.ndarray]:
    """Images of these frames of the water in design ``number``."""
    values, task = run.designs[number], run.task
    renderer = make_renderer(run, values)
    text = f"cut open, iteration {number}: reward {run.rewards[number]:.4f}, {format_values(values)}"
    with torch.no_grad():
        for frame, (positions, _) in enumerate(simulated_frames(task, values, run.simulator)):
            if frame in frames:
                yield label(renderer.render(positions), text)
    renderer.close()


def make_renderer(run: DesignRun, values: Values) -> FrameRenderer:
    """A renderer of the cut surface. Its camera sees the fluid's start and is the same for every design."""
    task, start = run.task, run.task.initial_state()
    with torch.no_grad():
        mesh = cut_open(task.surface(values, start)).to_mesh(RESOLUTION)
    return FrameRenderer(mesh, task.scene.container.size, PARTICLE_RADIUS, start.positions.numpy(), SIZE)


def cut_open(surface: Surface) -> Surface:
    """The half of a surface that is behind its center as seen by the camera."""
    lower, upper = surface.bounds()
    center, side = (lower + upper) / 2, 2.0 * float((upper - lower).max())
    rotation = axis_rotation((0.0, 0.0, 1.0), -CAMERA_DEGREES)
    offset = rotation @ torch.tensor([0.0, -side / 2, 0.0])
    return Difference(surface, Transformed(Box((side, side, side)), rotation=rotation, translation=center + offset))
