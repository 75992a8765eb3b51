"""One case of a sweep: simulated on a worker into a folder of its own."""

from __future__ import annotations

import json
import math
import shutil
import uuid
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from surfsup.datasets.folder import PARTIAL
from surfsup.evaluation.metrics import center_height, kinetic_energy
from surfsup.io.output_folder import OutputFolder, OutputFrame
from surfsup.io.trajectory_format import Provenance
from surfsup.simulation import Simulation
from surfsup.simulation_state import Frame
from surfsup.sweep.case import Case
from surfsup.sweep.variation import Value

RESULT = "result.json"


@dataclass
class WaterStatistics:
    """What the water of a case did; filled frame by frame.

    Attributes:
        max_speed: of any particle in any frame, m/s.
        center_height: of the center of mass in the last frame with water, meters.
        kinetic_energy: in the same frame, J/kg.
    """

    max_speed: float = 0.0
    center_height: float = math.nan
    kinetic_energy: float = math.nan

    def watch(self, frames: Iterator[Frame]) -> Iterator[OutputFrame]:
        """Pass the frames on."""
        for frame in frames:
            if len(frame.positions):
                self.max_speed = max(self.max_speed, float(np.linalg.norm(frame.velocities, axis=1).max()))
                self.center_height = center_height(frame.positions)
                self.kinetic_energy = kinetic_energy(frame.velocities)
            yield frame.recorded


def simulate_case(
    case: Case, folder: Path, simulator: str, until: Callable[[Iterator[Frame]], Iterator[Frame]]
) -> None:
    """Simulate a case into ``folder``/name, which appears only when it is complete.

    Args:
        case: the case.
        folder: of the sweep.
        simulator: name of the simulator, or a weights file.
        until: ends the frames early, where the sweep was canceled.

    Raises:
        InputError: the scene or the simulator is unusable.
        SimulationError: the simulation failed.
    """
    target = folder / case.name
    if (target / RESULT).exists():  # by a worker that was lost before it reported
        return
    partial = folder / f".{case.name}.{uuid.uuid4().hex}{PARTIAL}"
    try:
        scene = case.scene
        simulation = Simulation(scene, simulator, device="cpu")
        output = OutputFolder(partial, simulation.most_ids(), scene.frames)
        water = WaterStatistics()
        frames = water.watch(until(simulation.run()))
        summary = output.record(
            scene, simulation.motion.solids, frames, Provenance(simulator), "cpu", lambda done, total: None
        )
        figures = {name: value for name, value in asdict(summary).items() if name not in ("model", "device", "version")}
        write_result(partial, case, {**figures, **asdict(water)})
        partial.replace(target)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def write_result(folder: Path, case: Case, figures: Mapping[str, Value]) -> None:
    """Write the row of the table that the case gives."""
    row = {"case": case.name, "scene": case.scene_name, **case.values, **figures}
    (folder / RESULT).write_text(json.dumps(row, indent=2) + "\n")
