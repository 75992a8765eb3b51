"""H.264 videos, which every browser and phone plays."""

from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from surfsup.io.atomic_file import atomic_file

FRAMES_PER_SECOND = 25
MAX_FRAMES = 120


def choose_frames(
    frame_count: int,
    frame_time: float = 0.005,
    frames_per_second: int = FRAMES_PER_SECOND,
    max_frames: int = MAX_FRAMES,
) -> np.ndarray:
    """The frames (K,) of a trajectory that a video shows: evenly spaced, at most ``max_frames``.

    The video is in real time (4 s of water are 100 pictures at 25 per second), because slow motion makes water look
    viscous. A trajectory that is too long for ``max_frames`` is played faster.

    Args:
        frame_count: number of frames of the trajectory.
        frame_time: seconds.
        frames_per_second: of the video.
        max_frames: of the video.
    """
    stride = max(1, round(1.0 / (frames_per_second * frame_time)))
    while len(range(0, frame_count, stride)) > max_frames:
        stride += 1
    return np.arange(0, frame_count, stride)


def write_video(
    path: str | Path,
    images: Iterable[np.ndarray],
    frames_per_second: float = FRAMES_PER_SECOND,
    progress: Callable[[int, int], None] = lambda done, total: None,
    total: int = 0,
) -> None:
    """Write ``images`` as an H.264 MP4; the file appears only when it is complete.

    Args:
        path: of the video; missing folders are made.
        images: each (height, width, 3) uint8, all of one size.
        frames_per_second: of the video.
        progress: called with the number of finished images and ``total`` after each image.
        total: number of images.

    Raises:
        ValueError: there are no images, or their sizes differ.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(path) as partial:
        _encode(partial, images, frames_per_second, progress, total)


def _encode(
    path: Path, images: Iterable[np.ndarray], frames_per_second: float, progress: Callable[[int, int], None], total: int
) -> None:
    # faststart puts the index first, so that a browser can play before it has the whole file.
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = None
        for done, image in enumerate(images, start=1):
            # yuv420p halves the resolution of colors, so it needs even sides.
            image = np.ascontiguousarray(image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2])
            height, width = image.shape[:2]
            if stream is None:
                stream = container.add_stream("libx264", rate=Fraction(frames_per_second).limit_denominator(1001))
                stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
                stream.options = {"crf": "18", "preset": "medium"}
            elif (width, height) != (stream.width, stream.height):
                raise ValueError(f"image {done} is {width}x{height}, those before are {stream.width}x{stream.height}")
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            progress(done, total)
        if stream is None:
            raise ValueError("a video needs at least one image")
        container.mux(stream.encode())
