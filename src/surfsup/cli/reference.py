"""`surfsup reference`: the same scene by the reference solver."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Annotated

import typer

from surfsup.cli.output_options import OutputOptions
from surfsup.cli.progress import progress_bar
from surfsup.cli.scene_options import SceneOptions


def reference(
    scene_options: SceneOptions,
    output: OutputOptions,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the solver.")] = 1,
) -> None:
    """Simulate the scene with SPlisHSPlasH.

    Its trajectories are the ground truth of training and evaluation.

    Example: surfsup reference bunny.obj -o out/bunny-reference
    """
    scene_options.check()
    from surfsup.io.output_folder import OutputFrame
    from surfsup.io.trajectory_format import Provenance
    from surfsup.scene.solids import build_solids
    from surfsup.scene.start import entering_particles
    from surfsup.simulation import Simulation
    from surfsup.splishsplash import solver
    from surfsup.splishsplash.entering_water import with_ids

    scene = scene_options.read()
    if scene.forces:
        warnings.warn("the reference records no forces on solids; the solver dfsph does", stacklevel=1)
    if scene.flush:
        warnings.warn("the reference keeps its water off flush surfaces, too", stacklevel=1)
    solver.check_installed()
    with scene_options.named():
        solids = build_solids(scene)
        start_time = scene.start_time
        particles = Simulation(scene, device="cpu").particles  # as ours begins
    most = len(particles.positions) + entering_particles(scene)
    folder = output.create_folder(scene_options.source, most, scene.frames)
    liquids = particles.liquids
    frames: Iterator[OutputFrame] = (
        OutputFrame(*with_ids(scene, *frame, solids.poses(start_time + number * scene.frame_time)), liquids=liquids)
        for number, frame in enumerate(solver.simulate(scene, solids.still, particles, threads))
    )
    with progress_bar("simulating with SPlisHSPlasH") as bar:
        summary = folder.record(scene, solids, frames, Provenance(solver.NAME), "cpu", bar)
    output.finish(folder, summary, particles.excluded)
