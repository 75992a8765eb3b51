"""The forces on solids as a table."""

import csv
from pathlib import Path

import numpy as np
import pytest

import surfsup as sf
from surfsup.errors import InputError
from surfsup.io.force_table import recorded_solids, write_force_table
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.scene.wrench import Wrench

SCENE = (
    "surfaces: {ball: {sphere: {radius: 0.1}}, step: {box: {size: [0.1, 0.1, 0.1]}, at: [0.4, 0, 0]}}\n"
    "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]\n"
)


def write(path, names):
    scene = Scene.from_yaml(SCENE, "test")
    with TrajectoryWriter(path, scene, Provenance("dfsph"), 5) as writer:
        for number in range(40):
            wrenches = {name: Wrench(np.array([number, 0, -2.5]), np.array([0, 0.5, 0])) for name in names}
            writer.append(np.zeros((5, 3)), np.zeros((5, 3)), forces=wrenches if number else {})


def test_the_table_has_a_row_for_each_frame_and_solid(tmp_path):
    path = tmp_path / "trajectory.h5"
    write(path, ["ball", "step"])
    with Trajectory(path) as trajectory:
        assert recorded_solids(trajectory, path) == ["ball", "step"]
        assert recorded_solids(trajectory, path, ["step"]) == ["step"]
        write_force_table(trajectory, ["ball", "step"], tmp_path / "forces.csv")
    rows = list(csv.DictReader((tmp_path / "forces.csv").open()))
    assert len(rows) == 2 * 39
    assert rows[0] == {
        "time_s": "0.005",
        "solid": "ball",
        **{"force_x_N": "1", "force_y_N": "0", "force_z_N": "-2.5"},
        **{"torque_x_Nm": "0", "torque_y_Nm": "0.5", "torque_z_Nm": "0"},
    }


@pytest.mark.parametrize(
    ("recorded", "names", "message"),
    [
        ([], [], "has no forces; simulate the scene with the key 'forces: all'"),
        (["ball"], ["ship"], "has no forces on 'ship'; it has those on ball"),
    ],
)
def test_forces_that_are_not_there_are_an_error_of_one_line(tmp_path, recorded, names, message):
    path = tmp_path / "trajectory.h5"
    write(path, recorded)
    with Trajectory(path) as trajectory, pytest.raises(InputError, match=message):
        recorded_solids(trajectory, path, names)


def test_a_table_that_cannot_be_written_is_an_error_of_one_line(tmp_path):
    path = tmp_path / "trajectory.h5"
    write(path, ["ball"])
    with Trajectory(path) as trajectory, pytest.raises(InputError, match="cannot be written"):
        write_force_table(trajectory, ["ball"], Path(tmp_path / "absent" / "forces.csv"))


@pytest.mark.skipif(not is_built(), reason="the package was built without a compiler")
def test_a_simulation_records_the_forces_that_its_scene_names(tmp_path):
    path = tmp_path / "trajectory.h5"
    sf.Simulation(Scene.from_yaml(SCENE + "forces: [ball]\nframes: 4\n", "test")).record(path)
    with Trajectory(path) as trajectory:
        assert list(trajectory.forces) == ["ball"] and not trajectory.forces["ball"][1:].any()
