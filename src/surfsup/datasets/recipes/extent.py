"""The extent of a primitive in any orientation, in closed form."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation as ScipyRotation

from surfsup.scene import Shape
from surfsup.scene.shapes import BoxShape, ConeShape, CylinderShape, SphereShape, TorusShape

Primitive = SphereShape | BoxShape | CylinderShape | ConeShape | TorusShape


def extent(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (3,) of the tightest box around a placed primitive, meters."""
    rotation = rotation_matrix(shape)
    primitive: Primitive = getattr(shape, shape.kind)
    # A row of the rotation is an axis of the container in the primitive's own frame.
    upper = np.array([axis @ support_point(primitive, axis) for axis in rotation])
    lower = np.array([axis @ support_point(primitive, -axis) for axis in rotation])
    return np.asarray(shape.at) + shape.scale * lower, np.asarray(shape.at) + shape.scale * upper


def lowest_point(shape: Shape) -> np.ndarray:
    """The lowest point (3,) of a placed primitive, meters."""
    rotation = rotation_matrix(shape)
    primitive: Primitive = getattr(shape, shape.kind)
    return np.asarray(shape.at) + shape.scale * rotation @ support_point(primitive, -rotation[2])


def rotation_matrix(shape: Shape) -> np.ndarray:
    """The shape's rotation (3, 3)."""
    if shape.rotate is None:
        return np.eye(3)
    axis = np.asarray(shape.rotate.axis) / np.linalg.norm(shape.rotate.axis)
    return ScipyRotation.from_rotvec(axis * shape.rotate.degrees, degrees=True).as_matrix()


def support_point(primitive: Primitive, direction: np.ndarray) -> np.ndarray:
    """The point (3,) of the primitive, in its own frame, that is farthest along the unit vector ``direction`` (3,).

    If a whole edge or face is equally far, it is the middle or one of the points of that.
    """
    across = np.array([direction[0], direction[1], 0.0])
    outward = across / max(float(np.linalg.norm(across)), 1e-12)
    up = np.array([0.0, 0.0, np.sign(direction[2])])
    match primitive:
        case SphereShape():
            return primitive.radius * direction
        case BoxShape():
            return np.sign(direction) * primitive.size / 2
        case CylinderShape():
            return up * primitive.height / 2 + outward * primitive.radius
        case ConeShape():
            half = np.array([0.0, 0.0, primitive.height / 2])
            ends = np.array([half + outward * primitive.top_radius, outward * primitive.bottom_radius - half])
            return ends[np.argmax(ends @ direction)]
        case TorusShape():
            return outward * primitive.major_radius + direction * primitive.minor_radius
