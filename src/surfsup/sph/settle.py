"""Water that comes to rest before a scene begins."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from surfsup.scene import SPACING, InitialParticles
from surfsup.scene.strict_model import Vector
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import mixture_state

# Mean kinetic energy in J/kg below which water counts as at rest: 1 cm/s, where a deep pool keeps 7 mm/s (measured).
MAX_ENERGY = 5e-5
QUIET_FRAMES = 40  # that in a row must be below it
MAX_FRAMES = 2000  # 10 s
OVERLAP = 0.9  # spacings


class NotSettledWarning(UserWarning):
    """The water was still moving when the time limit of settling was reached; the message says how fast."""


def settled(start: InitialParticles, environment: Environment, speed_unit: float = 1.0) -> InitialParticles:
    """Let the entries that settle come to rest, without the others, which then lose particles that overlap them.

    Args:
        start: particles in the units of the solver.
        environment: solid, container and gravity; nothing moves in it.
        speed_unit: m/s of a unit of velocity, for the warning.

    Warns:
        NotSettledWarning: water was still moving after the time limit.
    """
    moving = [number for number, settles in enumerate(start.settle) if settles]
    blocks = list(start.block_positions)
    ends = np.cumsum([len(blocks[number]) for number in moving])
    of_mixture = moving if start.block_liquids else ()
    liquids = [np.full(len(blocks[number]), start.block_liquids[number]) for number in of_mixture]
    if len({int(values[0]) for values in liquids if len(values)}) < 2:
        # One liquid rests where any does. The solver's own water gets there sooner than thin or viscous liquids.
        environment, liquids = replace(environment, liquid=None), []
    positions = resting(np.concatenate([blocks[number] for number in moving]), environment, speed_unit, liquids)
    for number, block in zip(moving, np.split(positions, ends[:-1]), strict=True):
        blocks[number] = block
    return without_overlaps(replace(start, block_positions=blocks, settle=()), moving, positions)


def resting(
    positions: np.ndarray, environment: Environment, speed_unit: float, liquids: Sequence[np.ndarray] = ()
) -> np.ndarray:
    """Where particles at ``positions`` (N, 3) come to rest, (N, 3) float32.

    ``liquids``, together (N,), are the numbers of those of a mixture.
    """
    solver = DfsphSolver()
    water = torch.from_numpy(positions).to(environment.lower.device)
    state = solver.initial_state(water, torch.zeros_like(water), environment)
    if len(liquids):
        state = mixture_state(state, np.concatenate(liquids))
    quiet, energy = 0, 0.0
    for _ in range(MAX_FRAMES):
        state, _ = solver.step(state, environment)
        energy = 0.5 * float(state.velocities.square().sum(dim=-1).mean())
        quiet = quiet + 1 if energy < MAX_ENERGY else 0
        if quiet > QUIET_FRAMES:
            break
    else:
        warnings.warn(
            f"fluid: water that settles still moves at {speed_unit * (2 * energy) ** 0.5:.2g} m/s on average after the "
            "time limit; the scene begins with it",
            NotSettledWarning,
            stacklevel=2,
        )
    return state.positions.cpu().numpy()


def without_overlaps(start: InitialParticles, settled_entries: Sequence[int], water: np.ndarray) -> InitialParticles:
    """``start`` without the particles of other entries that are too close to the settled ``water`` (M, 3)."""
    from scipy.spatial import cKDTree

    tree = cKDTree(water)
    blocks: list[np.ndarray] = []
    velocities: list[Vector | np.ndarray] = []
    kept: list[int] = []
    excluded = start.excluded
    pairs = zip(start.block_positions, start.block_velocities, strict=True)
    for number, (block, velocity) in enumerate(pairs):
        free = np.ones(len(block), bool)
        if number not in settled_entries:
            free = np.asarray(tree.query(block)[0]) > OVERLAP * SPACING
        if free.any():
            kept.append(number)
            blocks.append(block[free])
            velocities.append(velocity[free] if isinstance(velocity, np.ndarray) else velocity)
        excluded += int((~free).sum())
    liquids = [start.block_liquids[number] for number in kept if start.block_liquids]
    return replace(start, block_positions=blocks, block_velocities=velocities, excluded=excluded, block_liquids=liquids)
