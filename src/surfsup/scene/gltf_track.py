"""The keyframes of a glTF animation: one property of one node over time (glTF 2.0 specification, appendix C)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from surfsup.scene import quaternion
from surfsup.sdf.mesh.readers.gltf_accessors import Accessors
from surfsup.sdf.mesh.readers.raw_mesh import UnreadableMeshError

WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}
STEP, LINEAR, CUBIC = "STEP", "LINEAR", "CUBICSPLINE"


@dataclass(frozen=True)
class Track:
    """A translation, a rotation (x, y, z, w) or a scale over time, constant before the first key and after the last.

    Attributes:
        times: (K,) seconds, increasing.
        values: (K, width); with cubic splines (K, 3, width): the tangent before the key, the value, the tangent after.
        kind: STEP, LINEAR or CUBICSPLINE.
        rotates: whether the values are rotations.
    """

    times: np.ndarray
    values: np.ndarray
    kind: str
    rotates: bool

    def at(self, time: float) -> np.ndarray:
        """The value (width,) at a time in seconds."""
        number = int(np.searchsorted(self.times, time, side="right")) - 1
        if number < 0 or number >= len(self.times) - 1:
            return self._key(max(0, number))
        if self.kind == STEP:
            return self._key(number)
        step = self.times[number + 1] - self.times[number]
        s = (time - self.times[number]) / step
        start, end = self._key(number), self._key(number + 1)
        if self.kind == CUBIC:
            value: np.ndarray = (
                (2 * s**3 - 3 * s**2 + 1) * start
                + (s**3 - 2 * s**2 + s) * step * self.values[number, 2]
                + (3 * s**2 - 2 * s**3) * end
                + (s**3 - s**2) * step * self.values[number + 1, 0]
            )
            return value / np.linalg.norm(value) if self.rotates else value
        if not self.rotates:
            return (1 - s) * start + s * end
        one, other = start[[3, 0, 1, 2]], end[[3, 0, 1, 2]]
        turn = quaternion.logarithm(quaternion.product(quaternion.inverse(one), other))
        return quaternion.product(one, quaternion.exponential(s * turn))[[1, 2, 3, 0]]

    def _key(self, number: int) -> np.ndarray:
        key: np.ndarray = self.values[number, 1] if self.kind == CUBIC else self.values[number]
        return key


def read_track(accessors: Accessors, sampler: dict[str, Any], path: str) -> Track:
    """The keyframes of a sampler for the property ``path``.

    Raises:
        UnreadableMeshError: times do not increase, values are missing or not finite, or a rotation is zero.
    """
    kind = sampler.get("interpolation", LINEAR)
    if kind not in (STEP, LINEAR, CUBIC):
        raise UnreadableMeshError(f"has keyframes with the interpolation '{kind}', which glTF does not know")
    times = accessors.read(sampler["input"])[:, 0].astype(np.float64)
    values = accessors.read(sampler["output"]).astype(np.float64)
    per_key = 3 if kind == CUBIC else 1
    if len(times) == 0 or values.shape != (per_key * len(times), WIDTHS[path]):
        raise UnreadableMeshError(f"is damaged: {len(times)} keys have {len(values)} values of '{path}'")
    if not (np.isfinite(times).all() and np.isfinite(values).all() and (np.diff(times) > 0).all()):
        raise UnreadableMeshError(f"is damaged: the keys of '{path}' are not finite, or their times do not increase")
    if kind == CUBIC:
        values = values.reshape(-1, 3, WIDTHS[path])
    rotates = path == "rotation"
    if rotates:
        keys = values[:, 1] if kind == CUBIC else values
        lengths = np.linalg.norm(keys, axis=1)
        if lengths.min() < 1e-6:
            raise UnreadableMeshError("is damaged: a rotation is the quaternion zero")
        keys /= lengths[:, None]
    return Track(times, values, kind, rotates)
