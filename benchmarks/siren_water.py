"""Water on a SIREN beside water on the mesh that it was fitted to, both judged by the reference solver on the mesh.

    python benchmarks/siren_water.py dragon.safetensors dragon.obj [--up y] [--frames 400] [--turns 0 120 240]
        [--model NAME] [-o FOLDER]

Of each turn of the solid about z the solver makes the truth, and the model four rollouts: on the mesh, on the SIREN,
and on either with the water 1 mm aside, which says how much of a difference is chance. Chamfer distances are means
over all frames, in meters; particles count as inside by the exact distance to the mesh, summed over the frames.
Truths are kept in FOLDER and not made twice.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np
import torch

from surfsup.evaluation.evaluate import judge_file
from surfsup.evaluation.scores import ALL
from surfsup.io.trajectory import Provenance, TrajectoryWriter
from surfsup.learned import weights_file
from surfsup.scene import Scene, Start
from surfsup.scene.fluid import Block
from surfsup.scene.mesh_scene import Placing, pour_on
from surfsup.scene.scene import Container
from surfsup.simulation import simulate
from surfsup.sph.simulator import Simulator
from surfsup.splishsplash import solver

FIT = 0.7  # meters: largest extent of the solid
BLOCK = Block(min=(-0.225, -0.225, 0.65), max=(0.225, 0.225, 1.1))
ASIDE = 1e-3  # meters


def scene_of(path: Path, up: str | None, turn: float, frames: int) -> Scene:
    """The same block of water over the solid in ``path``, turned by so many degrees."""
    return pour_on(path, Placing(FIT, up, turn), Container(), BLOCK, frames)[0]


def write_truth(path: Path, scene: Scene, start: Start) -> None:
    """What the reference solver makes of ``scene``, whole or not at all."""
    partial = path.with_suffix(".partial")
    frames = solver.simulate(scene, scene.build_surface(), start)
    with TrajectoryWriter(partial, scene, Provenance(solver.NAME), len(start.positions)) as writer:
        for frame in frames:
            writer.append(*frame)
    partial.replace(path)


def write_rollout(path: Path, model: Simulator, scene: Scene, start: Start, aside: float) -> None:
    """What ``model`` makes of ``scene``, its water moved by ``aside`` along x."""
    moved = Start([block + np.float32([aside, 0, 0]) for block in start.blocks], start.velocities, start.left_out)
    with TrajectoryWriter(path, scene, Provenance("model"), len(start.positions)) as writer:
        for frame in simulate(model, scene, scene.build_surface(), moved, "cpu"):
            writer.append(*frame)


def main() -> None:
    """A line a turn and solid, then the ratio of the means."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("siren", type=Path)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--up", choices=("y", "z"))
    parser.add_argument("--frames", type=int, default=400)
    parser.add_argument("--turns", type=float, nargs="+", default=[0.0, 120.0, 240.0])
    parser.add_argument("--model", default=weights_file.DEFAULT_MODEL)
    parser.add_argument("-o", "--out", type=Path, default=Path("out/siren-water"))
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    arguments.out.mkdir(parents=True, exist_ok=True)
    model, _ = weights_file.load(weights_file.find(arguments.model))
    found: dict[str, list[float]] = {}
    for turn in arguments.turns:
        name = f"{arguments.mesh.stem}-{turn:g}-{arguments.frames}"
        mesh_scene = scene_of(arguments.mesh, arguments.up, turn, arguments.frames)
        start = mesh_scene.start(mesh_scene.build_surface())
        truth = arguments.out / f"{name}-truth.h5"
        if not truth.exists():
            write_truth(truth, mesh_scene, start)
        scenes = {"mesh": mesh_scene, "SIREN": scene_of(arguments.siren, None, turn, arguments.frames)}
        for aside in (0.0, ASIDE):
            for solid, scene in scenes.items():
                rollout = arguments.out / f"{name}-{solid.lower()}{'-aside' if aside else ''}.h5"
                write_rollout(rollout, model, scene, start, aside)
                judgment = judge_file(rollout, truth)
                chamfer = judgment.scores[ALL]["chamfer"]
                found.setdefault(solid, []).append(chamfer)
                inside, depth = int(judgment.own.own.inside.sum()), judgment.scores[ALL]["depth"]
                print(
                    f"turned by {turn:g} degrees, on the {solid}{', 1 mm aside' if aside else ''}: Chamfer "
                    f"{chamfer:.4f} m, inside {inside} of {judgment.particles * arguments.frames}, "
                    f"{-1000 * (depth or 0):.2f} mm deep in the mean",
                    flush=True,
                )
    mesh, siren = (np.array(found[solid]) for solid in ("mesh", "SIREN"))
    print(f"means {mesh.mean():.4f} and {siren.mean():.4f} m: ratio {siren.mean() / mesh.mean():.3f}")
    print(f"single runs: SIREN over mesh {', '.join(f'{ratio:.3f}' for ratio in siren / mesh)}")
    chance = mesh[1::2] / mesh[::2]
    print(f"mesh, 1 mm aside over not: {', '.join(f'{ratio:.3f}' for ratio in chance)}")


if __name__ == "__main__":
    main()
