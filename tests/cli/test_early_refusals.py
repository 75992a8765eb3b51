"""What can be refused without the libraries is refused at once: torch alone takes two seconds to load."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from surfsup.scene import Scene
from surfsup.scene.scene_file import KEYS

# surfsup where the import of these libraries fails.
PROGRAM = """
import sys
sys.modules.update(dict.fromkeys(("torch", "warp", "h5py", "trimesh", "pyvista", "scipy")))
from surfsup.cli.program import main
main()
"""
REFUSALS = [
    ("simulate absent", "absent: there is no such file; give a file or a shipped surface (bowls, chairs, coral)"),
    ("simulate absent.obj", "absent.obj: cannot be read (No such file or directory); check the path"),
    ("simulate absent.yaml", "absent.yaml: cannot be read as a scene: No such file or directory"),
    ("simulate typo.yaml", "typo.yaml: unknown key 'gravty'; did you mean 'gravity'?"),
    ("simulate list.yaml", "list.yaml: a scene is a mapping with at least the key 'fluid'"),
    ("simulate broken.yaml", "broken.yaml: line 2 is not YAML: expected the node content"),
    ("simulate coral --simulator surfup", "there is no simulator 'surfup' (did you mean 'surfsup'?)"),
    ("simulate coral --block-min 0 0 1", "--block-min is one corner of the block of water; give the opposite one, too"),
    ("live absent.yaml", "absent.yaml: cannot be read as a scene: No such file or directory"),
    ("reference absent.obj", "absent.obj: cannot be read (No such file or directory); check the path"),
    ("sweep typo.yaml -o out", "typo.yaml: unknown key 'gravty'; did you mean 'gravity'?"),
    ("examples teapot", "there is no example 'teapot'"),
    ("view absent", "absent: there is no such trajectory file"),
    ("render .", ".: has no trajectory.h5"),
    ("export absent --to ply", "absent: there is no such trajectory file"),
    ("compare typo.yaml absent", "absent: there is no such trajectory file"),
    ("forces absent", "absent: there is no such trajectory file"),
    ("evaluate surfup .", "there is no simulator 'surfup' (did you mean 'surfsup'?)"),
    ("evaluate dfsph absent", "absent: there is no such folder"),
    ("floor .", ".: has no trajectories (*.h5)"),
    ("train surfup --data . --validation . -o out", "there is no training preset or file 'surfup' (did you mean"),
    ("train surfsup --data absent --validation . -o out", "absent: there is no such folder"),
    ("generate prim-shape -n 1 -o out", "there is no recipe 'prim-shape' (did you mean 'prim-shapes'?)"),
    ("generate chairs -n 1 --source absent -o out", "--source absent: does not exist"),
    ("convert absent -o scene.yaml", "absent: does not exist"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("refusals")
    (folder / "typo.yaml").write_text("fluid: []\ngravty: [0, 0, -1]\n")
    (folder / "list.yaml").write_text("- fluid\n")
    (folder / "broken.yaml").write_text("fluid: [\n")
    return folder


@pytest.mark.parametrize(("command", "line"), REFUSALS)
def test_a_refusal_that_needs_no_library_loads_none(folder, command, line):
    environment = {**os.environ, "PYTHONPATH": str(Path("src").resolve())}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *command.split()], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("surfsup: ") and done.stderr.count("\n") == 1
    assert line in done.stderr


def test_the_keys_that_are_known_early_are_those_of_a_scene():
    assert tuple(field.alias or name for name, field in Scene.model_fields.items()) == KEYS
