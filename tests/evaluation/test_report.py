import json
import math
from dataclasses import replace

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.evaluation.evaluate import evaluate
from surfsup.evaluation.load_trajectories import data_sets, usable_truths
from surfsup.evaluation.report import Subject, evaluation_report, make_folder, plain, write_json
from surfsup.evaluation.scores import METRICS
from surfsup.evaluation.table import evaluation_text, judgment_text
from surfsup.learned.training_domain import TrainingDomain
from surfsup.learned.weights_file import Card
from tests.evaluation.scenes import FRAMES, SCENE, free_fall, silent, write

SUBJECT = Subject(Card("silent", "falls & <nothing else>"), True, 0.09)


@pytest.fixture
def evaluated(tmp_path):
    """Two data sets: one with a floor and a broken file, one without a floor."""
    positions, velocities = free_fall()
    write(tmp_path / "falls/00000.h5", positions, velocities)
    write(tmp_path / "falls/floor/00000-1.h5", positions + np.float32(0.001), velocities)
    (tmp_path / "falls/00001.h5").write_text("not HDF5")
    write(tmp_path / "drops/00000.h5", positions, velocities)
    sets = data_sets([tmp_path / "falls", tmp_path / "drops"])
    truths, skipped = usable_truths(sets)
    scenes = evaluate(silent(), "silent", truths, tmp_path / "report", "cpu")
    return sets, scenes, skipped


@pytest.fixture
def report(evaluated, tmp_path):
    """What the report's file gives back."""
    sets, scenes, skipped = evaluated
    write_json(tmp_path / "report.json", evaluation_report(SUBJECT, sets, scenes, skipped, tmp_path / "report"))
    return json.loads((tmp_path / "report.json").read_text())


def test_the_report_says_what_was_judged_and_what_every_number_means(report):
    assert report["model"] == {"name": "silent", "about": SUBJECT.card.about, "handle_collisions": True}
    assert [metric["key"] for metric in report["metrics"]] == [metric.key for metric in METRICS]
    assert all(metric["tells"] for metric in report["metrics"])
    assert report["frame_time"] == 0.005
    assert report["limits"] == {"scenes": None, "frames": None}
    assert report["near"] == 0.09


def test_what_was_skipped_is_named_and_counted_and_a_missing_floor_is_told(report, tmp_path):
    falls, drops = report["data"]
    assert (falls["name"], falls["files"], falls["scenes"], falls["floors"]) == ("falls", 2, 1, 1)
    assert [bad["file"] for bad in falls["skipped"]] == ["00001.h5"]
    assert "is not a trajectory" in falls["skipped"][0]["reason"]
    assert falls["floor_missing"] is None
    assert drops["floor_missing"] == f"make it with 'surfsup floor {tmp_path / 'drops'}'"
    assert drops["skipped"] == []


def test_every_scene_has_its_numbers_its_curves_and_its_trajectory(report, tmp_path):
    first = report["scenes"][0]
    assert (first["data"], first["scene"], first["surface"], first["frames"]) == ("falls", "00000", "sphere", FRAMES)
    assert (tmp_path / "report" / first["trajectory"]).is_file()
    chamfer = first["windows"]["all"]["chamfer"]
    assert chamfer["ratio"] == pytest.approx(chamfer["model"] / chamfer["floor"])
    assert chamfer["floor"] == pytest.approx(2 * 0.001 * math.sqrt(3), rel=1e-3)
    assert np.mean(first["curves"]["chamfer"]["model"]) == pytest.approx(chamfer["model"], rel=1e-4)
    assert [len(curve) for curve in first["curves"]["height"].values()] == [FRAMES] * 3
    assert report["scenes"][1]["curves"]["height"]["floor"] is None
    assert report["scenes"][1]["windows"]["all"]["chamfer"]["floor"] is None


def test_means_stand_by_data_set_and_surface(report):
    assert [(mean["data"], mean["surface"]) for mean in report["means"]] == [
        ("falls", "sphere"),
        ("falls", "all"),
        ("drops", "sphere"),
        ("drops", "all"),
    ]
    assert report["means"][1]["windows"]["all"]["chamfer"] == report["scenes"][0]["windows"]["all"]["chamfer"]


def test_json_has_no_values_that_json_does_not_know():
    assert plain(np.array([1.23456789, np.nan, np.inf, 0])) == [1.23457, None, None, 0]


def test_the_terminal_shows_model_floor_and_ratio_and_names_what_is_missing(evaluated, tmp_path):
    sets, scenes, skipped = evaluated
    text = evaluation_text(SUBJECT, scenes, sets, skipped)
    assert "falls: 1 scene, all with their floor; 'silent' with the guard\n" in text
    assert text.count("the guard moved 0.00 %") == 2
    assert f"drops: 1 scene, no floor (make it with 'surfsup floor {tmp_path / 'drops'}')" in text
    assert f"1 skipped:\n  {tmp_path / 'falls/00001.h5'}: is not a trajectory" in text
    lines = text.splitlines()
    assert lines[3].split() == ["model", "floor", "ratio"] * 4
    assert lines[5].split()[:5] == ["sphere", "(1)", "0.0000", "0.0035", "0.00"]
    assert "Surface Penetration 0 (floor 0)" in text
    assert max(map(len, lines[:20])) <= 120
    assert all(metric.tells in text for metric in METRICS)


def test_one_judgment_is_shown_over_time_with_and_without_a_floor(evaluated):
    _, scenes, _ = evaluated
    with_floor, without = (judgment_text(scene.judgment) for scene in scenes)
    assert "floor" in with_floor.splitlines()[1]
    assert [line.split()[0] for line in with_floor.splitlines()[2:4]] == ["0-100", "first"]
    assert without.splitlines()[1].split()[0] == "0-100"
    assert len(without.splitlines()[1].split()) == 5


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be made"):
        make_folder(tmp_path / "file" / "report")


def test_a_model_judged_without_its_guard_over_some_frames_is_labeled_so(evaluated, tmp_path):
    sets, scenes, skipped = evaluated
    subject = replace(SUBJECT, handle_collisions=False, scenes=3, frames=100)
    text = evaluation_text(subject, scenes, sets, skipped)
    assert "falls: 1 scene, all with their floor; 'silent' without the guard, the first 100 frames\n" in text
    assert "the guard moved" not in text
    report = evaluation_report(subject, sets, scenes, skipped, tmp_path / "report")
    assert report["model"]["handle_collisions"] is False
    assert report["limits"] == {"scenes": 3, "frames": 100}


def test_data_that_training_had_not_seen_are_marked(evaluated, tmp_path):
    sets, scenes, skipped = evaluated
    seen = replace(TrainingDomain.of(SCENE, 100, 9.0), surfaces=("cone",))
    subject = replace(SUBJECT, card=replace(SUBJECT.card, seen=seen))
    data = evaluation_report(subject, sets, scenes, skipped, tmp_path / "report")["data"]
    assert ["not trained for a solid of kind 'sphere' (1 of 1 scenes)" in one["unseen"] for one in data] == [True] * 2
