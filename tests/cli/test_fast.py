"""The option ``--fast`` of ``surfsup simulate``."""

import pytest

from surfsup.io.trajectory import Trajectory
from surfsup.native.dispatch import is_built
from tests.cli.test_cli import SCENE, surfsup


@pytest.mark.skipif(not is_built(), reason="long steps run in C++ only")
def test_fast_simulates_by_long_steps(tmp_path):
    (tmp_path / "scene.yaml").write_text(SCENE)
    done = surfsup("simulate", "scene.yaml", "--fast", "-o", "out", "--no-page", "--no-video", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with Trajectory(tmp_path / "out" / "trajectory.h5") as trajectory:
        assert trajectory.provenance.simulator == "dfsph-fast"
        assert len(trajectory.positions) == 30


def test_fast_is_for_the_solver(tmp_path):
    (tmp_path / "scene.yaml").write_text(SCENE)
    done = surfsup("simulate", "scene.yaml", "--fast", "--simulator", "surfsup", "-o", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert "--fast is for the solver" in done.stderr
    assert not (tmp_path / "out").exists()
