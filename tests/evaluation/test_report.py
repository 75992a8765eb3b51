import json
import math
from dataclasses import replace

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.evaluation.evaluate import evaluate
from surfsup.evaluation.load_trajectories import find_data_sets, load_references
from surfsup.evaluation.report import EvaluationSettings, evaluation_report, json_values, make_folder, write_json
from surfsup.evaluation.scores import METRICS
from surfsup.evaluation.table import evaluation_text, trajectory_text
from surfsup.learned.training_domain import TrainingDomain
from surfsup.learned.weights_file import Card
from surfsup.sph.solver import DfsphSolver
from tests.evaluation.scenes import FRAMES, SCENE, free_fall, write

SETTINGS = EvaluationSettings("ballistic", Card("ballistic", "falls & <nothing else>"), True, 0.09)


@pytest.fixture
def evaluated(tmp_path):
    """Two data sets: one with a floor and a broken file, one without a floor."""
    positions, velocities = free_fall()
    write(tmp_path / "falls/00000.h5", positions, velocities)
    write(tmp_path / "falls/floor/00000-1.h5", positions + np.float32(0.001), velocities)
    (tmp_path / "falls/00001.h5").write_text("not HDF5")
    write(tmp_path / "drops/00000.h5", positions, velocities)
    sets = find_data_sets([tmp_path / "falls", tmp_path / "drops"])
    references, skipped = load_references(sets)
    scenes = evaluate(DfsphSolver(), "ballistic", references, tmp_path / "report")
    return sets, scenes, skipped


@pytest.fixture
def report(evaluated, tmp_path):
    """The report, read from its file."""
    sets, scenes, skipped = evaluated
    write_json(tmp_path / "report.json", evaluation_report(SETTINGS, sets, scenes, skipped, tmp_path / "report"))
    return json.loads((tmp_path / "report.json").read_text())


def test_the_report_has_the_simulator_and_the_meaning_of_every_number(report):
    assert report["simulator"] == {"name": "ballistic", "about": SETTINGS.card.about, "handle_collisions": True}
    assert [metric["key"] for metric in report["metrics"]] == [metric.key for metric in METRICS]
    assert all(metric["description"] for metric in report["metrics"])
    assert report["frame_time"] == 0.005
    assert report["limits"] == {"scenes": None, "frames": None}
    assert report["near"] == 0.09


def test_skipped_files_and_a_missing_floor_are_reported(report, tmp_path):
    falls, drops = report["data"]
    assert (falls["name"], falls["files"], falls["scenes"], falls["floors"]) == ("falls", 2, 1, 1)
    assert [bad["file"] for bad in falls["skipped"]] == ["00001.h5"]
    assert "is not a trajectory" in falls["skipped"][0]["reason"]
    assert falls["floor_missing"] is None
    assert drops["floor_missing"] == f"make it with 'surfsup floor {tmp_path / 'drops'}'"
    assert drops["skipped"] == []


def test_every_scene_has_scores_curves_and_a_trajectory(report, tmp_path):
    first = report["scenes"][0]
    assert (first["data"], first["scene"], first["surface"], first["frames"]) == ("falls", "00000", "sphere", FRAMES)
    assert (tmp_path / "report" / first["trajectory"]).is_file()
    chamfer = first["windows"]["all"]["chamfer"]
    assert chamfer["ratio"] == pytest.approx(chamfer["prediction"] / chamfer["floor"])
    assert chamfer["floor"] == pytest.approx(2 * 0.001 * math.sqrt(3), rel=1e-3)
    assert np.mean(first["curves"]["chamfer"]["prediction"]) == pytest.approx(chamfer["prediction"], rel=1e-4)
    assert [len(curve) for curve in first["curves"]["height"].values()] == [FRAMES] * 3
    assert report["scenes"][1]["curves"]["height"]["floor"] is None
    assert report["scenes"][1]["windows"]["all"]["chamfer"]["floor"] is None


