"""A line of text on a picture, so that the picture can be understood without its page."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

_TEXT_COLOR = (36, 49, 61)
_PATCH_COLOR = (255, 255, 255, 205)


def label(image: np.ndarray, text: str) -> np.ndarray:
    """The picture (height, width, 3) uint8 with ``text`` in its upper left corner, on a light patch."""
    height = image.shape[0]
    size, margin = max(10, round(height / 26)), max(4, round(height / 48))
    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont)  # Pillow's wheels contain FreeType
    ascent, descent = font.getmetrics()
    patch = [margin, margin, 3 * margin + font.getlength(text), 2 * margin + ascent + descent]
    layer = Image.new("RGBA", (image.shape[1], height), (0, 0, 0, 0))
    draw = ImageDraw.Draw(layer)
    draw.rounded_rectangle(patch, radius=margin, fill=_PATCH_COLOR)
    draw.text((2 * margin, 1.5 * margin), text, font=font, fill=_TEXT_COLOR)
    return np.asarray(Image.alpha_composite(Image.fromarray(image).convert("RGBA"), layer).convert("RGB"))
