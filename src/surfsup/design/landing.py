"""Where particles of a simulation that knows of no leaving would have left: the solver's frames, scored like ours."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import torch
from torch import Tensor

from surfsup.design.rollout import crossing


def settled(frames: Iterable[tuple[np.ndarray, np.ndarray]], floor: float | None) -> tuple[Tensor, Tensor]:
    """The last positions (N, 3) in meters, and which particles (N,) had come down to ``floor`` by then.

    One that had stays where it came down first, as if it had left the simulation there.

    Args:
        frames: positions and velocities (N, 3) of each frame.
        floor: meters; None where nothing leaves.
    """
    places = landed = None
    for positions, _ in frames:
        now = torch.from_numpy(positions)
        if places is None or landed is None:
            places, landed = now, torch.zeros(len(now), dtype=torch.bool)
            continue
        lands = torch.zeros_like(landed) if floor is None else ~landed & (now[:, 2] <= floor)
        here = now if floor is None else torch.where(lands[:, None], crossing(places, now, floor), now)
        places, landed = torch.where(landed[:, None], places, here), landed | lands
    if places is None or landed is None:
        raise ValueError("there are no frames")
    return places, landed
