"""The video and pictures of a trajectory file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from surfsup.errors import InputError
from surfsup.io.atomic_file import atomic_file
from surfsup.io.scene_poses import scene_poses
from surfsup.io.trajectory import Trajectory
from surfsup.viewing.camera import DEFAULT_DIRECTION, ViewDirection
from surfsup.viewing.label import label
from surfsup.viewing.liquid_look import looks_of
from surfsup.viewing.moving_mesh import at_frame, bounds_of, container_corners
from surfsup.viewing.overlap import overlapped
from surfsup.viewing.renderer import DrawnWater, FrameRenderer
from surfsup.viewing.shading_mesh import ShadingMesh
from surfsup.viewing.shadow_maps import FULL_LIGHT, MOVING_LIGHT, Light
from surfsup.viewing.trajectory_page import Progress, points_of_interest, require_water, trajectory_meshes
from surfsup.viewing.video import choose_frames, write_video
from surfsup.viewing.video_settings import VideoSettings

DEFAULT_SETTINGS = VideoSettings()
PAIR_SIZE = (640, 480)  # pixels of each of two pictures side by side


@dataclass(frozen=True)
class Moment:
    """A frame, its particles at ``positions`` (N, 3) in meters, and how far the camera has turned, in degrees."""

    frame: int
    positions: np.ndarray
    angle: float = 0.0


class TrajectoryRenderer:
    """Renders frames of a trajectory; the camera shows the solids and the water of frame 0.

    Args:
        trajectory: an open trajectory.
        size: (width, height) of the pictures in pixels.
        direction: from where the camera looks.
        turntable: whether the camera shall go around.

    Raises:
        InputError: this machine cannot render off screen.
    """

    def __init__(
        self,
        trajectory: Trajectory,
        size: tuple[int, int] = DEFAULT_SETTINGS.size,
        direction: ViewDirection = DEFAULT_DIRECTION,
        turntable: bool = False,
    ) -> None:
        self._trajectory, self._size = trajectory, trajectory.scene.container.size
        self._still, self._moving = trajectory_meshes(trajectory)
        self._poses = scene_poses(trajectory)
        first = None if self._poses else self._still  # what moves is drawn anew for each frame
        bounds = bounds_of(self._still, self._moving)
        focus = points_of_interest(trajectory)
        looks, liquids = looks_of(trajectory.scene), trajectory.liquids
        self._renderer = FrameRenderer(
            first, self._size, trajectory.radius, focus, size, bounds, direction, turntable, looks, liquids
        )
        if trajectory.scene.container.open:
            self._renderer.omit_edges()

    def render(self, frame: int, positions: np.ndarray | None = None, light: Light = MOVING_LIGHT) -> np.ndarray:
        """The picture (height, width, 3) uint8 of a frame, with its own particles or those at ``positions`` (N, 3).

        The ``light`` is that of a scene in which something moves; what stands still has shadows at their finest.
        """
        self._place_solids(frame, light)
        return self._renderer.render(self._trajectory.positions[frame] if positions is None else positions)

    def _place_solids(self, frame: int, light: Light) -> None:
        """Draw what moves where it is in a frame."""
        if self._poses:
            solid = at_frame(self._still, self._moving, frame)
            self._renderer.set_solid(solid, container_corners(self._size, self._poses, frame), light)

    def render_many(self, moments: Iterable[Moment]) -> Iterator[np.ndarray]:
        """The pictures of many moments, in order; on more than one core."""

        def draw(moment: Moment, water: tuple[list[np.ndarray], ShadingMesh]) -> DrawnWater:
            self._place_solids(moment.frame, MOVING_LIGHT)
            if moment.angle:
                self._renderer.turn(moment.angle)
            return self._renderer.draw(*water)

        return overlapped(
            moments, lambda moment: self._renderer.reconstruct(moment.positions), draw, self._renderer.shade
        )

    def close(self) -> None:
        """Free the off-screen window."""
        self._renderer.close()


def write_trajectory_video(
    file: Path, video: Path, progress: Progress, settings: VideoSettings = DEFAULT_SETTINGS
) -> Path:
    """Render the trajectory in ``file`` as a video; returns the path of the video.

    Raises:
        InputError: the trajectory has fewer frames a second than the video.
    """
    with Trajectory(file) as trajectory:
        require_water(trajectory, file)
        chosen = settings.frames(len(trajectory), trajectory.frame_time)
        renderer = TrajectoryRenderer(trajectory, settings.size, settings.direction, settings.turntable)
        images = renderer.render_many(
            Moment(frame, trajectory.positions[frame], angle)
            for frame, angle in zip(chosen, settings.angles(len(chosen)), strict=True)
        )
        write_video(video, images, settings.rate, progress, len(chosen))
        renderer.close()
    return video


def write_comparison_video(left: Path, right: Path, labels: tuple[str, str], video: Path, progress: Progress) -> Path:
    """Render two trajectory files of one scene side by side as a video, over the frames that both have.

    Light and camera are those of the scene on the right. Returns the path of the video.
    """
    with Trajectory(left) as left_trajectory, Trajectory(right) as right_trajectory:
        renderer = TrajectoryRenderer(right_trajectory, PAIR_SIZE)
        pair = (left_trajectory, right_trajectory)
        chosen = choose_frames(min(map(len, pair)), right_trajectory.frame_time)
        pictures = renderer.render_many(Moment(frame, each.positions[frame]) for frame in chosen for each in pair)
        images = (
            np.hstack([label(picture, text) for picture, text in zip(both, labels, strict=True)])
            for both in zip(pictures, pictures, strict=True)
        )
        write_video(video, images, progress=progress, total=len(chosen))
        renderer.close()
    return video


def write_frame_picture(file: Path, picture: Path, frame: int, settings: VideoSettings = DEFAULT_SETTINGS) -> Path:
    """Render one frame of the trajectory in ``file`` as a PNG; returns the path of the picture.

    Raises:
        InputError: the trajectory has no such frame.
    """
    with Trajectory(file) as trajectory:
        require_water(trajectory, file)
        if frame >= len(trajectory):
            raise InputError(f"{file}: has the frames 0 to {len(trajectory) - 1}, not {frame}")
        renderer = TrajectoryRenderer(trajectory, settings.size, settings.direction)
        image = renderer.render(frame, light=FULL_LIGHT)
        renderer.close()
    with atomic_file(picture) as partial:
        Image.fromarray(image).save(partial, format="PNG")
    return picture
