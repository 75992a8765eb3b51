import base64
import gzip
import json
import re

import numpy as np
import pytest

from surfsup.scene.liquid import LIQUIDS
from surfsup.viewing.liquid_look import WATER, look_of
from surfsup.viewing.moving_mesh import MovingMesh
from surfsup.viewing.web_player import write_web_player

POSITIONS = np.random.default_rng(0).uniform([-0.5, -0.5, 0], [0.5, 0.5, 2], (7, 50, 3)).astype(np.float32)


def contents(page):
    header = json.loads(re.search(r'<script id="header"[^>]*>(.*?)</script>', page, re.S)[1])
    body = gzip.decompress(base64.b64decode(re.search(r'<script id="data"[^>]*>(.*?)</script>', page, re.S)[1]))
    return header, body


def test_the_page_contains_the_trajectory_and_the_solid(tmp_path, ball):
    calls = []
    write_web_player(tmp_path / "p.html", POSITIONS, ball, (1, 1, 2), 0.015, 0.005, lambda *call: calls.append(call))
    header, body = contents((tmp_path / "p.html").read_text())
    assert header["frames"] == 7 and header["particles"] == 50 and header["faces"] == len(ball.faces)
    differences = np.frombuffer(body[-7 * 50 * 3 * 2 :], "<u2").reshape(7, 50, 3)
    grid = np.cumsum(differences, axis=0, dtype=np.uint16)
    np.testing.assert_allclose(grid / 65535 * header["extent"] + header["low"], POSITIONS, atol=2e-5)
    assert len(body) == 4 * 3 * (header["faces"] + 2 * header["vertices"]) + 50 * 2 + 7 * 50 * 3 * 2
    assert calls[-1] == (7, 7)


def test_the_page_needs_no_network(tmp_path, ball):
    write_web_player(tmp_path / "p.html", POSITIONS, ball, (1, 1, 2), 0.015)
    page = (tmp_path / "p.html").read_text()
    assert not re.search(r"https?:|<link[^>]+href=\"(?!data:)|<script[^>]+src|fetch\(|import\(|@import", page)
    assert "__DATA__" not in page and "__SCRIPT__" not in page


def test_the_page_says_what_it_shows_and_runs_nothing_of_its_title(tmp_path):
    many = np.broadcast_to(np.zeros(3, np.float32), (2, 50_000, 3))
    write_web_player(
        tmp_path / "p.html", many, None, (1, 1, 2), 0.015, title="<script>alert(1)</script>", simulator="gns"
    )
    page = (tmp_path / "p.html").read_text()
    title = "&lt;script&gt;alert(1)&lt;/script&gt;"
    assert f"<title>{title} - surfsup</title>" in page and "<script>alert" not in page
    assert f"{title} · gns · 50,000 particles, 25,000 of them shown" in page


def test_long_trajectories_are_subsampled_and_keep_their_duration(tmp_path):
    long = np.zeros((800, 10_000, 3), np.float32)
    write_web_player(tmp_path / "p.html", long, None, (1, 1, 2), 0.015, 0.005)
    header, _ = contents((tmp_path / "p.html").read_text())
    assert header["frames"] * header["particles"] * 6 <= 10_100_000
    assert header["frames"] * header["frameTime"] == pytest.approx(4.0, rel=0.02)


def test_the_page_knows_the_liquid_of_each_particle_and_how_it_looks(tmp_path):
    liquids = (np.arange(50) % 2).astype(np.int32)
    looks = [WATER, look_of(LIQUIDS["oil"])]
    write_web_player(tmp_path / "p.html", POSITIONS, None, (1, 1, 2), 0.015, looks=looks, liquids=liquids)
    header, body = contents((tmp_path / "p.html").read_text())
    np.testing.assert_array_equal(np.frombuffer(body, "<u2", 50, len(body) - 7 * 50 * 3 * 2 - 50 * 2), liquids)
    for shown, look in zip(header["liquids"], looks, strict=True):
        np.testing.assert_allclose(shown["absorption"], look.absorption)
        np.testing.assert_allclose(shown["scattering"], look.scattering)


def test_wrong_shapes_are_rejected(tmp_path):
    with pytest.raises(ValueError, match="frames, particles, 3"):
        write_web_player(tmp_path / "p.html", POSITIONS[0], None, (1, 1, 2), 0.015)


def test_the_page_contains_the_solids_that_move_and_their_poses(tmp_path, ball):
    poses = np.tile([0.0, 0, 1, 1, 0, 0, 0], (7, 1)) + 0.1 * np.arange(7)[:, None] * [1, 0, 0, 0, 0, 0, 0]
    write_web_player(
        tmp_path / "p.html", POSITIONS, None, (1, 1, 2), 0.015, moving=[MovingMesh(ball, poses)], container_poses=poses
    )
    header, body = contents((tmp_path / "p.html").read_text())
    assert header["moving"] == [{"vertices": len(ball.vertices), "faces": len(ball.faces)}] and header["containerMoves"]
    paths = np.frombuffer(body, "<f4", 2 * 7 * 7, len(body) - 50 * 2 - 7 * 50 * 3 * 2 - 2 * 7 * 7 * 4).reshape(2, 7, 7)
    np.testing.assert_allclose(paths, [poses, poses], atol=1e-6)


def test_solids_that_move_are_scaled_as_the_water(tmp_path, ball):
    poses = np.tile([0.1, 0, 0.2, 0, 1, 0, 0], (7, 1))
    body = MovingMesh(ball, poses)
    write_web_player(tmp_path / "p.html", POSITIONS, None, (0.2, 0.2, 0.4), 0.003, moving=[body], container_poses=poses)
    header, data = contents((tmp_path / "p.html").read_text())
    assert header["scale"] == 5
    paths = np.frombuffer(data, "<f4", 2 * 7 * 7, len(data) - 50 * 2 - 7 * 50 * 3 * 2 - 2 * 7 * 7 * 4).reshape(2, 7, 7)
    np.testing.assert_allclose(paths, np.tile([0.5, 0, 1, 0, 1, 0, 0], (2, 7, 1)), atol=1e-6)
    vertices = np.frombuffer(data, "<f4", 3 * len(ball.vertices), 12 * len(ball.faces)).reshape(-1, 3)
    np.testing.assert_allclose(np.ptp(vertices, axis=0), 5 * np.ptp(ball.vertices, axis=0), rtol=1e-5)
