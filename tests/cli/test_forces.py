"""`surfsup forces`: a table and a plot of the forces on solids."""

from tests.cli.test_cli import surfsup
from tests.io.test_force_table import write


def test_table_and_plot_are_written_next_to_the_trajectory(tmp_path):
    path = tmp_path / "trajectory.h5"
    write(path, ["ball", "step"])
    done = surfsup("forces", path, "--solid", "step")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "forces.csv").read_text().count("step") == 39
    assert (tmp_path / "forces.png").read_bytes().startswith(b"\x89PNG")


def test_a_solid_without_forces_is_an_error_of_one_line(tmp_path):
    path = tmp_path / "trajectory.h5"
    write(path, ["ball"])
    done = surfsup("forces", path, "--solid", "ship")
    assert done.returncode == 2 and "has no forces on 'ship'" in done.stderr and done.stderr.count("\n") == 1
