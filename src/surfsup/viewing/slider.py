"""A row of solids as pictures: a page with a slider, and all of them beside each other."""

from __future__ import annotations

import base64
import html
import io
import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from surfsup.viewing.render import FrameRenderer

SIZE = (640, 480)  # pixels of a picture
EXTENT = 0.8  # meters: what the cube of side 2 is drawn as
ROOM = (1.0, 1.0, 1.0)  # meters: the container around it
JPEG_QUALITY = 88
STRIP_SCALE = 2  # pictures of the strip are so many times smaller
NO_WATER = np.zeros((0, 3), np.float32)
SPACING = 0.015  # meters; there is no water to draw


def picture_of_solid(mesh: trimesh.Trimesh | None) -> np.ndarray:
    """A picture (480, 640, 3) uint8 of a solid in the cube of side 2, put on the floor, or of the empty floor."""
    solid = None
    if mesh is not None:
        solid = mesh.copy()
        solid.apply_scale(EXTENT / 2)
        solid.apply_translation([0.0, 0.0, -solid.bounds[0, 2]])
    renderer = FrameRenderer(solid, ROOM, SPACING, size=SIZE)
    picture = renderer.image(NO_WATER)
    renderer.close()
    return picture


def write_slider(path: Path, pictures: list[np.ndarray], captions: list[str], title: str) -> None:
    """Write a page with a slider that goes through ``pictures`` (H, W, 3) uint8 and their ``captions``."""
    data = [{"picture": as_jpeg(image), "caption": text} for image, text in zip(pictures, captions, strict=True)]
    # Inside a script element the text must not end it; JSON may write the bracket as its number.
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    page = (files("surfsup.viewing") / "page" / "slider.html").read_text(encoding="utf-8")
    page = page.replace("__TITLE__", html.escape(title)).replace("__STEPS__", text)
    partial = path.with_name(f".{path.name}.partial")
    partial.write_text(page, encoding="utf-8")
    partial.replace(path)


def write_strip(path: Path, pictures: list[np.ndarray]) -> None:
    """Write ``pictures`` beside each other, smaller, as a PNG."""
    small = [Image.fromarray(one).reduce(STRIP_SCALE) for one in pictures]
    strip = Image.new("RGB", (sum(one.width for one in small), small[0].height))
    for number, one in enumerate(small):
        strip.paste(one, (number * one.width, 0))
    partial = path.with_name(f".{path.name}.partial")
    strip.save(partial, format="PNG")
    partial.replace(path)


def as_jpeg(picture: np.ndarray) -> str:
    """The picture as the address that a page can hold."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format="JPEG", quality=JPEG_QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
