"""The cache: the same results with it, without it, and when it is damaged; never an error, never too large."""

import os
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from surfsup import Scene, Simulation, cache, doctor
from surfsup.cli.program import app
from surfsup.scene import Block, Shape

KNOT = Path(__file__).parents[1] / "examples" / "knot.obj"
KEY = cache.digest("a key")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SURFSUP_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


class Computation:
    """Arrays, and how often they were computed."""

    def __init__(self, size: int = 3) -> None:
        self.size, self.count = size, 0

    def __call__(self) -> cache.Arrays:
        self.count += 1
        return {"a": np.arange(self.size) / 3, "b": np.array([[1, 2]], np.int32)}


def test_a_result_is_computed_once_and_read_again_bit_for_bit():
    compute = Computation()
    first, second = cache.cached("test", KEY, compute), cache.cached("test", KEY, compute)
    assert compute.count == 1
    for name, array in first.items():
        assert second[name].dtype == array.dtype
        np.testing.assert_array_equal(second[name], array)


@pytest.mark.parametrize(
    "other", [("a",), ("a", 1.0), (b"a", 1), ("a", np.ones(1)), ("a", np.ones(1, np.float32)), ("a", np.ones((1, 1)))]
)
def test_keys_of_other_types_shapes_or_values_differ(other):
    assert cache.digest(*other) != cache.digest("a", 1)
    assert cache.digest(*other) == cache.digest(*other)


def test_another_key_kind_or_code_is_another_entry(monkeypatch):
    compute = Computation()
    cache.cached("test", KEY, compute)
    cache.cached("test", cache.digest("another key"), compute)
    cache.cached("other", KEY, compute)
    monkeypatch.setattr(cache, "code_version", lambda: b"newer code")
    cache.cached("test", KEY, compute)
    assert compute.count == 4


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "text", "folder"])
def test_a_damaged_entry_is_ignored_and_written_again(damage, folder):
    compute = Computation(1000)
    cache.cached("test", KEY, compute)
    (entry,) = folder.iterdir()
    content = bytearray(entry.read_bytes())
    content[-100] ^= 1
    entry.unlink()
    if damage == "folder":
        entry.mkdir()
    else:
        entry.write_bytes({"cut": content[:500], "flip": content, "empty": b"", "text": b"no entry" * 9}[damage])
    for _ in range(2):
        np.testing.assert_array_equal(cache.cached("test", KEY, compute)["a"], np.arange(1000) / 3)
    assert compute.count == (3 if damage == "folder" else 2)


def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("SURFSUP_CACHE", str(tmp_path / "file" / "cache"))
    compute = Computation()
    for _ in range(2):
        assert len(cache.cached("test", KEY, compute)["a"]) == 3
    assert compute.count == 2
    check = doctor.check_cache()
    assert not check.passed
    assert "SURFSUP_CACHE" in check.remedy


def test_entries_used_longest_ago_are_deleted(folder, monkeypatch):
    compute = Computation(1000)  # 8 kB
    keys = [cache.digest(number) for number in range(4)]
    for age, key in enumerate(keys[:3]):
        cache.cached("test", key, compute)
        newest = max(folder.iterdir(), key=lambda path: path.stat().st_mtime)
        os.utime(newest, (age + 1, age + 1))
    cache.cached("test", keys[0], compute)  # used again
    monkeypatch.setattr(cache, "MAX_BYTES", 26_000)
    cache.cached("test", keys[3], compute)
    assert cache.size() <= 26_000
    compute.count = 0
    for key in (keys[0], keys[2], keys[3]):
        cache.cached("test", key, compute)
    assert compute.count == 0
    cache.cached("test", keys[1], compute)
    assert compute.count == 1


def test_the_place_follows_the_variables(monkeypatch):
    assert cache.folder() == Path(os.environ["SURFSUP_CACHE"])
    monkeypatch.delenv("SURFSUP_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert cache.folder() == Path("/somewhere/surfsup")
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache.folder() == Path.home() / ".cache" / "surfsup"


def test_the_doctor_says_where_the_cache_is_and_how_large(folder):
    cache.cached("test", KEY, Computation(200_000))
    assert f"{folder}, 2 MB of at most 1000 MB" in CliRunner().invoke(app, ["doctor"]).output


def rollout(scene: Scene) -> list[tuple[np.ndarray, np.ndarray]]:
    return [(frame.positions, frame.velocities) for frame in Simulation(scene).run()]


def test_a_rollout_is_the_same_with_and_without_the_cache(folder, monkeypatch, tmp_path):
    shape = Shape.model_validate({"mesh": {"file": KNOT, "fit": 0.45}, "at": (0.0, 0.02, 0.0)})
    scene = Scene(surface=shape, fluid=[Block((-0.15, -0.15, 0.5), (0.15, 0.15, 0.7))], frames=60)
    first = rollout(scene)
    assert {path.name.rpartition("-")[0] for path in folder.iterdir()} == {"mesh", "grid", "boundary-map"}
    again = rollout(scene)
    (tmp_path / "file").touch()
    monkeypatch.setenv("SURFSUP_CACHE", str(tmp_path / "file"))
    without = rollout(scene)
    for frames in zip(first, again, without, strict=True):
        for kept in frames[1:]:
            np.testing.assert_array_equal(kept[0], frames[0][0])
            np.testing.assert_array_equal(kept[1], frames[0][1])
