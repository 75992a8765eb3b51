import numpy as np
import pytest
import torch

from surfsup.datasets.windows import Windows, symmetry, window
from surfsup.errors import InputError
from surfsup.model.state import Surroundings
from surfsup.scene import Scene
from surfsup.trajectory import VELOCITY_STEP, Provenance, TrajectoryWriter

# Not square, so that a turn must turn the container too; gravity aslant, so that it must turn as well.
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
    # The frame's number is written into it, so that a window says which frames it holds.
    positions[:, 0, 2] = np.arange(count)
    return positions, random.normal(size=positions.shape).astype(np.float32)


def write(path, count: int) -> tuple[np.ndarray, np.ndarray]:
    positions, velocities = frames(count)
    with TrajectoryWriter(path, SCENE, Provenance("test"), positions.shape[1]) as writer:
        for frame in zip(positions, velocities, strict=True):
            writer.append(*frame)
    return positions, velocities


def test_a_window_is_a_state_with_its_past_and_the_frames_after_it():
    positions, velocities = (torch.from_numpy(values) for values in frames(6))
    around = Surroundings.of(SCENE, SCENE.build_surface())
    seen = window(positions, velocities, around)
    assert torch.equal(seen.state.positions, positions[1])
    assert torch.equal(seen.state.velocities, velocities[1])
    assert torch.equal(seen.state.displacement, positions[1] - positions[0])
    assert torch.equal(seen.state.velocity_change, velocities[1] - velocities[0])
    assert torch.equal(seen.positions, positions[2:])
    assert torch.equal(seen.velocities, velocities[2:])


@pytest.mark.parametrize("count", [4, 10, 500])
def test_drawn_windows_are_the_files_frames_in_a_row(tmp_path, count):
    positions, velocities = write(tmp_path / "a.h5", count)
    windows, random = Windows(tmp_path), np.random.default_rng(1)
    firsts = set()
    for _ in range(60):
        drawn = windows.draw(random, frames=2)
        first = round(float(drawn.state.positions[0, 2]))
        firsts.add(first)
        assert 1 <= first <= count - 3
        assert [round(float(frame[0, 2])) for frame in drawn.positions] == [first + 1, first + 2]
        # Whatever the symmetry, it keeps heights and lengths.
        np.testing.assert_array_equal(drawn.positions[..., 2], positions[first + 1 : first + 3, :, 2])
        np.testing.assert_allclose(
            drawn.velocities.norm(dim=-1),
            np.linalg.norm(velocities[first + 1 : first + 3], axis=-1),
            rtol=1e-5,
            atol=2 * VELOCITY_STEP,
        )
        step = positions[first, :, 2] - positions[first - 1, :, 2]
        np.testing.assert_allclose(drawn.state.displacement[:, 2], step, atol=1e-6)
    if count <= 10:
        assert firsts == set(range(1, count - 2)), "every window there is can be drawn, the last one too"
    else:
        assert max(firsts) > 320 > min(firsts)


def test_the_same_generator_draws_the_same_window(tmp_path):
    write(tmp_path / "a.h5", 20)
    windows = Windows(tmp_path)
    first, second = (windows.draw(np.random.default_rng(4), 3) for _ in range(2))
    assert torch.equal(first.positions, second.positions)
    assert torch.equal(first.state.velocities, second.state.velocities)


def test_a_trajectory_too_short_is_named(tmp_path):
    write(tmp_path / "short.h5", 4)
    with pytest.raises(InputError, match=r"short\.h5: has 4 frames, training needs at least 5"):
        Windows(tmp_path).draw(np.random.default_rng(0), frames=3)


def test_a_folder_without_trajectories_is_refused(tmp_path):
    with pytest.raises(InputError, match="has no trajectories"):
        Windows(tmp_path)


def test_symmetries_are_the_eight_of_a_square():
    random = np.random.default_rng(0)
    matrices = torch.stack([symmetry(random) for _ in range(200)])
    distinct = torch.unique(matrices, dim=0)
    assert len(distinct) == 8
    for matrix in distinct:
        torch.testing.assert_close(matrix @ matrix.T, torch.eye(3))
        assert torch.equal(matrix[2], torch.tensor([0.0, 0.0, 1.0]))


@pytest.mark.parametrize("seed", range(12))
def test_a_window_and_its_image_are_the_same_scene(seed):
    matrix = symmetry(np.random.default_rng(seed))
    positions, velocities = (torch.from_numpy(values) for values in frames(4))
    original = window(positions, velocities, Surroundings.of(SCENE, SCENE.build_surface()))
    image = original.seen_through(matrix)

    distance, normal = original.around.distance_and_normal(original.state.positions)
    seen_distance, seen_normal = image.around.distance_and_normal(image.state.positions)
    torch.testing.assert_close(seen_distance, distance, atol=1e-5, rtol=0)
    torch.testing.assert_close(seen_normal, normal @ matrix.T, atol=1e-4, rtol=0)
    torch.testing.assert_close(image.around.gravity, matrix @ original.around.gravity)

    for name, value in vars(original.state).items():
        torch.testing.assert_close(getattr(image.state, name), value @ matrix.T)
    # Distances to the walls are the same, whichever walls they now are.
    to_walls = [
        torch.cat([points - around.lower, around.upper - points], dim=-1).sort(dim=-1).values
        for points, around in (
            (original.state.positions, original.around),
            (image.state.positions, image.around),
        )
    ]
    torch.testing.assert_close(*to_walls)


def test_an_image_of_an_image_is_the_original():
    matrix = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    positions, velocities = (torch.from_numpy(values) for values in frames(4))
    original = window(positions, velocities, Surroundings.of(SCENE, None))
    back = original.seen_through(matrix).seen_through(matrix.T)
    torch.testing.assert_close(back.positions, original.positions)
    assert torch.equal(back.around.lower, original.around.lower)
    assert back.around.surface is None
