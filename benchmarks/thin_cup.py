"""A cup with a thin wall is carried about for 10 s: does it lose water?

    python benchmarks/thin_cup.py

The cup is moved by 0.55 m and tilted by 12 degrees in every half second, on and on, in open space. Walls of one
particle radius down to a sheet of a tenth of a millimeter; particles of 15 mm.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import torch

from record import write_result
from surfsup.scene import Scene
from surfsup.simulation import Simulation

RADIUS, HEIGHT, FILLED = 0.18, 1.1, 0.3  # meters
SECONDS, MOVE = 10.0, 0.5
WALLS = (0.015, 0.005, 0.001, 0.0001)  # meters


def carried_cup(wall: float) -> dict[str, object]:
    """The scene of a cup with a ``wall`` in meters."""
    keys: list[dict[str, object]] = [{"time": 0.2}]
    for number in range(1, math.ceil(SECONDS / MOVE) + 1):
        angle = 1.1 * number
        place = [0.25 * math.cos(angle), 0.25 * math.sin(angle), 0.5 + 0.1 * (number % 2)]
        tilt = {"axis": [math.cos(2 * angle), math.sin(2 * angle), 0], "degrees": 12}
        keys.append({"time": 0.2 + MOVE * number, "position": place, "rotation": tilt})
    outside = {"cylinder": {"radius": RADIUS + wall, "height": HEIGHT}, "at": [0, 0, HEIGHT / 2]}
    inside = {"cylinder": {"radius": RADIUS, "height": HEIGHT + 1}, "at": [0, 0, wall + (HEIGHT + 1) / 2]}
    cup = {"difference": [outside, inside], "at": [0, 0, 0.5], "motion": {"keyframes": keys}}
    fill = {"fill": {"below": 0.5 + FILLED, "seed": [0, 0, 0.6]}}
    return {"container": "none", "surfaces": {"cup": cup}, "fluid": [fill], "frames": 2000}


def carry(wall: float) -> dict[str, float]:
    """How many particles passed the wall below the rim, and how many left over it."""
    simulation = Simulation(Scene.from_yaml(json.dumps(carried_cup(wall)), "the benchmark's scene", Path()))
    gone = np.zeros(len(simulation.particles.positions), bool)
    through = over = 0
    while simulation.time < SECONDS:
        frame = simulation.step()
        own = frame.poses["cup"].to_own(frame.positions)
        above = own[:, 2] > HEIGHT
        passed = ((np.hypot(own[:, 0], own[:, 1]) > RADIUS + wall) | (own[:, 2] < 0)) & ~above & ~gone
        through, over = through + int(passed.sum()), over + int((above & ~gone).sum())
        gone |= passed | above
    return {"wall_m": wall, "particles": len(gone), "through": through, "over_the_rim": over}


def main() -> None:
    """Carry a cup of each wall, and write the result."""
    torch.set_num_threads(1)
    rows = []
    for wall in WALLS:
        rows.append(carry(wall))
        print(rows[-1], flush=True)
    claim = "Particles that pass the wall of a cup carried about for 10 s, walls of 15 mm to 0.1 mm together"
    figure = sum(row["through"] for row in rows)
    write_result("thin_cup", claim, figure, "", None, None, "python benchmarks/thin_cup.py", {"cases": rows}, threads=1)


if __name__ == "__main__":
    main()
