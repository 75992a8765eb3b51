"""Taps during a simulation: layers of particles that enter, guided at first, then free.

A layer is guided for the first two spacings behind the opening, as in a pipe: at the end of each frame its particles
are put where the speed of the tap alone takes them. So water that flows freely has neighbors on all sides within the
kernel support, as SPlisHSPlasH's emitters have it, too (J. Bender et al., https://github.com/InteractiveComputerGraphics/
SPlisHSPlasH).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from surfsup.scene import SPACING
from surfsup.scene.nozzle import Nozzle
from surfsup.scene.pose import Pose, between

# J/kg that a particle brings when its layer comes where water is: at most 64 of each in the first layer of a tap that
# opens under water, then up to 6 (measured).
PUSH = 100.0
FOUND = 0.1 * SPACING  # meters from where a guided particle should be, within which it is recognized


@dataclass(frozen=True)
class Layer:
    """A layer of particles that is still guided.

    Attributes:
        nozzle: of the tap that it left.
        time: when it passed the opening, seconds.
        ids: (n,) int64 of its particles, in the order of the points of the nozzle; a drain may have taken some.
    """

    nozzle: Nozzle
    time: float
    ids: np.ndarray


@dataclass(frozen=True)
class CarrierMotion:
    """The poses by name of all that carries a tap or a drain, at the start and the end of a frame."""

    start: Mapping[str, Pose]
    end: Mapping[str, Pose]
    seconds: float

    def at(self, part: float) -> dict[str, Pose]:
        """The poses at a part of the frame."""
        return {name: between(self.start[name], self.end[name], part) for name in self.start}


class Taps:
    """The taps of a scene.

    Args:
        nozzles: in the units of the solver.
    """

    def __init__(self, nozzles: Sequence[Nozzle]) -> None:
        self.nozzles = tuple(nozzles)

    def count(self, after: float, to: float) -> int:
        """Number of particles that enter after the time ``after`` until ``to``, in seconds."""
        return sum(nozzle.count(after, to) for nozzle in self.nozzles)

    def new_layers(self, after: float, to: float, next_id: int, drained: int) -> tuple[list[Layer], int]:
        """The layers that enter after the time ``after`` until ``to``, and what remains of the ``drained`` particles.

        A tap that recycles water leaves out a layer for which drains have not yet taken enough.
        """
        passing = sorted(
            (time, tap) for tap, nozzle in enumerate(self.nozzles) for time in nozzle.layer_times(after, to).tolist()
        )
        layers = []
        for time, tap in passing:
            size = len(self.nozzles[tap].points)
            if self.nozzles[tap].recycle:
                if drained < size:
                    continue
                drained -= size
            layers.append(Layer(self.nozzles[tap], time, np.arange(next_id, next_id + size)))
            next_id += size
        return layers, drained

    def guides(self, layer: Layer, time: float) -> bool:
        """Whether a layer is still guided at a time."""
        return time - layer.time <= layer.nozzle.guide

    def place(self, layer: Layer, time: float, motion: CarrierMotion) -> tuple[np.ndarray, np.ndarray]:
        """Positions (n, 3) in meters and velocities (n, 3) in m/s of a guided layer at ``time``, the end of a frame."""
        nozzle = layer.nozzle
        points = nozzle.points + (time - layer.time) * nozzle.velocity
        if nozzle.carrier is None:
            return points, np.broadcast_to(nozzle.velocity, points.shape)
        start, end = motion.start[nozzle.carrier], motion.end[nozzle.carrier]
        positions = end.apply(points)
        carried = (positions - start.apply(points)) / motion.seconds
        return positions, carried + end.matrix @ nozzle.velocity

    def energy(self, layers: Sequence[Layer]) -> float:
        """At most what guided ``layers`` bring into the fluid in a frame, the sum over particles in J/kg.

        In air they bring nothing. In water they push it aside, and a layer that comes where water is compresses it.
        """
        return sum(len(layer.ids) * (PUSH + layer.nozzle.speed**2) for layer in layers)

    def cleared(
        self, layers: Sequence[Layer], time: float, motion: CarrierMotion, positions: np.ndarray, velocities: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Move free water out of the water that taps guide, as the wall of a pipe and the water in it would.

        Args:
            layers: that are guided.
            time: the end of the frame, seconds.
            motion: of the carriers in the frame.
            positions: (N, 3) of free particles, meters.
            velocities: (N, 3) of them, m/s.

        Returns:
            New positions and velocities, and which particles (N,) were moved.
        """
        moved = np.zeros(len(positions), bool)
        # A layer may have left a tap that is closed by now.
        nozzles = {id(nozzle): nozzle for nozzle in (*self.nozzles, *(layer.nozzle for layer in layers))}
        for nozzle in nozzles.values():
            ages = [time - layer.time for layer in layers if layer.nozzle is nozzle]
            if not ages:
                continue
            pose = Pose.of() if nozzle.carrier is None else motion.end[nozzle.carrier]
            front = nozzle.speed * max(ages)
            own = positions if nozzle.carrier is None else pose.to_own(positions)
            reach = float(np.linalg.norm(nozzle.half)) + front + nozzle.speed * nozzle.interval
            near = np.flatnonzero((np.abs(own - nozzle.center) < reach).all(axis=1))
            ways, ahead = nozzle.way_out(own[near], front)
            inside = ways.any(axis=1)
            if not inside.any():
                continue
            rows, ways, ahead = near[inside], ways[inside], ahead[inside]
            before = Pose.of() if nozzle.carrier is None else motion.start[nozzle.carrier]
            ways = ways @ pose.matrix.T
            towards = ways / np.linalg.norm(ways, axis=1, keepdims=True)
            pipe = (positions[rows] - before.apply(own[rows])) / motion.seconds
            pipe += ahead[:, None] * (pose.matrix @ nozzle.velocity)
            lacking = np.maximum(0.0, ((pipe - velocities[rows]) * towards).sum(axis=1))
            positions, velocities = positions.copy(), velocities.copy()
            positions[rows] += ways
            velocities[rows] += lacking[:, None] * towards
            moved[rows] = True
        return positions, velocities, moved

    def find_layers(self, positions: np.ndarray, motion: CarrierMotion) -> list[Layer]:
        """The layers that are guided at time 0 among particles at ``positions`` (N, 3), whose ids are their indices."""
        from scipy.spatial import cKDTree

        layers: list[Layer] = []
        if not len(positions):
            return layers
        tree = cKDTree(positions)
        for nozzle in self.nozzles:
            for time in nozzle.layer_times(-nozzle.guide, 0.0).tolist():
                layer = Layer(nozzle, time, np.arange(0))
                distance, ids = tree.query(self.place(layer, 0.0, motion)[0])
                if (np.asarray(distance) < FOUND).all():
                    layers.append(Layer(nozzle, time, np.asarray(ids)))
        return layers
