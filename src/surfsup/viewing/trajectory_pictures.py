"""The page, the video and pictures of a trajectory file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from surfsup.errors import InputError
from surfsup.io.atomic_file import atomic_file
from surfsup.io.trajectory import Trajectory
from surfsup.scene import Scene
from surfsup.viewing.label import label
from surfsup.viewing.renderer import FrameRenderer
from surfsup.viewing.video import choose_frames, write_video
from surfsup.viewing.web_player import write_web_player

SOLID_RESOLUTION = 160  # cells of marching cubes
SINGLE_SIZE, PAIR_SIZE = (960, 720), (640, 480)  # pixels of a single picture and of each of two side by side

Progress = Callable[[int, int], None]  # numbers of finished and of all frames


def scene_mesh(scene: Scene) -> trimesh.Trimesh | None:
    """The triangles of a scene's solid; None for an empty container."""
    surface = scene.build_surface()
    return None if surface is None else surface.to_mesh(SOLID_RESOLUTION)


def trajectory_renderer(trajectory: Trajectory, size: tuple[int, int] = SINGLE_SIZE) -> FrameRenderer:
    """A renderer for pictures of ``size`` (width, height) whose camera shows the solid and the water of frame 0."""
    scene = trajectory.scene
    return FrameRenderer(scene_mesh(scene), scene.container.size, trajectory.radius, trajectory.positions[0], size)


def write_trajectory_page(file: Path, page: Path, progress: Progress) -> Path:
    """Write the page that plays the trajectory in ``file``; returns the path of the page."""
    with Trajectory(file) as trajectory:
        scene = trajectory.scene
        write_web_player(
            page,
            trajectory.positions[:],
            scene_mesh(scene),
            scene.container.size,
            trajectory.radius,
            trajectory.frame_time,
            progress,
        )
    return page


def write_trajectory_video(file: Path, video: Path, progress: Progress) -> Path:
    """Render the trajectory in ``file`` as a video; returns the path of the video."""
    with Trajectory(file) as trajectory:
        renderer = trajectory_renderer(trajectory)
        chosen = choose_frames(len(trajectory), trajectory.frame_time)
        images = (renderer.render(trajectory.positions[frame]) for frame in chosen)
        write_video(video, images, progress=progress, total=len(chosen))
        renderer.close()
    return video


def write_comparison_video(left: Path, right: Path, labels: tuple[str, str], video: Path, progress: Progress) -> Path:
    """Render two trajectory files of one scene side by side as a video, over the frames that both have.

    Light and camera are those of the scene on the right. Returns the path of the video.
    """
    with Trajectory(left) as left_trajectory, Trajectory(right) as right_trajectory:
        renderer = trajectory_renderer(right_trajectory, PAIR_SIZE)
        pair = tuple(zip((left_trajectory, right_trajectory), labels, strict=True))
        chosen = choose_frames(min(len(left_trajectory), len(right_trajectory)), right_trajectory.frame_time)
        images = (
            np.hstack([label(renderer.render(trajectory.positions[frame]), text) for trajectory, text in pair])
            for frame in chosen
        )
        write_video(video, images, progress=progress, total=len(chosen))
        renderer.close()
    return video


def write_frame_picture(file: Path, picture: Path, frame: int) -> Path:
    """Render one frame of the trajectory in ``file`` as a PNG; returns the path of the picture.

    Raises:
        InputError: the trajectory has no such frame.
    """
    with Trajectory(file) as trajectory:
        if frame >= len(trajectory):
            raise InputError(f"{file}: has the frames 0 to {len(trajectory) - 1}, not {frame}")
        renderer = trajectory_renderer(trajectory)
        image = renderer.render(trajectory.positions[frame])
        renderer.close()
    with atomic_file(picture) as partial:
        Image.fromarray(image).save(partial, format="PNG")
    return picture
