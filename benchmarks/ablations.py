"""What each part of the default model and of its training is worth: one thing at a time is left out or changed.

    python benchmarks/ablations.py data/prim-shapes-train data/prim-shapes-validation
    python benchmarks/ablations.py data/prim-shapes-train data/prim-shapes-validation --only as-it-is no-symmetry

Every variant is trained from scratch for the same number of steps and judged by rollouts on validation scenes, and by
how fast a pool still is after 800 frames (`at_rest.py`). What is left out is held at zero weights, so that all else,
random numbers too, is as it was. Runs that are there are kept.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from unittest.mock import patch

import numpy as np
import torch
from torch import Tensor

sys.path.insert(0, str(Path(__file__).parent))
from at_rest import root_mean_square_speed, scene_of
from surfsup.datasets import windows as windows_module
from surfsup.datasets.windows import Windows
from surfsup.learned import weights_file
from surfsup.learned.corrected.network import ConvolutionNetwork
from surfsup.simulation import simulate
from surfsup.training.config import load_config
from surfsup.training.train import Run, train

SWEEPS, SOLIDS, VELOCITIES, DENSITY = (
    slice(0, 6),
    slice(6, 9),
    slice(9, 12),
    slice(12, 14),
)  # columns of what acts on a particle
DIRECTIONS = (1, 2, 3)  # kernels of a layer
FIRST, LAST = 0, 1  # phases of the preset: single frames, then push-forward

REST = 800  # frames

Part = tuple[Tensor, object]  # a weight, and which of its elements


def nothing(_network: ConvolutionNetwork) -> Iterator[Part]:
    """All parts are there."""
    yield from ()


def answers(network: ConvolutionNetwork) -> Iterator[Part]:
    """All that the network says: the solver's rule is alone."""
    yield network.decoder[-1].weight, slice(None)


def velocities(network: ConvolutionNetwork) -> Iterator[Part]:
    """The neighbors' velocity against the particle's own."""
    yield network.encoder[0].weight, (slice(None), VELOCITIES)


def sweeps(network: ConvolutionNetwork) -> Iterator[Part]:
    """What the sweeps have made; it is corrected all the same."""
    yield network.encoder[0].weight, (slice(None), SWEEPS)


def solids(network: ConvolutionNetwork) -> Iterator[Part]:
    """The slope of what solid and walls add to density."""
    yield network.encoder[0].weight, (slice(None), SOLIDS)


def density(network: ConvolutionNetwork) -> Iterator[Part]:
    """By how much density would be too high, and how fast it rises."""
    yield network.encoder[0].weight, (slice(None), DENSITY)


def factors(network: ConvolutionNetwork) -> Iterator[Part]:
    """How the neighbors lie: the factors are then all one."""
    yield network.factors[2].weight, slice(None)
    yield network.factors[2].bias, slice(None)


def directions(network: ConvolutionNetwork) -> Iterator[Part]:
    """The kernels of every layer that say where a neighbor is."""
    for layer in network.layers:
        width = layer.own.weight.shape[0]
        yield layer.mix.weight, np.concatenate([np.arange(width) + kernel * width for kernel in DIRECTIONS])


@dataclass(frozen=True)
class Variant:
    """One change.

    Attributes:
        overrides: of the configuration.
        phases: what is changed in each of the preset's phases, by its number.
        left_out: which weights are held at zero.
        scenes: how many are trained on; None: all.
        turned: whether windows are turned and mirrored.
    """

    overrides: tuple[str, ...] = ()
    phases: Mapping[int, Mapping[str, float]] = field(default_factory=dict)
    left_out: Callable[[ConvolutionNetwork], Iterator[Part]] = nothing
    scenes: int | None = None
    turned: bool = True


def in_phases(**changes: float) -> Variant:
    """The same change in both phases."""
    return Variant(phases={FIRST: changes, LAST: changes})


