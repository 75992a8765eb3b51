import resource
import subprocess
import sys

import numpy as np
import pytest

from surfsup.io.reserved_space import ReservedSpace
from surfsup.io.trajectory import Trajectory

WRITE = """
import resource, sys
import numpy as np
from pathlib import Path
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Scene

scene = Scene.from_yaml("fluid: [{block: {min: [0, 0, 1], max: [0.1, 0.1, 1.1]}}]", "test")
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
random = np.random.default_rng(0)
try:
    with TrajectoryWriter(Path(sys.argv[1]), scene, Provenance("test"), 500) as out:
        for _ in range(40):
            out.append(*random.normal(size=(2, 500, 3)).astype(np.float32))
except ValueError as error:  # InputError
    print(type(error).__name__, error)
"""


def test_space_is_reserved_and_what_is_not_used_is_given_back(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"water")
    space = ReservedSpace(path)
    space.reserve(1000)
    assert path.stat().st_size == 1000
    assert path.read_bytes()[:5] == b"water"
    space.release(5)
    space.release(9)
    assert path.read_bytes() == b"water"


@pytest.mark.parametrize(("limit", "some"), [(20_000, False), (280_000, False), (500_000, True), (650_000, True)])
def test_a_limit_at_any_moment_is_one_line_and_leaves_readable_frames(tmp_path, limit, some):
    path = tmp_path / "water.h5"
    done = subprocess.run(
        [sys.executable, "-c", WRITE, path, str(limit)], capture_output=True, text=True, check=True, timeout=60
    )
    assert "InputError" in done.stdout and "the disk is full, or a limit is reached" in done.stdout
    assert len(done.stdout.splitlines()) == 1 and not done.stderr
    assert path.exists() == some
    if some:
        with Trajectory(path) as trajectory:
            count = len(trajectory)
            assert 0 < count < 40 and f"; {count} frames are kept" in done.stdout
            assert np.isfinite(trajectory.positions[:]).all()


def test_a_file_within_its_limit_is_as_large_as_without_one(tmp_path):
    sizes = []
    for limit in (1 << 20, resource.RLIM_INFINITY):
        path = tmp_path / f"{limit}.h5"
        subprocess.run([sys.executable, "-c", WRITE, path, str(limit)], check=True, timeout=60)
        sizes.append(path.stat().st_size)
    assert sizes[0] == sizes[1]
