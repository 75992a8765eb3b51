"""`surfsup simulate`: pour water on a surface."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from surfsup.cli.options import Device, NoCollisions, SimulatorName
from surfsup.cli.output_options import OutputOptions
from surfsup.cli.progress import progress_bar
from surfsup.cli.scene_options import SceneOptions
from surfsup.learned.simulator_names import require_simulator

if TYPE_CHECKING:
    from surfsup.io.output_folder import OutputFrame, Summary
    from surfsup.scene import Scene


def simulate(
    scene_options: SceneOptions,
    output: OutputOptions,
    simulator_name: SimulatorName = "dfsph",
    fast: Annotated[
        bool, typer.Option("--fast", help="Long steps: 2.5 times as fast, somewhat less accurate.")
    ] = False,
    device: Device = None,
    no_collisions: NoCollisions = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an interrupted simulation in the output folder.")
    ] = False,
) -> None:
    """Pour water on a surface.

    Example: surfsup simulate bunny.obj -o out/bunny
    """
    scene_options.check()
    require_simulator(simulator_name)
    from surfsup.continuation import Continuation
    from surfsup.errors import InputError
    from surfsup.io.trajectory_format import Provenance
    from surfsup.learned.loading import load_simulator
    from surfsup.learned.simulator_names import DEFAULT_SIMULATOR, FAST_SIMULATOR
    from surfsup.simulation import Simulation
    from surfsup.sph.device import choose_device

    began = time.perf_counter()
    if fast:
        if simulator_name not in (DEFAULT_SIMULATOR, FAST_SIMULATOR):
            raise InputError(f"--fast is for the solver; omit it, or --simulator {simulator_name}")
        simulator_name = FAST_SIMULATOR
    simulator, card = load_simulator(simulator_name)
    name = card.name if card else simulator_name
    scene = scene_options.read()
    device = choose_device("cpu" if device is None and scene.needs_native else device)
    if card and card.training_domain and (warning := card.training_domain.warning(scene)):
        warnings.warn(warning, stacklevel=1)

    def simulation_of(part: Scene) -> Simulation:
        return Simulation(part, simulator, device, handle_collisions=not no_collisions)

    frames: Iterator[OutputFrame]
    kept = 0
    if resume:
        with scene_options.named():
            rest = Continuation(output.interrupted(scene_options.source), scene, name, simulation_of)
        simulation, most_ids, frames, kept = rest.simulation, rest.most_ids, rest.frames(), rest.kept
    else:
        with scene_options.named():
            simulation = simulation_of(scene)
        most_ids = simulation.most_ids()
        frames = (frame.recorded for frame in simulation.run())
    folder = output.create_folder(scene_options.source, most_ids, scene.frames)
    with progress_bar(f"simulating with {name}") as bar:

        def show(done: int, total: int) -> None:
            if done > kept:  # what is copied would count as speed in the time left
                bar(done, total)

        solids, crossings = simulation.motion.solids, lambda: simulation.state.crossings
        named = scene_options.named_while(frames)
        summary = folder.record(scene, solids, named, Provenance(name), device, show, began, crossings)
    output.finish(folder, summary, simulation.particles.excluded)
    if not no_collisions:
        warn_of_misplaced(summary)


def warn_of_misplaced(summary: Summary) -> None:
    """Warn of particles where collision handling lets none be: a moving solid may press them against a wall."""
    places = {
        "in a solid": summary.penetrations,
        "out of the container": summary.out_of_container,
        "on the other side of a solid": summary.crossings or 0,
    }
    if found := ", ".join(f"{count} times {place}" for place, count in places.items() if count):
        warnings.warn(
            f"a particle was {found} at the end of a frame; a solid that moves or overlaps another leaves it no room "
            "there, so give it a way out",
            stacklevel=1,
        )
