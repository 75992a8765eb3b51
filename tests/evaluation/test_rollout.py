import numpy as np
import pytest

from surfsup.evaluation.evaluate import evaluate_trajectory
from surfsup.evaluation.rollout import write_rollout
from surfsup.evaluation.scores import ALL
from surfsup.evaluation.validation_scores import score_rollout
from surfsup.io.trajectory import Trajectory
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.simulation import Simulation
from surfsup.sph.solver import DfsphSolver
from tests.evaluation.scenes import FRAMES, Replay, free_fall, write


def test_a_rollout_file_has_the_reference_s_start_scene_and_length(reference, tmp_path):
    calls = []
    share = write_rollout(tmp_path / "out.h5", DfsphSolver(), "ballistic", reference, FRAMES, progress=calls.append)
    with Trajectory(tmp_path / "out.h5") as rollout:
        np.testing.assert_array_equal(rollout.positions[0], reference.positions[0])
        np.testing.assert_allclose(rollout.positions[:], reference.positions[:], atol=3e-5)
        assert (rollout.provenance.simulator, rollout.scene.frames, len(rollout)) == ("ballistic", FRAMES, FRAMES)
    assert calls == list(range(1, FRAMES + 1))
    assert share == 0


def test_the_collided_share_is_a_mean_over_frames(reference, tmp_path):
    replay = Replay(reference.positions[:], reference.velocities[:], collided=True)
    assert write_rollout(tmp_path / "out.h5", replay, "replay", reference, FRAMES) == 1


@pytest.mark.parametrize("spoiled", [0, 1], ids=["positions", "velocities"])
def test_a_diverged_rollout_is_as_long_as_the_reference_and_its_particles_are_lost(reference, tmp_path, spoiled):
    frames = list(free_fall())
    frames[spoiled][8, 3] = np.nan
    write_rollout(tmp_path / "out.h5", Replay(*frames), "replay", reference, FRAMES)
    with Trajectory(tmp_path / "out.h5") as rollout:
        assert len(rollout) == FRAMES
        assert np.isnan(rollout.positions[8:]).all()
    evaluation = evaluate_trajectory(tmp_path / "out.h5", tmp_path / "00000.h5")
    assert evaluation.scores[ALL]["chamfer"] is None
    assert evaluation.scores[ALL]["lost"] == (FRAMES - 8) * reference.positions.shape[1]


def test_a_diverged_rollout_has_the_poses_of_all_frames(tmp_path):
    scene = Scene.from_yaml(
        "surfaces: {ball: {sphere: {radius: 0.1}, motion: {between: linear, keyframes: ["
        "{time: 0}, {time: 0.1, position: [0.1, 0, 0]}]}}}\n"
        f"fluid: [{{block: {{min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}}}]\nframes: {FRAMES}",
        "test",
    )
    frames = free_fall(scene=scene)
    write(tmp_path / "reference.h5", *frames, scene)
    frames[0][8, 3] = np.nan
    with Trajectory(tmp_path / "reference.h5") as reference:
        write_rollout(tmp_path / "out.h5", Replay(*frames), "replay", reference, FRAMES)
    with Trajectory(tmp_path / "out.h5") as rollout:
        np.testing.assert_allclose(rollout.poses["ball"][:, 0], 0.005 * np.arange(FRAMES), atol=1e-9)


@pytest.mark.skipif(not is_built(), reason="moving solids run in the C++ code")
def test_a_reference_that_continues_another_has_its_solids_where_they_were(tmp_path):
    scene = Scene.from_yaml(
        "surfaces: {bar: {box: {size: [0.4, 0.1, 0.1]}, at: [0, 0, 0.2], motion: {spin: {rate: 3}}}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.3], max: [0.1, 0.1, 0.5]}}]\nframes: 21",
        "test",
    )
    Simulation(scene).record(tmp_path / "first.h5")
    Simulation(scene.with_changes(restart=tmp_path / "first.h5", frames=6)).record(tmp_path / "second.h5")
    with Trajectory(tmp_path / "second.h5") as reference:
        write_rollout(tmp_path / "out.h5", DfsphSolver(), "dfsph", reference, 6)
        with Trajectory(tmp_path / "out.h5") as rollout:
            assert rollout.start_time == pytest.approx(0.1)
            np.testing.assert_allclose(rollout.poses["bar"], reference.poses["bar"], atol=1e-12)
            np.testing.assert_allclose(rollout.positions[:], reference.positions[:], atol=1e-4)
        assert score_rollout(DfsphSolver(), reference, 6).chamfer < 1e-4


@pytest.mark.skipif(not is_built(), reason="too slow without the C++ code")
def test_a_rollout_of_fine_particles_is_that_of_a_larger_scene_scaled_down(tmp_path):
    def scene(s):
        return Scene.from_yaml(
            f"particle_radius: {0.015 * s}\ncontainer: {{size: [{s}, {s}, {s}]}}\n"
            f"surfaces: {{bar: {{box: {{size: [{0.4 * s}, {0.1 * s}, {0.1 * s}]}}, at: [0, 0, {0.2 * s}],"
            f" motion: {{spin: {{rate: {3 / s**0.5}}}}}}}}}\n"
            f"fluid: [{{block: {{min: [{-0.1 * s}, {-0.1 * s}, {0.3 * s}],"
            f" max: [{0.1 * s}, {0.1 * s}, {0.5 * s}]}}}}]\nframes: 41",
            "test",
        )

    results = []
    for s in (1.0, 0.25):
        Simulation(scene(s)).record(tmp_path / f"{s}.h5")
        with Trajectory(tmp_path / f"{s}.h5") as reference:
            write_rollout(tmp_path / "out.h5", DfsphSolver(), "dfsph", reference, 41)
            with Trajectory(tmp_path / "out.h5") as rollout:
                np.testing.assert_array_equal(rollout.positions[:], reference.positions[:])
                assert rollout.frame_time == reference.frame_time
                results.append((rollout.positions[:] / s, rollout.poses["bar"][:, 3:]))
    np.testing.assert_allclose(results[0][0], results[1][0], atol=1e-6)
    np.testing.assert_allclose(results[0][1], results[1][1], atol=1e-9)
