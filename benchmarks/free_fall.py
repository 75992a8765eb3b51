"""Error of a rollout while its water falls freely: in the last frame before the water comes near solid or floor.

    python benchmarks/free_fall.py [DATA] [--scenes 10] [--simulators dfsph runs/other/best.safetensors]

Root mean square distance of the particles from their true positions in millimeters, and the distance of the water from
the nearest wall. A free fall is known exactly, so all of the distance is error.
"""

from __future__ import annotations

import argparse
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from surfsup.io.trajectory import Trajectory
from surfsup.learned.loading import load_simulator
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.sdf import Surface
from surfsup.sph.environment import Environment
from surfsup.sph.simulator import Simulator

CONTACT_DISTANCE = 0.045  # meters, from solid or floor
MOST_FRAMES = 120


def last_frame_of_fall(reference: np.ndarray, surface: Surface | None, floor: float) -> int:
    """The last frame before any particle of (F, N, 3) is closer than ``CONTACT_DISTANCE``."""
    for frame, positions in enumerate(reference):
        distance = np.inf if surface is None else float(surface.distance(torch.from_numpy(positions)).min())
        if min(distance, float(positions[:, 2].min()) - floor) < CONTACT_DISTANCE:
            return frame - 1
    return len(reference) - 1


def error_of_fall(simulator: Simulator, trajectory: Trajectory) -> tuple[float, float, int]:
    """Error in millimeters in the last frame of the fall, meters to the nearest wall at the start, that frame."""
    scene = trajectory.scene
    surface = scene.build_surface()
    reference, _ = trajectory.window(0, min(MOST_FRAMES, len(trajectory)))
    frame = last_frame_of_fall(reference, surface, scene.container.lower[2])
    lower, upper = np.array(scene.container.lower)[:2], np.array(scene.container.upper)[:2]
    wall = min(float((reference[0, :, :2] - lower).min()), float((upper - reference[0, :, :2]).min()))
    start, environment = scene.initial_particles(surface), Environment.of(scene, surface)
    positions, velocities = torch.from_numpy(start.positions), torch.from_numpy(start.velocities)
    state = simulator.initial_state(positions, velocities, environment)
    for _ in range(frame):
        state, _ = simulator.step(state, environment)
    distances = np.linalg.norm(state.positions.numpy() - reference[frame], axis=1)
    return 1000 * float(np.sqrt((distances**2).mean())), wall, frame


def main() -> None:
    """Print a row for each scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="?", default=Path("data/prim-shapes-validation"))
    parser.add_argument("--scenes", type=int, default=10)
    parser.add_argument("--simulators", nargs="+", default=[DEFAULT_SIMULATOR], help="names or weights files")
    arguments = parser.parse_args()
    torch.set_grad_enabled(False)
    torch.set_num_threads(1)
    simulators = [load_simulator(name)[0] for name in arguments.simulators]
    print(
        f"{'scene':<12}{'frame':>6}{'wall, m':>9}"
        + "".join(f"{Path(name).parent.name or name:>14}" for name in arguments.simulators)
    )
    errors = []
    for path in islice(sorted(arguments.data.glob("*.h5")), arguments.scenes):
        with Trajectory(path) as trajectory:
            found = [error_of_fall(simulator, trajectory) for simulator in simulators]
        errors.append([error for error, _, _ in found])
        _, wall, frame = found[0]
        print(f"{path.stem:<12}{frame:>6}{wall:>9.3f}" + "".join(f"{error:>11.3f} mm" for error in errors[-1]))
    print(f"{'mean':<27}" + "".join(f"{error:>11.3f} mm" for error in np.mean(errors, axis=0)))


if __name__ == "__main__":
    main()
