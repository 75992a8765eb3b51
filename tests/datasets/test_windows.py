from dataclasses import replace

import h5py
import numpy as np
import pytest
import torch

from surfsup.datasets.windows import Window, Windows, random_symmetry
from surfsup.errors import InputError
from surfsup.io.trajectory_format import VELOCITY_STEP, Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.learned.registry import LEARNED_SIMULATORS
from surfsup.scene import Scene
from surfsup.sph.environment import Environment

# The container is not square and gravity is tilted, so that a rotation must rotate both.
SCENE = Scene.from_yaml(
    "container: {size: [1.0, 1.4, 2.0]}\ngravity: [1, 2, -9]\n"
    "surface:\n"
    "  cone: {height: 0.4, bottom_radius: 0.3}\n"
    "  rotate: {axis: [1, 0, 0], degrees: 30}\n"
    "  at: [0.1, 0.2, 0.3]\n"
    "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]",
    "test",
)


def frames(count: int, particles: int = 30) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    positions = random.uniform([-0.5, -0.7, 0], [0.5, 0.7, 2], size=(count, particles, 3)).astype(np.float32)
    # The height of particle 0 is the frame's number, so that a window shows its frames.
    positions[:, 0, 2] = np.arange(count)
    return positions, random.normal(size=positions.shape).astype(np.float32)


def write(path, count: int) -> tuple[np.ndarray, np.ndarray]:
    positions, velocities = frames(count)
    with TrajectoryWriter(path, SCENE, Provenance("test"), positions.shape[1]) as writer:
        for frame in zip(positions, velocities, strict=True):
            writer.append(*frame)
    return positions, velocities


def window(count: int, history_length: int = 1) -> Window:
    positions, velocities = (torch.from_numpy(values) for values in frames(count))
    return Window(positions, velocities, history_length, Environment.of(SCENE, SCENE.build_surface()), SCENE, "a")


def test_a_window_has_a_history_a_present_frame_and_frames_after_it():
    one = window(6, history_length=2)
    assert [len(values) for values in one.history] == [3, 3]
    assert torch.equal(one.history[0], one.positions[:3])
    assert torch.equal(one.history[1], one.velocities[:3])
    assert one.frames_after == 3
    for number in range(4):
        assert torch.equal(one.frame(number)[0], one.positions[2 + number])
        assert torch.equal(one.frame(number)[1], one.velocities[2 + number])


@pytest.mark.parametrize(("count", "history_length"), [(4, 1), (10, 1), (10, 4), (500, 1), (500, 8)])
def test_sampled_windows_are_consecutive_frames_of_the_file(tmp_path, count, history_length):
    positions, velocities = write(tmp_path / "a.h5", count)
    windows, random = Windows(tmp_path), np.random.default_rng(1)
    presents = set()
    for _ in range(60):
        drawn = windows.sample(random, history_length, frames=2)
        now = round(float(drawn.frame(0)[0][0, 2]))
        presents.add(now)
        assert history_length <= now <= count - 3
        assert (drawn.history_length, drawn.frames_after) == (history_length, 2)
        assert (drawn.scene.surface.kind, drawn.name) == ("cone", str(tmp_path / "a.h5"))
        frames_of_file = slice(now - history_length, now + 3)
        # Each symmetry keeps heights and lengths.
        np.testing.assert_array_equal(drawn.positions[..., 2], positions[frames_of_file, :, 2])
        np.testing.assert_allclose(
            drawn.velocities.norm(dim=-1),
            np.linalg.norm(velocities[frames_of_file], axis=-1),
            rtol=1e-5,
            atol=2 * VELOCITY_STEP,
        )
    if count <= 10:
        assert presents == set(range(history_length, count - 2)), "every window can be sampled, including the last"
    else:
        assert max(presents) > 320 > min(presents)


@pytest.mark.parametrize("kind", ["corrected", "surfsup"])
def test_a_window_at_the_scene_start_has_the_history_of_a_rollout(tmp_path, kind):
    write(tmp_path / "a.h5", 12)
    model = LEARNED_SIMULATORS[kind](LEARNED_SIMULATORS[kind].architecture_type(width=4, layers=1))
    drawn = Windows(tmp_path).sample(np.random.default_rng(0), model.history_length, frames=3, scene_starts=1.0)
    assert drawn.at_scene_start
    assert (drawn.history_length, drawn.frames_after) == (model.history_length, 3)
    assert [float(drawn.frame(number)[0][0, 2]) for number in range(4)] == [0, 1, 2, 3]
    state, start = model.state_from_frames(*drawn.history), model.initial_state(*drawn.frame(0), drawn.environment)
    for ours, theirs in zip(vars(state).values(), vars(start).values(), strict=True):
        torch.testing.assert_close(ours, theirs, atol=1e-6, rtol=1e-5)


