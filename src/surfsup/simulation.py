"""A scene run by a learned simulator, as arrays at the file edge."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch

from surfsup.errors import InputError
from surfsup.scene import Scene, Start
from surfsup.sdf import Surface
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import Environment


def simulate(
    model: Simulator, scene: Scene, surface: Surface | None, start: Start, device: str, handle_collisions: bool = True
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield positions (N, 3) in meters and velocities (N, 3) in m/s of each frame, both float32.

    Args:
        model: the learned simulator.
        scene: container, gravity and the number of frames.
        surface: the scene's solid.
        start: the particles of frame 0.
        device: where to compute.
        handle_collisions: whether the guard keeps particles out of the solid and in the container.
    """
    model = model.to(device)
    environment = Environment.of(scene, surface, device)
    state = model.start(
        torch.from_numpy(start.positions).to(device),
        torch.from_numpy(start.particle_velocities).to(device),
        environment,
    )
    for now, _ in model.rollout(state, environment, scene.frames, handle_collisions):
        yield now.positions.cpu().numpy(), now.velocities.cpu().numpy()


def choose_device(name: str | None) -> str:
    """The device of that name; without a name a GPU where there is one.

    Raises:
        InputError: torch knows no such device here.
    """
    if name is None:
        return "cuda" if torch.cuda.is_available() else "cpu"
    kind = name.partition(":")[0]
    if kind not in ("cpu", "cuda"):
        raise InputError(f"there is no device '{name}'; give cpu or cuda")
    try:
        torch.empty(1, device=name)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).strip().splitlines()[0]
        raise InputError(f"the device '{name}' cannot be used here ({reason}); try --device cpu") from None
    return name
