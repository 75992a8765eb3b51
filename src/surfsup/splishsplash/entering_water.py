"""Water that enters and leaves in SPlisHSPlasH: the taps and drains of a scene, with the same layers and ids.

Its own emitters place particles on lattices of whole diameters, at times of their own, and it has no drains. So it runs
with all particles that will ever be in the scene. Those that are not in it are parked far away and far apart, in the
state in which emitters of SPlisHSPlasH hold particles: neither forces nor pressure move them. A layer is placed by the
speed of its tap after each time step while it is guided, and then released.

The solver iterates until the mean density error over all particles is small. Parked ones have none, so the limit is
scaled by the share of those that are in the scene.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from surfsup.errors import InputError
from surfsup.scene import FRAME_TIME, InitialParticles, Scene
from surfsup.scene.pose import Pose, between
from surfsup.scene.solids import Solids
from surfsup.sph.open_water import Passages
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS
from surfsup.sph.taps import CarrierMotion, Layer
from surfsup.splishsplash.child_process import parking_places

ROUNDING = 1e-6  # of a time step


@dataclass(frozen=True)
class EnteringWater:
    """What enters and leaves in a number of frames, in the units of the solver.

    Attributes:
        passages: taps and drains.
        poses: of all that moves, by name, at a time in seconds.
        present: number of particles at the start.
        layers: that enter, and before them those that taps guide at the start.
        frames: number of frames.
    """

    passages: Passages
    poses: Callable[[float], Mapping[str, Pose]]
    present: int
    layers: tuple[Layer, ...]
    frames: int

    @classmethod
    def of(cls, scene: Scene, solids: Solids, start: InitialParticles, frames: int) -> EnteringWater:
        """That of a scene.

        Args:
            scene: in its own units.
            solids: its solids, in its own units.
            start: its particles at the start, in the units of the solver.
            frames: number of frames of the solver.

        Raises:
            InputError: a tap recycles water, or a file of a drain is unusable.
        """
        if any(tap.recycle for tap in scene.taps):
            raise InputError("the reference solver knows no taps that recycle; use the simulator dfsph")
        time = scene.start_time
        passages = Passages.of(scene, solids, time)
        moving = scene.units.solids_to_solver(solids, time)
        guided = passages.taps.find_layers(start.positions, CarrierMotion(passages.rest, passages.rest, FRAME_TIME))
        count = len(start.positions)
        layers, _ = passages.taps.new_layers(0.0, (frames - 1) * FRAME_TIME, count, 0)
        return cls(passages, moving.poses, count, (*guided, *layers), frames)

    @property
    def count(self) -> int:
        """Number of particles that are ever in the scene."""
        return max([self.present, *(int(layer.ids.max()) + 1 for layer in self.layers)])

    @cached_property
    def first_frames(self) -> np.ndarray:
        """The first frame (N,) in which each particle is in the scene."""
        first = np.zeros(self.count, np.int64)
        for layer in self.layers:
            if layer.time > 0:
                first[layer.ids] = math.ceil(layer.time / FRAME_TIME - ROUNDING)
        return first

    @property
    def parked(self) -> np.ndarray:
        """Where the particles (M, 3) wait that enter later, meters."""
        return parking_places(np.arange(self.present, self.count))

    def table(self) -> np.ndarray:
        """What happens to guided particles after each time step, (M, 9) float64, in the order of steps.

        Columns: step, id, whether it flows freely from then on, position and velocity.
        """
        last = (self.frames - 1) * SUBSTEPS
        rows = [np.empty((0, 9))]
        for layer in self.layers:
            step = max(0, math.ceil(layer.time / SUBSTEP_TIME - ROUNDING))
            guided = True
            while step <= last and guided:
                places = self.passages.taps.place(layer, step * SUBSTEP_TIME, self._motion(layer, step))
                guided = self.passages.taps.guides(layer, (step + 1) * SUBSTEP_TIME)
                rows.append(as_rows(step, layer.ids, not guided, *places))
                step += 1
        table = np.concatenate(rows)
        return table[np.argsort(table[:, 0], kind="stable")]

    def taken(self, before: np.ndarray, after: np.ndarray, frame: int) -> np.ndarray:
        """Which particles (N,) drains take on the way to ``frame``; those with NaN are not in the scene."""
        motion = self._motion_of_frame(frame)
        with np.errstate(invalid="ignore"):
            there = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
        taken = np.zeros(len(after), bool)
        taken[there] = self.passages.taken(before[there], after[there], frame * FRAME_TIME, motion)
        return taken

    def _motion_of_frame(self, frame: int) -> CarrierMotion:
        start, end = ({**self.passages.rest, **self.poses((frame + k) * FRAME_TIME)} for k in (-1, 0))
        return CarrierMotion(start, end, FRAME_TIME)

    def _motion(self, layer: Layer, step: int) -> CarrierMotion:
        """The motion of what carries a tap, in the time step that ends with ``step``."""
        name, rest = layer.nozzle.carrier, self.passages.rest
        if name is None:
            return CarrierMotion(rest, rest, SUBSTEP_TIME)
        frame = max(0, (step - 1) // SUBSTEPS)
        one, other = ({**rest, **self.poses((frame + k) * FRAME_TIME)}[name] for k in (0, 1))
        part = step / SUBSTEPS - frame
        start, end = between(one, other, part - 1 / SUBSTEPS), between(one, other, part)
        return CarrierMotion({name: start}, {name: end}, SUBSTEP_TIME)


def as_rows(step: int, ids: np.ndarray, free: bool, positions: np.ndarray, velocities: np.ndarray) -> np.ndarray:
    """Rows (n, 9) of the table for a layer."""
    head = np.column_stack([np.full(len(ids), step), ids, np.full(len(ids), free)])
    return np.concatenate([head, positions, velocities], axis=1)


def with_ids(
    scene: Scene, positions: np.ndarray, velocities: np.ndarray, poses: Mapping[str, Pose]
) -> tuple[np.ndarray, np.ndarray, Mapping[str, Pose], np.ndarray | None]:
    """A frame with those particles alone that are in the scene, and their ids (K,); None where all always are."""
    if not scene.is_open:
        return positions, velocities, poses, None
    ids = np.flatnonzero(np.isfinite(positions).all(axis=1))
    return positions[ids], velocities[ids], poses, ids
