"""The page, the video and the pictures of a trajectory file."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import trimesh

from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS, Scene
from surfsup.viewing.label import label
from surfsup.viewing.render import FrameRenderer
from surfsup.viewing.video import choose_frames, write_video
from surfsup.viewing.viewer import write_page

SOLID_RESOLUTION = 160
ALONE, BESIDE = (960, 720), (640, 480)  # pixels of a picture alone and of each of two beside each other

Tell = Callable[[int, int], None]


def solid_of(scene: Scene) -> trimesh.Trimesh | None:
    """The triangles of a scene's solid."""
    surface = scene.build_surface()
    return None if surface is None else surface.to_mesh(SOLID_RESOLUTION)


def write_page_of(trajectory: Path, page: Path, tell: Tell) -> Path:
    """Write the page that plays the trajectory in the file ``trajectory``; returns its path."""
    with Trajectory(trajectory) as frames:
        write_page(
            page,
            frames.positions[:],
            solid_of(frames.scene),
            frames.scene.container.size,
            PARTICLE_RADIUS,
            FRAME_TIME,
            tell,
        )
    return page


def write_video_of(trajectory: Path, video: Path, tell: Tell) -> Path:
    """Draw the trajectory in the file ``trajectory`` as a video; returns its path."""
    with Trajectory(trajectory) as frames:
        renderer = renderer_of(frames)
        chosen = choose_frames(len(frames), FRAME_TIME)
        images = (renderer.image(frames.positions[frame]) for frame in chosen)
        write_video(video, images, progress=tell, total=len(chosen))
        renderer.close()
    return video


def write_side_by_side(left: Path, right: Path, labels: tuple[str, str], video: Path, tell: Tell) -> Path:
    """Draw two trajectory files of one scene beside each other as a video, over the frames of both.

    Light and camera are those of the scene on the right. Returns the video's path.
    """
    with Trajectory(left) as one, Trajectory(right) as other:
        renderer = renderer_of(other, BESIDE)
        chosen = choose_frames(min(len(one), len(other)), FRAME_TIME)
        images = (
            np.hstack(
                [
                    label(renderer.image(frames.positions[frame]), text)
                    for frames, text in zip((one, other), labels, strict=True)
                ]
            )
            for frame in chosen
        )
        write_video(video, images, progress=tell, total=len(chosen))
        renderer.close()
    return video


def write_picture_of(trajectory: Path, picture: Path, frame: int) -> Path:
    """Draw one frame of the trajectory in the file ``trajectory`` as a PNG; returns its path.

    Raises:
        InputError: there is no such frame.
    """
    with Trajectory(trajectory) as frames:
        if frame >= len(frames):
            raise InputError(f"{trajectory}: has the frames 0 to {len(frames) - 1}, not {frame}")
        renderer = renderer_of(frames)
        image = renderer.image(frames.positions[frame])
        renderer.close()
    partial = picture.with_name(f".{picture.name}.partial")
    with av.open(str(partial), "w", format="image2", options={"update": "1"}) as container:
        stream = container.add_stream("png", width=image.shape[1], height=image.shape[0], pix_fmt="rgb24")
        container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
    os.replace(partial, picture)
    return picture


def renderer_of(frames: Trajectory, size: tuple[int, int] = ALONE) -> FrameRenderer:
    """A renderer of pictures of ``size`` (width, height) whose camera sees the solid and where the water starts."""
    scene = frames.scene
    return FrameRenderer(solid_of(scene), scene.container.size, PARTICLE_RADIUS, frames.positions[0], size)
