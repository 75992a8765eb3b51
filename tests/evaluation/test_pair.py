import json

import h5py
import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.evaluation.pair import evaluate_pair
from surfsup.evaluation.report import write_json
from surfsup.evaluation.scores import ALL
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Fluid
from tests.evaluation.scenes import FRAMES, SCENE, free_fall, write


@pytest.fixture
def files(tmp_path):
    """A fall moved by a millimeter, and the fall itself."""
    positions, velocities = free_fall()
    moved = positions + np.float32([0.001, 0, 0])
    return write(tmp_path / "a/one.h5", moved, velocities), write(tmp_path / "b/reference.h5", positions, velocities)


def test_one_trajectory_is_evaluated_against_another(files, tmp_path):
    pair = evaluate_pair(*files)
    assert pair.evaluation.scores[ALL]["chamfer"] == pytest.approx(0.002, rel=1e-3)
    assert f"no floor beside reference.h5 (make it with 'surfsup floor {files[1].parent}')" in pair.text()
    write_json(tmp_path / "pair.json", pair.report())
    report = json.loads((tmp_path / "pair.json").read_text())
    assert report["windows"]["all"]["chamfer"]["prediction"] == pair.evaluation.scores[ALL]["chamfer"]
    assert len(report["curves"]["chamfer"]["prediction"]) == FRAMES
    assert (report["prediction"], report["reference"]) == tuple(map(str, files))


def test_a_fall_that_ends_above_the_solid_says_that_its_zeros_there_mean_nothing(files):
    pair = evaluate_pair(*files)
    assert pair.evaluation.scores[ALL]["surface"] == 0 and not pair.report()["reached_solid"]
    assert "no particle came near a solid: Chamfer Surface and Surface Penetration are 0 there" in pair.text()
    near = evaluate_pair(*files, threshold=0.4)  # the water is 0.4 m above the ball at first
    assert near.report()["reached_solid"] and "no particle came near" not in near.text()


def test_folders_of_simulations_stand_for_their_trajectories(files, tmp_path):
    for folder, file in zip("ab", files, strict=True):
        file.rename(tmp_path / folder / "trajectory.h5")
    pair = evaluate_pair(tmp_path / "a", str(tmp_path / "b"))
    assert (pair.prediction, pair.reference) == tuple(tmp_path / folder / "trajectory.h5" for folder in "ab")


def test_the_reference_s_floor_is_shown(files):
    prediction, reference = files
    write(reference.parent / "floor/reference-1.h5", *free_fall())
    write(reference.parent / "floor/reference-2.h5", *free_fall(3))
    pair = evaluate_pair(prediction, reference)
    assert len(pair.evaluation.floor_comparisons) == 1
    assert "no floor" not in pair.text()
    assert f"skipped {reference.parent / 'floor/reference-2.h5'}: was cut off" in pair.text()
    assert pair.text().splitlines()[4].split() == ["value", "floor", "ratio"] * 4


def test_trajectories_of_different_lengths_are_compared_over_common_frames_with_a_remark(files):
    prediction, reference = files
    write(reference, *free_fall(7))
    pair = evaluate_pair(prediction, reference)
    assert len(pair.evaluation.comparison) == 7
    assert "20 frames and 7: the first 7, which both have, are compared" in pair.text()


def test_different_particle_counts_give_a_remark(files):
    prediction, reference = files
    positions, velocities = free_fall()
    write(prediction, positions[:, 5:], velocities[:, 5:])
    pair = evaluate_pair(prediction, reference)
    count = positions.shape[1]
    assert f"{count - 5} particles and {count}" in pair.text()
    # The reference's five extra particles are at least a spacing from their neighbors.
    assert pair.evaluation.scores[ALL]["chamfer"] >= 5 * 0.03 / count * (1 - 1e-3)


def test_different_scenes_are_rejected(files):
    prediction, reference = files
    write(prediction, *free_fall(), SCENE.model_copy(update={"surface": None}))
    with pytest.raises(InputError, match="are of different scenes: their surfaces differ"):
        evaluate_pair(prediction, reference)


def test_a_trajectory_without_frames_is_rejected(files):
    prediction, reference = files
    write(prediction, *(values[:0] for values in free_fall()))
    with pytest.raises(InputError, match=r"one\.h5: has no frames"):
        evaluate_pair(prediction, reference)


def test_a_report_that_cannot_be_written_is_an_input_error(files, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_json(tmp_path, evaluate_pair(*files).report())


@pytest.mark.parametrize("number", [0, 1], ids=["prediction", "reference"])
def test_a_trajectory_with_another_frame_time_is_rejected_by_name(files, number):
    with h5py.File(files[number], "r+") as file:
        file.attrs["frame_time"] = 0.01
    with pytest.raises(InputError, match=rf"one.h5: has a frame every {0.005 * (2 - number):g} s .* with the same fps"):
        evaluate_pair(*files)


def test_trajectories_of_small_particles_have_metrics_of_their_own_size(tmp_path):
    """A fall of a fifth of the size has a fifth of the distances, and the same density."""
    positions, velocities = free_fall()
    scale = 0.2
    container = SCENE.container.model_copy(update={"size": tuple(scale * side for side in SCENE.container.size)})
    block = SCENE.fluid[0].block
    small_block = block.model_copy(
        update={"min": tuple(scale * low for low in block.min), "max": tuple(scale * high for high in block.max)}
    )
    changes = {"container": container, "fluid": [Fluid(block=small_block)], "particle_radius": 0.003}
    small = SCENE.model_copy(update={**changes, "surface": None})
    pairs = []
    for scene, s in ((SCENE.model_copy(update={"surface": None}), 1.0), (small, scale)):
        paths = [tmp_path / f"{name}-{s}.h5" for name in ("one", "two")]
        for path, shift in zip(paths, (0.001, 0.0), strict=True):
            with TrajectoryWriter(path, scene, Provenance("a test"), positions.shape[1]) as writer:
                for frame in range(FRAMES):
                    writer.append(s * (positions[frame] + np.float32([shift, 0, 0])), s**0.5 * velocities[frame])
        pairs.append(evaluate_pair(*paths))
    large, little = (pair.evaluation.scores[ALL] for pair in pairs)
    assert little["chamfer"] == pytest.approx(scale * large["chamfer"], rel=1e-2)
    assert pairs[1].threshold == pytest.approx(scale * pairs[0].threshold)
    for one, other in zip(
        pairs[1].evaluation.comparison.reference.density[:1],
        pairs[0].evaluation.comparison.reference.density[:1],
        strict=True,
    ):
        assert one == pytest.approx(other, rel=1e-4)
    with pytest.raises(InputError, match="simulate both with the same fps and particle_radius"):
        evaluate_pair(tmp_path / "one-1.0.h5", tmp_path / "two-0.2.h5")
