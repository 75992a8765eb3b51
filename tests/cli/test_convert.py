"""`surfsup convert`: what it writes and prints."""

import json

import pytest
import yaml

from tests.cli.test_export import surfsup  # noqa: F401

FIELD = {"particleField": "velocity", "expression_x": "t"}
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
    source, out = file(AnimationFields=[FIELD], Configuration={"sim2D": True}), tmp_path / "ours.yaml"
    status, _, errors = surfsup("convert", source, "-o", out)
    missing = "the animation field of velocity = (t, 0, 0); two dimensions"
    assert (status, errors) == (
        2,
        f"surfsup: {source}: has what surfsup does not: {missing}. --partial converts the rest\n",
    )
    assert not out.exists()
    status, printed, _ = surfsup("convert", source, "-o", out, "--partial")
    assert (status, printed) == (0, f"left out: {missing.replace('; ', chr(10) + 'left out: ')}\nscene  {out}\n")
    assert out.exists()


def test_two_files_of_one_program_are_refused(file, tmp_path, surfsup):  # noqa: F811
    status, _, errors = surfsup("convert", file(), "-o", tmp_path / "other.json")
    assert (status, errors.count("\n")) == (2, 1)
    assert "one must be .json, of SPlisHSPlasH, the other .yaml" in errors


def test_what_cannot_be_converted_to_the_reference_leaves_an_older_file(file, tmp_path, surfsup):  # noqa: F811
    ours, theirs = tmp_path / "ours.yaml", tmp_path / "theirs.json"
    ours.write_text(
        "surfaces: {boat: {box: {size: [0.2, 0.2, 0.2]}, at: [0, 0, 0.2], rigid_body: {density: 500}}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7]}}]\n"
    )
    theirs.write_text("older")
    status, _, errors = surfsup("convert", ours, "-o", theirs)
    assert (status, errors.count("\n"), theirs.read_text()) == (2, 1, "older")
    assert "bodies that float; they stand still" in errors
    assert surfsup("convert", ours, "-o", theirs, "--partial")[0] == 0


def test_a_place_that_cannot_be_written_and_a_missing_scene_are_one_line(file, tmp_path, surfsup):  # noqa: F811
    for source, out, message in (
        (file(), tmp_path / "nowhere" / "a.yaml", "cannot be written"),
        (tmp_path / "missing.json", tmp_path / "a.yaml", "does not exist"),
    ):
        status, _, errors = surfsup("convert", source, "-o", out)
        assert (status, errors.count("\n")) == (2, 1)
        assert message in errors
