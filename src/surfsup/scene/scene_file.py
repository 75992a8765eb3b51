"""What a scene file lacks that can be seen without its model, which takes two seconds to load."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

from surfsup.errors import InputError
from surfsup.scene.safe_yaml import parse_yaml

# The keys of a scene; tests compare them with the model's.
KEYS = (
    "container", "surface", "surfaces", "fluid", "gravity", "frames", "particle_radius", "fps", "duration", "restart",
    "taps", "drains", "forces", "density", "liquid",
)  # fmt: skip
MAX_CHARACTERS = 50_000  # of a text that is parsed twice


def read_scene_text(path: Path) -> str:
    """The text of a scene file.

    Raises:
        InputError: it is missing, or not text.
    """
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise InputError(f"{path}: cannot be read as a scene: {reason}") from None


def parse_scene(text: str, source: str) -> dict[str, object]:
    """The keys and values of a scene.

    Raises:
        InputError: the text is not YAML, or not a mapping.
    """
    data = parse_yaml(text, source)
    if not isinstance(data, dict):
        raise InputError(f"{source}: a scene is a mapping with at least the key 'fluid'")
    return data


def check_scene_file(path: Path) -> None:
    """Look for what is wrong with a scene file as a whole.

    Raises:
        InputError: it cannot be read, is not YAML, or has a key that scenes do not have.
    """
    if not path.is_file() and path.exists():  # a pipe can be read but once
        return
    text = read_scene_text(path)
    if len(text) > MAX_CHARACTERS:
        return
    for key in parse_scene(text, str(path)):
        if key not in KEYS:
            raise InputError(f"{path}: {unknown_key(' '.join(str(key).split()), str(key), KEYS)}")


def unknown_key(where: str, key: str, known: Sequence[str]) -> str:
    """The message about an unknown key at a place, with the closest known one."""
    closest = difflib.get_close_matches(key, known, n=1)
    hint = f"did you mean '{closest[0]}'?" if closest else f"known are {', '.join(known)}"
    return f"unknown key '{where}'; {hint}"
