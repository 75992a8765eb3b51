"""Emitters of SPlisHSPlasH as taps, and taps as emitters.

An emitter gives a layer of particles every diameter / speed seconds, a square lattice of whole diameters. A rectangle
has ``width`` times ``height`` particles; a disc has a radius of ``width`` / 2 diameters. The water flows along the
emitter's own x axis, and its width is along the z axis.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import trimesh

from surfsup.scene.nozzle import nozzle_axes
from surfsup.scene.taps import Tap

Json = Mapping[str, Any]
RECTANGLE, DISC = 0, 1  # its types
SIZE, SPEED, PARTICLES = 5, 1.0, 10_000  # its defaults
FOREVER = 1e6  # seconds; files write such numbers for an emitter that never closes
LAYERS = 1_000_000  # of an emitter; more come in no simulation
FLOW_TOLERANCE = 0.02  # of a tap's flow, by which that of its emitter may differ without a word


def opening(emitter: Json, spacing: float) -> dict[str, Any]:
    """The opening of an emitter as the keys of a tap.

    Args:
        emitter: of the file.
        spacing: diameter of the particles, meters.
    """
    width, height = (int(emitter.get(key, SIZE)) for key in ("width", "height"))
    if int(emitter.get("type", RECTANGLE)) == DISC:
        return {"disc": {"radius": round(0.5 * width * spacing, 9)}}
    return {"rectangle": {"size": [round(width * spacing, 9), round(height * spacing, 9)]}}


def turn_of(direction: np.ndarray, width_axis: np.ndarray) -> float:
    """The ``turn`` of a rectangle, degrees, whose first side is along ``width_axis`` (3,)."""
    side, other, _ = nozzle_axes(direction.tolist())
    degrees = math.degrees(math.atan2(width_axis @ other, width_axis @ side))
    return round(degrees % 180, 6) % 180  # half a turn changes nothing


def closing_times(
    emitters: Sequence[Json], spacing: float, limits: Mapping[str, float], duration: float = math.inf
) -> list[float]:
    """When each emitter closes, seconds: at its own time, or when its liquid has all the particles that it may have.

    Args:
        emitters: of the file.
        spacing: diameter of the particles, meters.
        limits: particles that the emitters of a liquid give together, by its name.
        duration: of the scene, seconds. A limit that is not reached by then does not count.

    Raises:
        ValueError: an emitter has no speed.
    """
    speeds = [float(emitter.get("velocity", SPEED)) for emitter in emitters]
    if not all(speed > 0 for speed in speeds):
        raise ValueError(f"the velocity of an emitter must be above 0, not {min(speeds):g}")
    ends = [float(emitter.get("emitEndTime", math.inf)) for emitter in emitters]
    for liquid, limit in limits.items():
        own = [number for number, emitter in enumerate(emitters) if emitter.get("id", "Fluid") == liquid]
        layers: list[tuple[float, int]] = []  # time and particles
        for number in own:
            start, interval = float(emitters[number].get("emitStartTime", 0)), spacing / speeds[number]
            amount = particles_in_layer(emitters[number])
            count = min((ends[number] - start) / interval, limit / amount + 1, LAYERS)  # beyond the limit none counts
            layers += [(start + k * interval, amount) for k in range(math.ceil(max(count, 0)))]
        total = 0
        for time, amount in sorted(layers):
            total += amount
            if time > duration:
                break
            if total > limit:
                for number in own:
                    ends[number] = min(ends[number], time)
                break
    return ends


def particles_in_layer(emitter: Json) -> int:
    """Number of particles that an emitter gives at a time."""
    width, height = (int(emitter.get(key, SIZE)) for key in ("width", "height"))
    if int(emitter.get("type", RECTANGLE)) == RECTANGLE:
        return width * height
    sites = np.arange(width) - 0.5 * (width - 1)
    return int((np.add.outer(sites**2, sites**2) <= (0.5 * width) ** 2).sum())


def emitter_of(tap: Tap, spacing: float) -> tuple[dict[str, Any], float]:
    """A tap that stands still as an emitter, and its flow as a share of the tap's.

    Args:
        tap: of our scene.
        spacing: diameter of the particles, meters.
    """
    _, second, forward = nozzle_axes(tap.direction, tap.turn)
    # Columns: the emitter's x, y and z axes. A lattice looks the same from both sides, so signs are free.
    matrix = np.stack([forward, second, np.cross(forward, second)], axis=1)
    angle, axis = rotation_of(matrix)
    emitter: dict[str, Any] = {
        "id": "Fluid",
        "type": RECTANGLE if tap.disc is None else DISC,
        "translation": list(tap.at),
        "rotationAxis": axis,
        "rotationAngle": angle,
        "velocity": tap.meters_per_second,
        "emitStartTime": tap.start,
    }
    if tap.until is not None:
        emitter["emitEndTime"] = tap.until
    sides = [2 * tap.disc.radius] if tap.disc is not None else list(tap.rectangle.size if tap.rectangle else ())
    for key, side in zip(("width", "height"), sides, strict=False):
        emitter[key] = max(1, round(side / spacing))
    return emitter, particles_in_layer(emitter) * spacing**2 / tap.area


def rotation_of(matrix: np.ndarray) -> tuple[float, list[float]]:
    """Angle in radians and axis of a rotation matrix (3, 3)."""
    full = np.eye(4)
    full[:3, :3] = matrix
    angle, axis, _ = trimesh.transformations.rotation_from_matrix(full)
    return float(angle), [float(value) for value in axis]