VARIANTS = {
    "as-it-is": Variant(),
    "rule-alone": Variant(left_out=answers),
    "another-seed": Variant(("seed=1",)),
    "adam": Variant(("optimizer=adam", "learning_rate=2e-3")),
    "adam-5e-3": Variant(("optimizer=adam",)),
    "batch-2": Variant(("batch=2",)),
    "no-velocities": Variant(left_out=velocities),
    "not-told-of-solids": Variant(left_out=solids),
    "not-told-of-sweeps": Variant(left_out=sweeps),
    "not-told-of-density": Variant(left_out=density),
    "no-density-factors": Variant(left_out=factors),
    "no-directions": Variant(left_out=directions),
    "no-symmetry": Variant(turned=False),
    "5-scenes": Variant(scenes=5),
    "15-scenes": Variant(scenes=15),
    "2-layers": Variant(("layers=2",)),
    "3-layers": Variant(("layers=3",)),
    "32-channels": Variant(("width=32", "messages=32")),
    "48-channels": Variant(("width=48", "messages=16")),
    "no-noise": in_phases(noise=0),
    "noise-1e-3": in_phases(noise=1e-3),
    "single-frames": Variant(phases={LAST: {"unseen": 0}}),
    "loss-of-two": Variant(phases={LAST: {"unroll": 2}}),
    "loss-of-four": Variant(phases={LAST: {"unroll": 4}}),
    "no-calm-term": in_phases(calm=0),
    "no-starts": in_phases(starts=0),
}


def hold(run: Run, weight: Tensor, which: object) -> None:
    """Keep some elements of a weight at zero for good."""
    free = torch.ones_like(weight)
    free[which] = 0

    def clear(*_: object) -> None:
        with torch.no_grad():
            weight.mul_(free)

    clear()
    weight.register_hook(lambda gradient: gradient * free)
    run.plain_optimizer.register_step_post_hook(clear)  # SOAP turns gradients before it scales them


def run_variant(variant: Variant, data: Path, validation: Path, folder: Path, steps: int) -> None:
    """Train it from scratch and judge it once, at the end."""
    common = [f"steps={steps}", f"judge_every={steps}", "judge_scenes=6", "judge_frames=300", "stop=null"]
    phases = [phase.model_dump() for phase in load_config("fast").phases]
    for number, changes in variant.phases.items():
        phases[number].update(changes)
    config = load_config("fast", [*common, f"phases={json.dumps(phases)}", *variant.overrides])
    with ExitStack() as stack:
        if not variant.turned:
            stack.enter_context(patch.object(windows_module, "symmetry", lambda random: torch.eye(3)))
        run = Run(config, folder)
        for weight, which in variant.left_out(run.model.network):
            hold(run, weight, which)
        run.average.load_state_dict(run.model.state_dict())
        source = Windows(data)
        if variant.scenes is not None:
            source.paths = source.paths[: variant.scenes]
        train(run, source, validation)


def speed_at_rest(model: Path) -> float:
    """The root mean square speed of a pool in mm/s, after REST frames."""
    scene = scene_of(0.6, 0.3, REST + 1)
    frames = simulate(weights_file.load(model)[0], scene, None, scene.start(None), "cpu")
    _, velocities = next(islice(frames, REST, None))
    return root_mean_square_speed(velocities)


def main() -> None:
    """Train what is not there yet, print a row for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("validation", type=Path)
    parser.add_argument("--only", nargs="+", choices=VARIANTS, default=list(VARIANTS), metavar="NAME")
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("-o", "--out", type=Path, default=Path("runs/ablations"))
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    columns = ("Chamfer, m", "height, mm", "energy", "pool, mm/s", "training, s")
    print(" " * 20 + "".join(f"{column:>12}" for column in columns))
    for name in arguments.only:
        folder = arguments.out / name
        log = folder / "log.csv"
        if not log.exists():
            run_variant(VARIANTS[name], arguments.data, arguments.validation, folder, arguments.steps)
        with log.open(newline="") as file:
            *_, row = csv.DictReader(file)
        chamfer, height, energy = (float(row[key]) for key in ("chamfer", "height_error", "energy_ratio"))
        speed = speed_at_rest(folder / "best.safetensors")
        told = f"{chamfer:>12.4f}{1000 * height:>12.1f}{energy:>12.2f}{speed:>12.1f}{row['seconds']:>12}"
        print(f"{name:<20}{told}", flush=True)


if __name__ == "__main__":
    main()
