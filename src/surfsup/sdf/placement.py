"""A surface moved a long way without loss."""

from __future__ import annotations

import numpy as np

from surfsup.sdf.combine import Difference, Intersection, Union
from surfsup.sdf.surface import Surface
from surfsup.sdf.transform import Transformed


def moved(surface: Surface, offset: np.ndarray) -> Surface:
    """``surface`` moved by ``offset`` (3,) float64, meters.

    Parts that are placed already get the sum of both offsets, computed in double precision. So a mesh far from the
    origin comes back to it exactly.
    """
    if isinstance(surface, Transformed):
        place = surface.translation.detach().cpu().double().numpy() + offset
        return Transformed(surface.surface, surface.rotation, place.tolist(), surface.scale)
    if isinstance(surface, Union | Intersection):
        return type(surface)(*(moved(part, offset) for part in surface.parts))
    if isinstance(surface, Difference):
        return Difference(moved(surface.base, offset), moved(surface.cut, offset))
    return Transformed(surface, translation=offset.tolist())
