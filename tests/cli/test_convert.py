"""`surfsup convert`: what it writes and prints."""

import json

import pytest
import yaml

from tests.cli.test_export import surfsup  # noqa: F401

BLOCK = {"start": [-0.2, 0, -0.2], "end": [0.2, 0.4, 0.2]}


@pytest.fixture
def file(tmp_path):
    def write(**changes):
        path = tmp_path / "scene.json"
        path.write_text(json.dumps({"Configuration": {}, "FluidBlocks": [BLOCK], **changes}))
        return path

    return write


def test_there_and_back(file, tmp_path, surfsup):  # noqa: F811
    ours, theirs = tmp_path / "ours.yaml", tmp_path / "theirs.json"
    status, printed, errors = surfsup("convert", file(), "-o", ours)
    assert (status, printed) == (0, f"scene  {ours}\n"), errors
    assert yaml.safe_load(ours.read_text())["container"] == "none"
    assert surfsup("convert", ours, "-o", theirs)[0] == 0
    assert json.loads(theirs.read_text())["Configuration"]["particleRadius"] == 0.025


def test_what_is_missing_is_refused_without_partial(file, tmp_path, surfsup):  # noqa: F811
    source, out = file(Emitters=[{}], Configuration={"sim2D": True}), tmp_path / "ours.yaml"
    status, _, errors = surfsup("convert", source, "-o", out)
    assert (status, errors) == (
        2, f"surfsup: {source}: has what surfsup does not: 1 emitters; two dimensions. --partial converts the rest\n",
    )  # fmt: skip
    assert not out.exists()
    status, printed, _ = surfsup("convert", source, "-o", out, "--partial")
    assert (status, printed) == (0, f"left out: 1 emitters\nleft out: two dimensions\nscene  {out}\n")
    assert out.exists()


def test_two_files_of_one_program_are_refused(file, tmp_path, surfsup):  # noqa: F811
    status, _, errors = surfsup("convert", file(), "-o", tmp_path / "other.json")
    assert (status, errors.count("\n")) == (2, 1)
    assert "one must be .json, of SPlisHSPlasH, the other .yaml" in errors
