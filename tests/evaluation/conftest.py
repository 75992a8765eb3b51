import pytest

from surfsup.io.trajectory import Trajectory
from tests.evaluation.scenes import free_fall, write


@pytest.fixture
def reference(tmp_path):
    """A free fall from rest, integrated as the reference solver does."""
    with Trajectory(write(tmp_path / "00000.h5", *free_fall())) as trajectory:
        yield trajectory
