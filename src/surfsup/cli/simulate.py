"""`surfsup simulate`: pour water on a surface."""

from __future__ import annotations

import warnings

from surfsup.cli.options import Device, NoCollisions, SimulatorName
from surfsup.cli.output_options import OutputOptions
from surfsup.cli.progress import progress_bar
from surfsup.cli.scene_options import SceneOptions


def simulate(
    scene_options: SceneOptions,
    output: OutputOptions,
    simulator_name: SimulatorName = "dfsph",
    device: Device = None,
    no_collisions: NoCollisions = False,
) -> None:
    """Pour water on a surface.

    Example: surfsup simulate bunny.obj -o out/bunny
    """
    from surfsup.io.trajectory import Provenance
    from surfsup.learned.loading import load_simulator
    from surfsup.simulation import Simulation
    from surfsup.sph.device import choose_device

    simulator, card = load_simulator(simulator_name)
    name = card.name if card else simulator_name
    scene = scene_options.read()
    device = choose_device("cpu" if device is None and scene.needs_native else device)
    if card and card.training_domain and (warning := card.training_domain.warning(scene)):
        warnings.warn(warning, stacklevel=1)
    simulation = Simulation(scene, simulator, device, handle_collisions=not no_collisions)
    folder = output.create_folder(scene_options.source, simulation.most_ids(), scene.frames)
    frames = ((frame.positions, frame.velocities, frame.poses, frame.ids, frame.forces) for frame in simulation.run())
    with progress_bar(f"simulating with {name}") as bar:
        summary = folder.record(scene, simulation.motion.solids, frames, Provenance(name), device, bar)
    output.finish(folder, summary, simulation.particles.excluded)
