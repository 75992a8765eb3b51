"""Scenes with a liquid on the command line."""

import pytest

from tests.cli.test_cli import surfsup

FLUID = "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]\nframes: 3\n"


@pytest.mark.parametrize(
    ("liquid", "simulator", "message"),
    [
        ("{viscosity: -0.1}", "dfsph", "liquid.viscosity: Input should be greater than or equal to 0 (found -0.1)"),
        ("honye", "dfsph", "liquid: there is no liquid 'honye'; did you mean 'honey'?"),
        (
            "honey",
            "surfsup",
            "knows no liquid but water as the solver has it; use the simulator dfsph, or omit 'liquid'",
        ),
    ],
)
def test_what_cannot_be_ends_with_status_2_and_one_line(tmp_path, liquid, simulator, message):
    scene = tmp_path / "scene.yaml"
    scene.write_text(f"{FLUID}liquid: {liquid}\n")
    done = surfsup("simulate", scene, "--simulator", simulator, "-o", tmp_path / "out")
    assert done.returncode == 2 and message in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
