"""A few words on a picture, so that it can still be understood when it is passed on without its page."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

_INK = (36, 49, 61)
_PAPER = (255, 255, 255, 205)


def label(image: np.ndarray, text: str) -> np.ndarray:
    """The picture (height, width, 3) uint8 with `text` in its upper left corner, on a light patch."""
    height = image.shape[0]
    size, margin = max(10, round(height / 26)), max(4, round(height / 48))
    font = ImageFont.load_default(size)
    above, below = font.getmetrics()
    patch = [margin, margin, 3 * margin + font.getlength(text), 2 * margin + above + below]
    layer = Image.new("RGBA", (image.shape[1], height), (0, 0, 0, 0))
    draw = ImageDraw.Draw(layer)
    draw.rounded_rectangle(patch, radius=margin, fill=_PAPER)
    draw.text((2 * margin, 1.5 * margin), text, font=font, fill=_INK)
    return np.asarray(Image.alpha_composite(Image.fromarray(image).convert("RGBA"), layer).convert("RGB"))
