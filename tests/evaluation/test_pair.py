import json

import h5py
import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.evaluation.pair import judge_pair
from surfsup.evaluation.report import write_json
from surfsup.evaluation.scores import ALL
from tests.evaluation.scenes import FRAMES, SCENE, free_fall, write


@pytest.fixture
def files(tmp_path):
    """A fall, and the same fall a millimeter aside."""
    positions, velocities = free_fall()
    aside = positions + np.float32([0.001, 0, 0])
    return write(tmp_path / "a/one.h5", aside, velocities), write(tmp_path / "b/truth.h5", positions, velocities)


def test_one_trajectory_is_judged_by_another(files, tmp_path):
    pair = judge_pair(*files)
    assert pair.judgment.scores[ALL]["chamfer"] == pytest.approx(0.002, rel=1e-3)
    assert f"no floor beside truth.h5 (make it with 'surfsup floor {files[1].parent}')" in pair.text()
    write_json(tmp_path / "pair.json", pair.report())
    report = json.loads((tmp_path / "pair.json").read_text())
    assert report["windows"]["all"]["chamfer"]["model"] == pair.judgment.scores[ALL]["chamfer"]
    assert len(report["curves"]["chamfer"]["model"]) == FRAMES
    assert (report["judged"], report["truth"]) == tuple(map(str, files))


def test_the_truths_floor_is_shown_too(files):
    one, truth = files
    write(truth.parent / "floor/truth-1.h5", *free_fall())
    write(truth.parent / "floor/truth-2.h5", *free_fall(3))
    pair = judge_pair(one, truth)
    assert len(pair.judgment.floors) == 1
    assert "no floor" not in pair.text()
    assert f"skipped {truth.parent / 'floor/truth-2.h5'}: was cut off" in pair.text()
    assert pair.text().splitlines()[4].split() == ["judged", "floor", "ratio"] * 4


def test_the_common_frames_of_different_lengths_are_compared_and_that_is_said(files):
    one, truth = files
    write(truth, *free_fall(7))
    pair = judge_pair(one, truth)
    assert len(pair.judgment.own) == 7
    assert "20 frames and 7: the first 7, which both have, are compared" in pair.text()


def test_particle_counts_may_differ_and_that_is_said(files):
    one, truth = files
    positions, velocities = free_fall()
    write(one, positions[:, 5:], velocities[:, 5:])
    pair = judge_pair(one, truth)
    count = positions.shape[1]
    assert f"{count - 5} particles and {count}" in pair.text()
    # The truth's five extra ones are a spacing from their neighbors, or more.
    assert pair.judgment.scores[ALL]["chamfer"] >= 5 * 0.03 / count * (1 - 1e-3)


def test_different_scenes_are_one_clear_line(files):
    one, truth = files
    write(one, *free_fall(), SCENE.model_copy(update={"surface": None}))
    with pytest.raises(InputError, match="are of different scenes: their surfaces differ"):
        judge_pair(one, truth)


def test_a_trajectory_without_frames_cannot_be_compared(files):
    one, truth = files
    write(one, *(values[:0] for values in free_fall()))
    with pytest.raises(InputError, match=r"one\.h5: has no frames"):
        judge_pair(one, truth)


def test_numbers_that_cannot_be_written_are_one_line(files, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_json(tmp_path, judge_pair(*files).report())


@pytest.mark.parametrize("number", [0, 1], ids=["judged", "truth"])
def test_a_trajectory_of_another_frame_time_is_refused_by_name(files, number):
    with h5py.File(files[number], "r+") as file:
        file.attrs["frame_time"] = 0.01
    with pytest.raises(InputError, match=rf"{files[number].name}: has a frame every 0\.01 s .* are for 0\.005 s"):
        judge_pair(*files)
