"""Text of mesh files: encodings, line ends, and numbers as programs of other countries and ages write them."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable

import numpy as np

MARKS = (  # of byte order, the longer ones first
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
FORTRAN_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")


def decode(content: bytes) -> str:
    """The text of a file, with line ends as ``\\n``: UTF-8, UTF-16 or UTF-32 with a mark, else Latin-1."""
    for mark, encoding in MARKS:
        if content.startswith(mark):
            text = content[len(mark) :].decode(encoding, errors="replace")
            break
    else:
        try:
            text = content.decode("utf-8")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def numbers(words: Iterable[str]) -> np.ndarray:
    """``words`` as float64, also with a decimal comma or an exponent after a D.

    Raises:
        ValueError: a word is not a number.
    """
    listed = list(words)
    try:
        return np.array(list(map(float, listed)), dtype=np.float64)
    except ValueError:
        return np.array([float(FORTRAN_EXPONENT.sub("e", word.replace(",", "."))) for word in listed])
