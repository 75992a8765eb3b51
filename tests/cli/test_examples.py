"""`surfsup examples`, and the completion of the shell."""

import os
import subprocess
import sys

import pytest

from tests.cli.test_export import surfsup  # noqa: F401


def test_it_lists_them_with_what_they_show(surfsup):  # noqa: F811
    status, printed, _ = surfsup("examples")
    assert status == 0
    assert "teacup           A teacup of primitives, filled to a level with particles 3 mm across\n" in printed
    assert "knot             A mesh that water falls on\n" in printed


def test_it_simulates_one(surfsup, tmp_path, monkeypatch):  # noqa: F811
    scene = "# Five frames of water.\nframes: 5\nfluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7]}}]\n"
    (tmp_path / "drop.yaml").write_text(scene)
    monkeypatch.setattr("surfsup.scene.examples.examples_folder", lambda: tmp_path)
    status, printed, errors = surfsup("examples", "drop", "-o", tmp_path / "out", "--no-page", "--no-video")
    assert status == 0, errors
    assert "125 particles, 5 frames" in printed
    status, _, errors = surfsup("examples", "drip")
    assert (status, errors) == (2, "surfsup: there is no example 'drip' (did you mean 'drop'?); there are drop\n")


@pytest.mark.parametrize(
    ("words", "completion"),
    [("surfsup swe", "sweep"), ("surfsup generate ta", "tanks"), ("surfsup examples te", "teacup")],
)
def test_the_shell_completes_verbs_recipes_and_examples(words, completion):
    variables = {"_SURFSUP_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    command = [sys.executable, "-c", "import sys; sys.argv[0] = 'surfsup'; from surfsup.cli import main; main()"]
    printed = subprocess.run(command, env={**os.environ, **variables}, capture_output=True, text=True).stdout
    assert completion in printed.split()
