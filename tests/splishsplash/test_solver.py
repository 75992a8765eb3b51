import json
import os
import signal
import subprocess
import tempfile
from dataclasses import replace

import numpy as np
import pytest
import torch

from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import FRAME_TIME, Block, Scene
from surfsup.scene.solids import build_solids
from surfsup.simulation import Simulation
from surfsup.sph.start import MovedApartWarning
from surfsup.splishsplash import job_files, solver
from tests.scene.similar import similar_scene

try:
    solver.check_installed()
except InputError as missing:
    pytest.skip(str(missing), allow_module_level=True)

STEP = 0.001
SMALL = (
    "container: {size: [0.4, 0.4, 0.4]}\n"
    "fluid:\n"
    "- block: {min: [-0.12, -0.12, 0.2], max: [0, 0, 0.32]}\n"
    "- block: {min: [0.05, 0.05, 0.2], max: [0.14, 0.14, 0.32], velocity: [0.1, 0, 0.5]}\n"
)
ONE_BLOCK = "container: {size: [0.4, 0.4, 0.4]}\nfluid: [{block: {min: [-0.1, -0.1, 0.2], max: [0.05, 0.05, 0.35]}}]\n"


def read_scene(text: str) -> Scene:
    return Scene.from_yaml(text, "test")


def run(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    surface = scene.build_surface()
    frames = list(solver.simulate(scene, surface, scene.initial_particles(surface)))
    return tuple(np.stack(values) for values in zip(*frames, strict=True))


@pytest.fixture(autouse=True)
def scratch(tmp_path, monkeypatch):
    """The folder of the test's jobs, which must be empty afterwards."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    assert list(folder.iterdir()) == []


def test_free_fall_is_semi_implicit_euler():
    scene = read_scene(SMALL + "frames: 8")
    start = scene.initial_particles(None)
    positions, velocities = run(scene)
    assert positions.dtype == velocities.dtype == np.float32
    assert positions.shape == velocities.shape == (8, 39, 3)
    np.testing.assert_array_equal(positions[0], start.positions)
    np.testing.assert_array_equal(velocities[0], start.velocities)
    x, v = start.positions.astype(np.float64), start.velocities.astype(np.float64)
    for frame in range(1, 8):
        for _ in range(round(FRAME_TIME / STEP)):
            v = v + STEP * np.array(scene.gravity)
            x = x + STEP * v
        np.testing.assert_allclose(positions[frame], x, atol=1e-6)
        np.testing.assert_allclose(velocities[frame], v, atol=1e-5)


def test_particles_keep_their_order_when_the_solver_sorts_them():
    # It sorts every 500 substeps, which are 100 frames.
    scene = read_scene(
        "container: {size: [0.4, 0.4, 0.4]}\ngravity: [0, 0, 0]\nframes: 210\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.1], max: [0.05, 0.05, 0.25], velocity: [0.03, 0, 0]}}]"
    )
    positions, _ = run(scene)
    moved = 0.03 * FRAME_TIME * np.arange(210)[:, None, None] * np.array([1, 0, 0])
    np.testing.assert_allclose(positions, scene.initial_particles(None).positions + moved, atol=1e-5)


def test_water_comes_to_rest_on_the_floor_inside_the_container():
    scene = read_scene(SMALL + "frames: 200")
    positions, velocities = run(scene)
    assert (np.abs(positions[..., :2]) < 0.2).all()
    assert (positions[..., 2] > 0).all()
    assert positions[-1, :, 2].max() < 0.1
    assert np.linalg.norm(velocities[-1], axis=-1).mean() < 0.5


def test_a_run_on_one_thread_repeats_bit_for_bit():
    scene = read_scene(SMALL + "frames: 60")
    first, second = run(scene), run(scene)
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])


def test_water_stays_out_of_the_solid():
    scene = read_scene(ONE_BLOCK + "surface: {sphere: {radius: 0.08}, at: [0, 0, 0.06]}\nframes: 40")
    positions, _ = run(scene)
    from_center = np.linalg.norm(positions - [0, 0, 0.06], axis=-1)
    assert from_center.min() > 0.08
    assert np.abs(positions[-1] - positions[0]).max() > 0.05


def test_one_frame_is_the_start():
    scene = read_scene(SMALL + "frames: 1")
    positions, _ = run(scene)
    np.testing.assert_array_equal(positions, scene.initial_particles(None).positions[None])


@pytest.mark.parametrize("size", [(0.15, 0.12, 0.09), (0.18, 0.09, 0.24)])
def test_a_block_of_whole_spacings_has_the_particles_of_the_solvers_own_block(tmp_path, log, size):
    low = (-0.1, -0.1, 0.1)
    block = Block(min=low, max=tuple(a + b for a, b in zip(low, size, strict=True)))
    ours = block.positions()
    path = job_files.write_job(tmp_path, (0, 0, 0), [ours], [(0, 0, 0)], [])
    description = json.loads(path.read_text())
    del description["FluidModels"]
    description["FluidBlocks"] = [{"id": "Fluid", "denseMode": 0, "start": block.min, "end": block.max}]
    path.write_text(json.dumps(description))
    ((theirs, _),) = solver.run_child(path, 1, len(ours), 1, log)

    def in_order(positions: np.ndarray) -> np.ndarray:
        return positions[np.lexsort(np.round(positions, 4).T)]

    np.testing.assert_allclose(in_order(theirs), in_order(ours), atol=1e-6)


@pytest.fixture
def log():
    with tempfile.TemporaryFile() as file:
        yield file


@pytest.fixture
def children(monkeypatch):
    """The child processes that the solver starts."""
    started = []

    class Recorded(subprocess.Popen):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Recorded)
    return started


def test_a_killed_solver_is_an_error_of_one_line(children):
    scene = read_scene(SMALL + "frames: 5000")
    frames = solver.simulate(scene, None, scene.initial_particles(None))
    next(frames)
    os.kill(children[0].pid, signal.SIGKILL)
    with pytest.raises(solver.SolverError, match="ended with signal 9 before frame") as error:
        for _ in frames:
            pass
    assert "\n" not in str(error.value)


def test_frames_before_a_crash_are_kept(children, tmp_path):
    scene = read_scene(SMALL + "frames: 5000")
    start = scene.initial_particles(None)
    with (
        pytest.raises(solver.SolverError),
        TrajectoryWriter(tmp_path / "a.h5", scene, Provenance(solver.NAME), len(start.positions)) as out,
    ):
        for number, frame in enumerate(solver.simulate(scene, None, start)):
            out.append(*frame)
            if number == 10:
                os.kill(children[0].pid, signal.SIGKILL)
    with Trajectory(tmp_path / "a.h5") as trajectory:
        assert len(trajectory) >= 11


def test_an_unreadable_scene_is_an_error_of_one_line(tmp_path, log):
    path = tmp_path / "broken.json"
    path.write_text("{")
    with pytest.raises(solver.SolverError, match="before frame 0") as error:
        list(solver.run_child(path, 3, 10, 1, log))
    assert "\n" not in str(error.value)


def test_a_wrong_number_of_particles_is_an_error(tmp_path, log):
    start = read_scene(ONE_BLOCK).initial_particles(None)
    path = job_files.write_job(tmp_path, (0, 0, 0), start.block_positions, start.block_velocities, [])
    with pytest.raises(solver.SolverError, match="started with 64 particles instead of 65"):
        list(solver.run_child(path, 1, 65, 1, log))


def test_closing_the_generator_ends_the_child_and_cleans_up(children):
    scene = read_scene(SMALL + "frames: 5000")
    frames = solver.simulate(scene, None, scene.initial_particles(None))
    next(frames)
    assert children[0].poll() is None
    frames.close()
    assert children[0].returncode == -signal.SIGKILL


def test_an_interrupt_ends_the_child_and_cleans_up(children):
    scene = read_scene(SMALL + "frames: 5000")
    frames = solver.simulate(scene, None, scene.initial_particles(None))
    next(frames)
    with pytest.raises(KeyboardInterrupt):
        frames.throw(KeyboardInterrupt())
    assert children[0].returncode is not None


def test_no_files_remain_while_the_solver_runs(scratch):
    scene = read_scene(SMALL + "frames: 5000")
    frames = solver.simulate(scene, None, scene.initial_particles(None))
    next(frames)
    assert len(list(scratch.iterdir())) == 1
    next(frames), next(frames)
    assert list(scratch.iterdir()) == []  # so that a killed run leaves no files
    frames.close()


def test_a_missing_solver_is_reported_by_the_child(tmp_path, monkeypatch):
    (tmp_path / "pysplishsplash.py").write_text("raise ModuleNotFoundError('No module named pysplishsplash')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    scene = read_scene(SMALL)
    with pytest.raises(InputError, match=r"^the reference solver is not installed: pip install"):
        next(solver.simulate(scene, None, scene.initial_particles(None)))
    with pytest.raises(InputError, match=r"^the reference solver is not installed: pip install"):
        solver.check_installed()


def test_an_installed_solver_is_no_error():
    solver.check_installed()


def test_similar_scenes_give_the_same_frames_after_scaling():
    runs = []
    for factor in (1.0, 1 / 3):
        scene = similar_scene(factor, frames=6)
        surface = scene.build_surface()
        runs.append(list(solver.simulate(scene, surface, scene.initial_particles(surface))))
    for (positions, velocities), (small_positions, small_velocities) in zip(*runs, strict=True):
        np.testing.assert_allclose(3 * small_positions, positions, atol=2e-4)
        assert np.abs(np.sqrt(3) * small_velocities - velocities).mean() < 2e-3


def test_frames_come_at_the_rate_of_the_scene():
    block = Block((-0.1, -0.1, 1.0), (0.1, 0.1, 1.2), velocity=(1.0, 0.0, 0.0))
    scene = Scene(fluid=[block], fps=60, frames=4)
    frames = list(solver.simulate(scene, None, scene.initial_particles(None)))
    assert len(frames) == 4
    for number, (positions, velocities) in enumerate(frames):
        np.testing.assert_allclose(positions[:, 0] - frames[0][0][:, 0], number / 60, atol=1e-4)
        np.testing.assert_allclose(velocities[:, 2], -9.81 * number / 60, atol=1e-2)


def test_every_particle_starts_at_its_own_velocity():
    scene = Scene(fluid=[Block((-0.1, -0.1, 1.0), (0.1, 0.1, 1.2))], gravity=(0.0, 0.0, 0.0), frames=2)
    start = scene.initial_particles(None)
    away = 2 * (start.positions - start.positions.mean(axis=0))
    frames = list(solver.simulate(scene, None, replace(start, block_velocities=[away])))
    np.testing.assert_allclose(frames[0][1], away, atol=1e-6)
    np.testing.assert_allclose(frames[1][0], start.positions + 0.005 * away, atol=1e-4)


def test_a_solid_that_moves_is_where_the_scene_says_and_pushes_the_water():
    scene = read_scene(
        "container: {size: [0.6, 0.6, 0.6]}\ngravity: [0, 0, 0]\nframes: 41\n"
        "surfaces:\n  bar:\n    box: {size: [0.4, 0.05, 0.1]}\n    at: [0, 0, 0.3]\n"
        "    rotate: {axis: [0, 1, 0], degrees: 20}\n    motion: {spin: {axis: [0, 0, 1], rate: 8}}\n"
        "fluid: [{block: {min: [0.05, 0.08, 0.2], max: [0.2, 0.2, 0.4]}}]"
    )
    (bar,) = build_solids(scene).moving
    positions, velocities = run(scene)
    distance = [
        float(bar.surface.distance(torch.from_numpy(bar.pose(k * FRAME_TIME).to_own(x).astype(np.float32))).min())
        for k, x in enumerate(positions)
    ]
    assert min(distance) > 0.01
    x, v = positions[-1], velocities[-1]
    assert (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]).mean() > 0.05  # it turns with the bar


def test_the_water_of_a_container_that_moves_moves_with_it():
    scene = read_scene(
        "container: {size: [0.3, 0.3, 0.4], motion: {keyframes: [{time: 0}, {time: 0.3, position: [0.2, 0, 0]}]}}\n"
        "frames: 61\nfluid: [{block: {min: [-0.13, -0.13, 0.02], max: [0.13, 0.13, 0.14]}}]"
    )
    positions, _ = run(scene)
    shift = build_solids(scene).container(60 * FRAME_TIME).position
    assert (np.abs(positions[-1][:, :2] - shift[:2]) < 0.15).all()
    assert positions[-1][:, 0].mean() == pytest.approx(0.2, abs=0.05)


def test_a_dam_that_fills_its_channel_falls_quietly_as_our_solver_begins_it():
    block = "fluid: [{block: {min: [-0.3, -0.12, 0], max: [0, 0.12, 0.3]}}]"
    scene = Scene.from_yaml(f"container: {{size: [0.6, 0.24, 0.6]}}\n{block}\nframes: 3", "test")
    with pytest.warns(MovedApartWarning):
        apart = Simulation(scene, device="cpu").particles
    speeds = [
        np.linalg.norm(list(solver.simulate(scene, None, particles))[1][1], axis=1).max()
        for particles in (scene.initial_particles(None), apart)
    ]
    assert speeds[0] > 5
    assert speeds[1] < 1