def test_the_requested_fraction_of_windows_is_at_the_scene_start(tmp_path):
    write(tmp_path / "a.h5", 12)
    windows, random = Windows(tmp_path), np.random.default_rng(3)
    assert not any(windows.sample(random, 1, 2).at_scene_start for _ in range(50))
    assert 60 < sum(windows.sample(random, 1, 2, scene_starts=0.4).at_scene_start for _ in range(200)) < 100


def test_trajectories_of_several_folders_have_equal_probability(tmp_path):
    for name, count in (("one", 2), ("two", 1)):
        (tmp_path / name).mkdir()
        for number in range(count):
            write(tmp_path / name / f"{number}.h5", 5)
    windows, random = Windows(tmp_path / "one", tmp_path / "two"), np.random.default_rng(2)
    drawn = [windows.sample(random, 1, 2).name for _ in range(90)]
    assert {drawn.count(str(path)) > 15 for path in windows.paths} == {True}
    assert len(windows) == 3


def test_the_same_seed_gives_the_same_window(tmp_path):
    write(tmp_path / "a.h5", 20)
    windows = Windows(tmp_path)
    first, second = (windows.sample(np.random.default_rng(4), 1, 3) for _ in range(2))
    assert torch.equal(first.positions, second.positions)
    assert torch.equal(first.velocities, second.velocities)


def test_a_trajectory_that_is_too_short_is_named(tmp_path):
    write(tmp_path / "short.h5", 4)
    with pytest.raises(InputError, match=r"short\.h5: has 4 frames, training needs at least 5"):
        Windows(tmp_path).sample(np.random.default_rng(0), history_length=1, frames=3)
    with pytest.raises(InputError, match="training needs at least 7"):
        Windows(tmp_path).sample(np.random.default_rng(0), history_length=4, frames=2)


@pytest.mark.parametrize("unit", ["frame_time", "radius"])
def test_data_of_other_units_are_an_error(tmp_path, unit):
    write(tmp_path / "a.h5", 5)
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file.attrs[unit] = 0.01
    with pytest.raises(InputError, match=r"a\.h5: has .* 0\.01 .*; the simulators here are for 0\.005 s and 0\.015 m"):
        Windows(tmp_path)


def test_a_folder_without_trajectories_is_an_error(tmp_path):
    (tmp_path / "filled").mkdir()
    (tmp_path / "empty").mkdir()
    write(tmp_path / "filled" / "a.h5", 5)
    with pytest.raises(InputError, match="empty: has no trajectories"):
        Windows(tmp_path / "filled", tmp_path / "empty")


def test_there_are_eight_symmetries():
    random = np.random.default_rng(0)
    matrices = torch.stack([random_symmetry(random) for _ in range(200)])
    distinct = torch.unique(matrices, dim=0)
    assert len(distinct) == 8
    for matrix in distinct:
        torch.testing.assert_close(matrix @ matrix.T, torch.eye(3))
        assert torch.equal(matrix[2], torch.tensor([0.0, 0.0, 1.0]))


@pytest.mark.parametrize("seed", range(12))
def test_a_transformed_window_is_the_same_scene(seed):
    matrix = random_symmetry(np.random.default_rng(seed))
    original = window(4)
    image = original.transformed_by(matrix)

    now, image_now = original.frame(0)[0], image.frame(0)[0]
    distance, normal = original.environment.distance_and_normal(now)
    image_distance, image_normal = image.environment.distance_and_normal(image_now)
    torch.testing.assert_close(image_distance, distance, atol=1e-5, rtol=0)
    torch.testing.assert_close(image_normal, normal @ matrix.T, atol=1e-4, rtol=0)
    torch.testing.assert_close(image.environment.gravity, matrix @ original.environment.gravity)

    torch.testing.assert_close(image.positions, original.positions @ matrix.T)
    torch.testing.assert_close(image.velocities, original.velocities @ matrix.T)
    assert (image.history_length, image.scene, image.name) == (original.history_length, original.scene, original.name)
    # The sorted distances to the walls are the same.
    to_walls = [
        torch.cat([points - environment.lower, environment.upper - points], dim=-1).sort(dim=-1).values
        for points, environment in (
            (now, original.environment),
            (image_now, image.environment),
        )
    ]
    torch.testing.assert_close(*to_walls)


def test_the_inverse_transformation_restores_the_window():
    matrix = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    original = replace(window(4), environment=Environment.of(SCENE, None))
    back = original.transformed_by(matrix).transformed_by(matrix.T)
    torch.testing.assert_close(back.positions, original.positions)
    assert torch.equal(back.environment.lower, original.environment.lower)
    assert back.environment.surface is None
