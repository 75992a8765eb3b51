"""What a scene is called: its files do not say, so by its surfaces."""

from __future__ import annotations

from surfsup.scene.scene import Scene
from surfsup.scene.shapes import Shape

SHOWN = 3  # names of surfaces


def scene_name(scene: Scene) -> str:
    """The names of the surfaces, or the file or kind of the only one; empty where they say nothing."""
    names = list(scene.surfaces)
    if names:
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        return ", ".join(names[:SHOWN]) + more
    shape = scene.shape
    if not isinstance(shape, Shape):
        return ""
    description = getattr(shape, shape.kind)
    if hasattr(description, "file"):
        return str(description.file.stem)
    return "" if isinstance(description, list) else shape.kind
