"""A sequence of solids as pictures: a page with a slider, and a strip of all pictures side by side."""

from __future__ import annotations

import base64
import html
import io
from importlib.resources import files
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from surfsup.io.atomic_file import atomic_file
from surfsup.viewing.html_page import script_json, write_html
from surfsup.viewing.label import label
from surfsup.viewing.renderer import FrameRenderer

SIZE = (640, 480)  # pixels of a picture
EXTENT = 0.8  # meters; rendered size of the cube of side 2
CONTAINER_SIZE = (1.0, 1.0, 1.0)  # meters
JPEG_QUALITY = 88
STRIP_REDUCTION = 2  # pictures of the strip are this many times smaller
NO_PARTICLES = np.zeros((0, 3), np.float32)
PARTICLE_RADIUS = 0.015  # meters; not used without particles


def render_solid(mesh: trimesh.Trimesh | None) -> np.ndarray:
    """A picture (480, 640, 3) uint8 of a solid in the cube of side 2, moved onto the floor, or of the empty floor."""
    solid = None
    if mesh is not None:
        solid = mesh.copy()
        solid.apply_scale(EXTENT / 2)
        solid.apply_translation([0.0, 0.0, -solid.bounds[0, 2]])
    renderer = FrameRenderer(solid, CONTAINER_SIZE, PARTICLE_RADIUS, size=SIZE)
    picture = renderer.render(NO_PARTICLES)
    renderer.close()
    return picture


def write_slider(path: Path, pictures: list[np.ndarray], captions: list[str], title: str) -> None:
    """Write a page with a slider through ``pictures`` (H, W, 3) uint8 and their ``captions``."""
    steps = [
        {"picture": jpeg_address(picture), "caption": caption}
        for picture, caption in zip(pictures, captions, strict=True)
    ]
    template = files("surfsup.viewing") / "pages" / "slider.html"
    write_html(path, template, {"TITLE": html.escape(title), "STEPS": script_json(steps)})


def write_strip(path: Path, pictures: list[np.ndarray], captions: list[str]) -> None:
    """Write ``pictures`` side by side, reduced, each with its caption, as a PNG."""
    small = [np.asarray(Image.fromarray(picture).reduce(STRIP_REDUCTION)) for picture in pictures]
    reduced = [Image.fromarray(label(picture, text)) for picture, text in zip(small, captions, strict=True)]
    strip = Image.new("RGB", (sum(image.width for image in reduced), reduced[0].height))
    for number, image in enumerate(reduced):
        strip.paste(image, (number * image.width, 0))
    with atomic_file(path) as partial:
        strip.save(partial, format="PNG")


def jpeg_address(picture: np.ndarray) -> str:
    """The picture as a data address for a page."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format="JPEG", quality=JPEG_QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
