"""A data set: many scenes of one recipe, simulated by the reference solver, one file each."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import numpy as np
import torch
import yaml

from surfsup import __version__
from surfsup.datasets.recipes import RECIPES
from surfsup.errors import InputError
from surfsup.reference import solver
from surfsup.scene import Scene
from surfsup.scene.text import parse_yaml
from surfsup.trajectory import Provenance, Trajectory, TrajectoryWriter

ENERGY_GAIN = 0.05  # J/kg: of 87 scenes 81 gained at most 0.02; those that the cone map kicked 0.11 to 2.8
ATTEMPTS = 5  # scenes drawn for one index before it is given up


def recipe_scene(recipe: str, seed: int, index: int, attempt: int = 0) -> Scene:
    """Scene ``index`` of the data set ``recipe`` from ``seed``; the same arguments, the same scene.

    Args:
        recipe: which recipe.
        seed: of the data set.
        index: of the scene in it.
        attempt: counts the scenes of this index whose simulations were set aside.

    Raises:
        InputError: there is no such recipe, or the seed is negative.
    """
    if recipe not in RECIPES:
        raise InputError(f"there is no recipe '{recipe}'; known are {', '.join(RECIPES)}")
    if seed < 0:
        raise InputError(f"seed is {seed}, but must not be negative")
    entropy = [seed, index] if attempt == 0 else [seed, index, attempt]
    return RECIPES[recipe](Path()).scene(index, np.random.default_rng(entropy))


def generate(
    recipe: str,
    folder: Path,
    count: int,
    seed: int,
    workers: int,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Simulate ``count`` scenes of ``recipe`` into ``folder``; those already there are kept.

    Args:
        recipe: which scenes.
        folder: gets one trajectory file a scene and ``dataset.yaml``.
        count: how many scenes.
        seed: with the scene's number it decides everything about the scene.
        workers: simulations side by side, each on one core.
        progress: told how many of how many scenes are done.

    Returns:
        The trajectory files in order.

    Raises:
        InputError: no such recipe, nothing to make, or the folder holds another data set.
    """
    if count < 1 or workers < 1:
        raise InputError(f"generate: asked for {count} scenes by {workers} workers; both must be at least 1")
    recipe_scene(recipe, seed, 0)
    folder.mkdir(parents=True, exist_ok=True)
    claim_folder(folder, recipe, seed)
    paths = [folder / f"{index:05d}.h5" for index in range(count)]
    missing = [index for index, path in enumerate(paths) if not path.exists()]
    done = count - len(missing)
    # A simulation is a process of its own; the thread that waits for it costs nothing.
    with ThreadPoolExecutor(workers) as pool:
        running = [pool.submit(simulate_one, recipe, seed, index, paths[index]) for index in missing]
        try:
            for finished in as_completed(running):
                finished.result()
                done += 1
                if progress is not None:
                    progress(done, count)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return paths


def claim_folder(folder: Path, recipe: str, seed: int) -> None:
    """Write what ``folder`` is for, or check that it is for just this.

    Raises:
        InputError: it holds another recipe or seed, or does not say what it holds.
    """
    path = folder / "dataset.yaml"
    wanted = {"recipe": recipe, "seed": seed, "solver": solver.NAME, "version": __version__}
    if not path.exists():
        path.write_text(yaml.safe_dump(wanted, sort_keys=False))
        return
    found = parse_yaml(path.read_text(errors="replace"), str(path))
    if not isinstance(found, dict):
        raise InputError(f"{path}: does not say what data the folder holds; take another folder")
    if (found.get("recipe"), found.get("seed")) != (recipe, seed):
        raise InputError(
            f"{folder}: holds recipe '{found.get('recipe')}' of seed {found.get('seed')}; "
            f"take another folder for '{recipe}' of seed {seed}"
        )


def simulate_one(recipe: str, seed: int, index: int, path: Path) -> None:
    """Simulate one scene into ``path``, which appears only when it is whole and sound.

    A scene whose simulation is not physical is set aside, its reason kept in a file beside ``path``, and
    another is drawn in its place.

    Raises:
        SolverError: no scene of this index could be simulated.
    """
    reasons: list[str] = []
    partial = path.with_suffix(".partial")
    while len(reasons) < ATTEMPTS:
        scene = recipe_scene(recipe, seed, index, attempt=len(reasons))
        surface = scene.build_surface()
        start = scene.start(surface)
        provenance = Provenance(solver.NAME, seed)
        with TrajectoryWriter(partial, scene, provenance, len(start.positions)) as writer:
            for positions, velocities in solver.simulate(scene, surface, start):
                writer.append(positions, velocities)
        reason = what_is_wrong(partial)
        if reason is None:
            partial.rename(path)
            return
        reasons.append(reason)
        path.with_suffix(".set-aside.txt").write_text("\n".join(reasons) + "\n")
    partial.unlink()
    raise solver.SolverError(f"{path}: {ATTEMPTS} scenes in a row were set aside, the last because {reasons[-1]}")


def what_is_wrong(path: Path) -> str | None:
    """Why the trajectory in ``path`` is not physical: not finite, in the solid, outside, burst; None when it is."""
    with Trajectory(path) as trajectory:
        surface = trajectory.scene.build_surface()
        container = trajectory.scene.container
        positions = torch.from_numpy(trajectory.positions[:])
        velocities = torch.from_numpy(trajectory.velocities[:])
    if not bool(torch.isfinite(positions).all() and torch.isfinite(velocities).all()):
        return "a position or velocity is not finite"
    lower, upper = torch.tensor(container.lower), torch.tensor(container.upper)
    if bool((positions < lower).any() or (positions > upper).any()):
        return "a particle left the container"
    if surface is not None:
        with torch.no_grad():
            deepest = min(float(surface.distance(frame).min()) for frame in positions)
        if deepest < 0:
            return f"a particle was {-deepest:.3g} m inside the solid"
    gained = energy_gained(positions, velocities, trajectory.scene.gravity)
    if gained > ENERGY_GAIN:
        return f"the fluid gained {gained:.3g} J/kg, where it can only lose: it burst"
    return None


def energy_gained(positions: torch.Tensor, velocities: torch.Tensor, gravity: tuple[float, float, float]) -> float:
    """The largest rise of the mean mechanical energy over any stretch of frames, J/kg.

    Beyond the sharp tip of a cone the solver's map of it can have the wrong sign, far out in free space; a block that
    starts there bursts in the first frames.
    """
    kinetic = 0.5 * velocities.double().square().sum(dim=-1).mean(dim=-1)
    potential = -(positions.double() @ torch.tensor(gravity, dtype=torch.float64)).mean(dim=-1)
    energy = kinetic + potential
    return float((energy - energy.cummin(dim=0).values).max())
