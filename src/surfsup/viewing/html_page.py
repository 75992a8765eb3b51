"""HTML pages from templates; each is one file that needs no network."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from importlib.resources.abc import Traversable
from pathlib import Path

from surfsup.io.atomic_file import atomic_file


def script_json(data: object) -> str:
    """``data`` as JSON that is safe inside a script element.

    Raises:
        ValueError: a number is not finite.
    """
    # A "</script>" in the text would end the element, so "<" is escaped.
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def write_html(path: Path, template: Traversable, values: Mapping[str, str]) -> None:
    """Write ``template`` to ``path``, with each ``__NAME__`` replaced by its value in ``values``."""
    text = template.read_text(encoding="utf-8")
    with atomic_file(path) as partial:
        partial.write_text(re.sub("__([A-Z]+)__", lambda match: values[match[1]], text), encoding="utf-8")
