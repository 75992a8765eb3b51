import re
import time

from surfsup import activity
from surfsup.cli import activity_lines as lines
from surfsup.sdf import MeshSurface, Sphere, load_mesh
from tests.sdf.solids import points_around


def test_a_short_activity_is_silent_and_a_long_one_says_what_it_is(capsys, monkeypatch):
    with lines.activity_lines("reading ball.obj"):
        pass
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(lines, "FIRST_LINE", 0.02)
    monkeypatch.setattr(lines, "LINE_EVERY", 0.02)
    with lines.activity_lines("reading ball.obj"):
        time.sleep(0.3)
    first, *others = capsys.readouterr().err.splitlines()
    assert first == "reading ball.obj ..."
    assert others and all(re.fullmatch(r"reading ball.obj: \d+ s so far", line) for line in others)


def test_reading_and_gridding_a_mesh_announce_themselves(tmp_path, monkeypatch):
    Sphere(0.3).to_mesh(12).export(tmp_path / "ball.obj")
    seen = []

    def record(text):
        seen.append(text)
        return activity.nullcontext()

    monkeypatch.setattr(activity, "reporter", record)
    MeshSurface(load_mesh(tmp_path / "ball.obj"), cells=8).distance(points_around(Sphere(0.3), count=9).float())
    assert seen[0] == f"reading {tmp_path / 'ball.obj'}"
    assert seen[1].startswith("computing the distances around a mesh of")
