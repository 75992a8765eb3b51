"""Videos that every browser and phone plays."""

from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

FRAMES_PER_SECOND = 25
MOST_FRAMES = 120


def choose_frames(
    frame_count: int,
    frame_time: float = 0.005,
    frames_per_second: int = FRAMES_PER_SECOND,
    most: int = MOST_FRAMES,
) -> np.ndarray:
    """Which frames (K,) of a trajectory a video shows, evenly spaced, never more than `most`.

    Real time where that fits (4 s of water are 100 pictures at 25 a second): water in slow motion looks like
    syrup and hides whether a simulation falls as water does. What is longer is played faster. `frame_time` is
    in seconds.
    """
    stride = max(1, round(1.0 / (frames_per_second * frame_time)))
    while len(range(0, frame_count, stride)) > most:
        stride += 1
    return np.arange(0, frame_count, stride)


def write_video(
    path: str | Path,
    images: Iterable[np.ndarray],
    frames_per_second: int = FRAMES_PER_SECOND,
    progress: Callable[[int, int], None] | None = None,
    total: int = 0,
) -> None:
    """Write `images`, each (height, width, 3) uint8 and all of one size, as an H.264 MP4 at `path`.

    The file appears under its name only when it is whole. `progress(done, total)` is called after each image;
    `total` is handed on as it is, for `images` may not know its length. Raises ValueError if there are no
    images or sizes differ.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.partial")
    try:
        _encode(partial, images, frames_per_second, progress, total)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _encode(
    path: Path,
    images: Iterable[np.ndarray],
    frames_per_second: int,
    progress: Callable[[int, int], None] | None,
    total: int,
) -> None:
    # faststart puts the index first, so that a browser plays before it has the whole file
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = None
        for done, image in enumerate(images, start=1):
            # yuv420p halves the colors' resolution and so needs even sides
            image = np.ascontiguousarray(image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2])
            height, width = image.shape[:2]
            if stream is None:
                stream = container.add_stream("libx264", rate=Fraction(frames_per_second))
                stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
                stream.options = {"crf": "18", "preset": "medium"}
            elif (width, height) != (stream.width, stream.height):
                raise ValueError(f"image {done} is {width}x{height}, those before are {stream.width}x{stream.height}")
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            if progress is not None:
                progress(done, total)
        if stream is None:
            raise ValueError("a video needs at least one image")
        container.mux(stream.encode())