def test_means_are_by_data_set_and_surface(report):
    assert [(mean["data"], mean["surface"]) for mean in report["means"]] == [
        ("falls", "sphere"),
        ("falls", "all"),
        ("drops", "sphere"),
        ("drops", "all"),
    ]
    assert report["means"][1]["windows"]["all"]["chamfer"] == report["scenes"][0]["windows"]["all"]["chamfer"]


def test_values_that_json_does_not_have_become_none():
    assert json_values(np.array([1.23456789, np.nan, np.inf, 0])) == [1.23457, None, None, 0]


def test_the_text_has_value_floor_and_ratio_and_names_missing_floors_and_skipped_files(evaluated, tmp_path):
    sets, scenes, skipped = evaluated
    text = evaluation_text(SETTINGS, scenes, sets, skipped)
    assert "falls: 1 scene, all with a floor; 'ballistic' with collision handling\n" in text
    assert text.count("collision handling moved 0.00 %") == 2
    assert f"drops: 1 scene, no floor (make it with 'surfsup floor {tmp_path / 'drops'}')" in text
    assert f"1 skipped:\n  {tmp_path / 'falls/00001.h5'}: is not a trajectory" in text
    lines = text.splitlines()
    assert lines[3].split() == ["value", "floor", "ratio"] * 4
    assert lines[5].split()[:5] == ["sphere", "(1)", "0.0000", "0.0035", "0.00"]
    assert "Surface Penetration 0 (floor 0)" in text
    assert max(map(len, lines[:12])) <= 120
    assert all(metric.description in text for metric in METRICS)


def test_the_text_of_a_trajectory_has_windows_with_and_without_a_floor(evaluated):
    _, scenes, _ = evaluated
    with_floor, without = (trajectory_text(scene.evaluation) for scene in scenes)
    assert "floor" in with_floor.splitlines()[1]
    assert with_floor.splitlines()[2].split()[0] == "all"  # the 10 frames reach no other
    assert without.splitlines()[1].split()[0] == "all"
    assert len(without.splitlines()[1].split()) == 5


def test_a_folder_that_cannot_be_made_is_an_input_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be made"):
        make_folder(tmp_path / "file" / "report")


def test_evaluation_without_collision_handling_over_some_frames_is_labeled(evaluated, tmp_path):
    sets, scenes, skipped = evaluated
    settings = replace(SETTINGS, handle_collisions=False, scenes=3, frames=100)
    text = evaluation_text(settings, scenes, sets, skipped)
    assert "falls: 1 scene, all with a floor; 'ballistic' without collision handling, the first 100 frames\n" in text
    assert "collision handling moved" not in text
    report = evaluation_report(settings, sets, scenes, skipped, tmp_path / "report")
    assert report["simulator"]["handle_collisions"] is False
    assert report["limits"] == {"scenes": 3, "frames": 100}


def test_data_sets_outside_the_training_domain_have_a_warning(evaluated, tmp_path):
    sets, scenes, skipped = evaluated
    domain = replace(TrainingDomain.from_scene(SCENE, 100, 9.0), surfaces=("cone",))
    settings = replace(SETTINGS, card=replace(SETTINGS.card, training_domain=domain))
    data = evaluation_report(settings, sets, scenes, skipped, tmp_path / "report")["data"]
    for one in data:
        assert "not trained for a surface of kind 'sphere' (1 of 1 scenes)" in one["domain_warning"]


def test_a_simulator_without_weights_has_no_card_and_no_warning(evaluated, tmp_path):
    sets, scenes, skipped = evaluated
    report = evaluation_report(replace(SETTINGS, card=None), sets, scenes, skipped, tmp_path / "report")
    assert (report["simulator"]["name"], report["simulator"]["about"]) == ("ballistic", "")
    assert [one["domain_warning"] for one in report["data"]] == [None, None]
